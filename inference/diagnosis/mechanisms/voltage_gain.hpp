// A gain error of the voltage sensor.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "model/mechanisms/voltage_gain.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::VoltageGain> : DefaultKnowledge<model::VoltageGain> {
  static constexpr MechanismText text = {.id = model::VoltageGain::id,
                                         .name = "a gain error of the voltage sensor",
                                         .brief = "the voltage sensor's scale is off",
                                         .mark = "is the same part of the voltage at every load",
                                         .meaning = "The divider or the reference of the voltage channel is off.",
                                         .action = "Calibrate the voltage channel at two voltages."};
  static constexpr bool outside_cell = true;
  static constexpr Fact facts = Fact::reversals;

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the voltage sensor reads {} by {}", s.value[0] >= 0 ? "high" : "low", size_text(s, 0, "%"));
  }
};

}  // namespace bms::diagnosis
