// Branches of the open-circuit voltage that move apart in the cold. A drive shows their sum with a resistance; slow
// runs at several temperatures determine them, and `bms identify --extend` writes them. The diagnosis does not search.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "model/mechanisms/branch_temperature.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::BranchTemperature> : DefaultKnowledge<model::BranchTemperature> {
  static constexpr MechanismText text = {
      .id = model::BranchTemperature::id,
      .name = "a hysteresis that grows in the cold",
      .brief = "the hysteresis grows in the cold",
      .mark = "moves charge and discharge apart in the cold, and stays at rest",
      .meaning = "The branches of slow charge and slow discharge are further apart when the cell is cold.",
      .action = "Measure slow charge and slow discharge at the temperatures that occur, and identify with --extend."};
  static constexpr bool follows_temperature = true;
  static constexpr Fact facts = Fact::temperature;

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the half gap of the hysteresis grows by {} of itself",
                       quantity(s.value[2], s.deviation[2], "1"));
  }
  static std::optional<std::string> not_testable(const TestConditions&) {
    return "slow runs at several temperatures determine it, not a drive";
  }
};

}  // namespace bms::diagnosis
