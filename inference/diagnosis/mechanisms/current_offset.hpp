// An offset of the current sensor. It moves charge, so its effect is far from linear once a knee of the OCV is crossed.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/mechanisms/constant_current.hpp"
#include "model/mechanisms/current_offset.hpp"
#include "model/mechanisms/leakage.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::CurrentOffset> : DefaultKnowledge<model::CurrentOffset> {
  static constexpr MechanismText text = {
      .id = model::CurrentOffset::id,
      .name = "an offset of the current sensor",
      .brief = "the current sensor's zero is off",
      .mark = "makes the counted charge drift with time and can be read off the sensor when nothing flows",
      .meaning = "The sensor reads a current where none flows, so the counted charge drifts all the time.",
      .action = "Zero the current sensor with the contactors open, or let the extended cell file subtract the offset."};
  static constexpr bool report_limit = true;
  static constexpr Fact facts = Fact::rests;
  static constexpr std::size_t same_recording_as = model::mechanism_index_of<model::Leakage>;

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the current sensor reads {} too {}", size_text(s, 0), s.value[0] >= 0 ? "high" : "low");
  }
  static constexpr double certain_sigmas = 5;  ///< of the reading in rests, from which the sensor's zero is off

  static bool expected(const model::CellParameters<>&, const RecordingFacts& seen) {
    return seen.zero_error_sigmas > certain_sigmas;
  }
  static std::optional<std::string> not_testable(const TestConditions& c) { return constant_current::too_short(c); }
  static std::vector<std::vector<double>> far_starts(const MechanismSetting&, const RecordingFacts& seen) {
    return constant_current::far_starts(model::CurrentOffset::parameters[0], seen);
  }
};

}  // namespace bms::diagnosis
