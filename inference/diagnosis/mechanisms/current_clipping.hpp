// Clipping of the current sensor. The sensor ends at the largest current that was read.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "model/mechanisms/current_clipping.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::CurrentClipping> : DefaultKnowledge<model::CurrentClipping> {
  static constexpr MechanismText text = {
      .id = model::CurrentClipping::id,
      .name = "clipping of the current sensor",
      .brief = "the current sensor ends before the current does",
      .mark = "shows only where the current reads its largest value while the voltage goes on falling",
      .meaning = "The sensor saturates: what flows beyond its end is neither seen nor counted.",
      .action = "Use a sensor or an amplifier with a wider range. The charge counted at its end is too small."};
  static constexpr Fact facts = Fact::rates;
  static constexpr std::size_t limit = 1;  ///< place of the parameter limit_a

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the current sensor ends at {}, and {} more flows there on average",
                       quantity(s.value[limit], 0, "A"), size_text(s, 0));
  }
  static std::vector<double> probing_shapes(double) { return {0.02, 0.15, 0.5}; }
  static void adjust_probe(MechanismSetting& probe, const RecordingFacts& seen) {
    probe.value[limit] = seen.rail_a.value_or(probe.value[limit]);
  }
  static std::optional<std::string> not_testable(const TestConditions& c) {
    if (!c.facts.rail_a) return "the largest current is reached too seldom";
    return std::nullopt;
  }
};

}  // namespace bms::diagnosis
