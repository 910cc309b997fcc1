// A change of the ohmic resistance.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/mechanisms/needs_current.hpp"
#include "model/mechanisms/resistance_growth.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::ResistanceGrowth> : DefaultKnowledge<model::ResistanceGrowth> {
  static constexpr MechanismText text = {
      .id = model::ResistanceGrowth::id,
      .name = "a change of the ohmic resistance",
      .brief = "the ohmic resistance differs from the cell file's",
      .mark = "shows at every edge of the current, at once and in proportion to it",
      .meaning = "Ageing, another contact resistance, or a cell file of another cell.",
      .action = "Check the contacts first. If they are good, the cell has aged: identify R0 again."};
  static constexpr bool report_limit = true;

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the ohmic resistance is {} {} than in the cell file", size_text(s, 0, "%"),
                       s.value[0] >= 0 ? "higher" : "lower");
  }
  static std::optional<std::string> not_testable(const TestConditions& c) { return needs_current(c); }
};

}  // namespace bms::diagnosis
