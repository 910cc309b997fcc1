// A leakage. Without a trusted ammeter its recording is that of a current sensor with an offset.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/mechanisms/constant_current.hpp"
#include "model/mechanisms/current_offset.hpp"
#include "model/mechanisms/leakage.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::Leakage> : DefaultKnowledge<model::Leakage> {
  static constexpr MechanismText text = {
      .id = model::Leakage::id,
      .name = "a leakage",
      .brief = "the cell loses charge by itself",
      .mark = "empties the cell with time, so that it is lower after a rest with nothing connected",
      .meaning = "A current inside the cell, or one that bypasses the sensor, empties the cell all the time.",
      .action =
          "Look for loads that bypass the sensor and for balancing resistors that stay on. If you find no load, watch "
          "the cell for an internal short circuit."};
  static constexpr bool report_limit = true;
  static constexpr Fact facts = Fact::rests;
  static constexpr std::size_t same_recording_as = model::mechanism_index_of<model::CurrentOffset>;

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the cell {} {} all the time, which no sensor sees", s.value[0] >= 0 ? "loses" : "gains",
                       size_text(s, 0));
  }
  static std::optional<std::string> not_testable(const TestConditions& c) { return constant_current::too_short(c); }
  static std::vector<std::vector<double>> far_starts(const MechanismSetting&, const RecordingFacts& seen) {
    return constant_current::far_starts(model::Leakage::parameters[0], seen);
  }
};

}  // namespace bms::diagnosis
