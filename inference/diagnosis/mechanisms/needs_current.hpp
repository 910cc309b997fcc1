// What all mechanisms that act in proportion to the current need: a current.
#pragma once

#include <optional>
#include <string>

#include "diagnosis/mechanism.hpp"

namespace bms::diagnosis {

/// [C] largest current below which nothing that is in proportion to it can be seen.
inline constexpr double hardly_any_current_c = 0.05;

inline std::optional<std::string> needs_current(const TestConditions& c) {
  if (c.current_below(hardly_any_current_c)) return "the current is too small";
  return std::nullopt;
}

}  // namespace bms::diagnosis
