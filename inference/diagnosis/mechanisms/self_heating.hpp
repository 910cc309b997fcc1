// Self-heating.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "model/mechanisms/self_heating.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::SelfHeating> : DefaultKnowledge<model::SelfHeating> {
  static constexpr MechanismText text = {
      .id = model::SelfHeating::id,
      .name = "self-heating",
      .brief = "the cell is warmer inside than its sensor says",
      .mark = "lowers the resistance minutes after the load rises, and lets it return minutes after the load falls",
      .meaning = "Losses warm the core, and its resistance is that of a warmer cell.",
      .action = "Use the extended cell file, or move the temperature sensor nearer to the core."};
  static constexpr Fact facts = Fact::temperature;
  static constexpr double smallest_current_c = 0.5;  ///< [C] that heats a cell

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the cell is warmer inside than its sensor says, by {} of loss", size_text(s, 0));
  }
  static std::vector<double> probing_shapes(double) { return {200, 900, 3'000}; }
  static std::optional<std::string> not_testable(const TestConditions& c) {
    if (c.current_below(smallest_current_c)) return "the current is too small to heat the cell";
    return std::nullopt;
  }
};

}  // namespace bms::diagnosis
