// A resistance that differs between charge and discharge.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/mechanisms/needs_charging.hpp"
#include "model/mechanisms/direction_asymmetry.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::DirectionAsymmetry> : DefaultKnowledge<model::DirectionAsymmetry> {
  static constexpr MechanismText text = {
      .id = model::DirectionAsymmetry::id,
      .name = "a resistance that differs between charge and discharge",
      .brief = "charging meets another resistance than discharging",
      .mark = "is in proportion to the current, with another factor when charging",
      .meaning = "The electrodes take lithium in and give it back at different cost.",
      .action = "Use the extended cell file, which has a factor for charging."};
  static constexpr Fact facts = Fact::reversals;

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("charging meets {} {} resistance than discharging", size_text(s, 0, "%"),
                       s.value[0] >= 0 ? "more" : "less");
  }
  static std::optional<std::string> not_testable(const TestConditions& c) { return needs_charging(c); }
};

}  // namespace bms::diagnosis
