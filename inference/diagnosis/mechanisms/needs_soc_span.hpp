// What mechanisms that act along the state of charge need: a recording that moves it.
#pragma once

#include <optional>
#include <string>

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"

namespace bms::diagnosis {

/// Span of soc below which the OCV's steps are not seen.
inline constexpr double smallest_soc_span = 0.1;

inline std::optional<std::string> needs_soc_span(const TestConditions& c) {
  if (c.facts.soc_span < smallest_soc_span)
    return fmt::format("the state of charge spans only {:.0f} %", 100 * c.facts.soc_span);
  return std::nullopt;
}

}  // namespace bms::diagnosis
