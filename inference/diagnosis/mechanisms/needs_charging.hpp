// What mechanisms that differ between charge and discharge need: a charge.
#pragma once

#include <optional>
#include <string>

#include "diagnosis/mechanism.hpp"

namespace bms::diagnosis {

/// Charge into the cell over its capacity below which charging is not seen.
inline constexpr double smallest_charge_soc = 0.01;

inline std::optional<std::string> needs_charging(const TestConditions& c) {
  if (c.facts.charged_soc < smallest_charge_soc) return "the cell is not charged";
  return std::nullopt;
}

}  // namespace bms::diagnosis
