// A change of the polarisation.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/mechanisms/needs_current.hpp"
#include "model/mechanisms/polarisation_growth.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::PolarisationGrowth> : DefaultKnowledge<model::PolarisationGrowth> {
  static constexpr MechanismText text = {.id = model::PolarisationGrowth::id,
                                         .name = "a change of the polarisation",
                                         .brief = "the polarisation is larger or slower than in the cell file",
                                         .mark = "builds up with the cell file's own time constant after every edge",
                                         .meaning = "Ageing, or a cell file of another cell or temperature.",
                                         .action = "Identify R1 and C1 again from pulses with rests."};
  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the polarisation is {} {} and its capacitance {} {} than in the cell file",
                       size_text(s, 0, "%"), s.value[0] >= 0 ? "larger" : "smaller", size_text(s, 1, "%"),
                       s.value[1] >= 0 ? "larger" : "smaller");
  }
  static std::optional<std::string> not_testable(const TestConditions& c) { return needs_current(c); }
};

}  // namespace bms::diagnosis
