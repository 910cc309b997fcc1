// An offset of the voltage sensor.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "model/mechanisms/voltage_offset.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::VoltageOffset> : DefaultKnowledge<model::VoltageOffset> {
  static constexpr MechanismText text = {.id = model::VoltageOffset::id,
                                         .name = "an offset of the voltage sensor",
                                         .brief = "the voltage sensor's zero is off",
                                         .mark = "is the same at every load, in both directions and at rest",
                                         .meaning = "The voltage channel reads too high or too low by a constant.",
                                         .action = "Calibrate the voltage channel and check the sense wires."};
  static constexpr bool outside_cell = true;
  static constexpr bool report_limit = true;
  static constexpr Fact facts = Fact::reversals;

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the voltage sensor reads {} too {}", size_text(s, 0), s.value[0] >= 0 ? "high" : "low");
  }
};

}  // namespace bms::diagnosis
