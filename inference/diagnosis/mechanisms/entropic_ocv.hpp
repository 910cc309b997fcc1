// An OCV that follows the temperature.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "model/mechanisms/entropic_ocv.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::EntropicOcv> : DefaultKnowledge<model::EntropicOcv> {
  static constexpr MechanismText text = {
      .id = model::EntropicOcv::id,
      .name = "an OCV that follows the temperature",
      .brief = "the open-circuit voltage follows the temperature",
      .mark = "follows the temperature with no current flowing, by an amount that depends on the state of charge",
      .meaning = "The entropy of the reaction: a few tenths of a millivolt per kelvin.",
      .action = "Use the extended cell file where temperatures change by more than 10 K."};
  static constexpr bool follows_temperature = true;
  static constexpr Fact facts = Fact::temperature;
  static constexpr std::size_t nodes = 4;       ///< parameters 0 to 3 are slopes at four states of charge
  static constexpr double smallest_span_k = 4;  ///< [K] of span, or
  static constexpr double smallest_away_k = 8;  ///< [K] from the reference temperature

  static std::string claim(const MechanismSetting& s) {
    std::size_t k = 0;
    for (std::size_t j = 1; j < nodes; ++j) {
      if (std::abs(s.value[j]) > std::abs(s.value[k])) k = j;
    }
    return fmt::format("the open-circuit voltage follows the temperature, {} at {} % state of charge",
                       quantity(s.value[k], s.deviation[k], "V/K"), number_in(model::EntropicOcv::parameters[k].name));
  }
  static std::optional<std::string> not_testable(const TestConditions& c) {
    if (!c.facts.temperature) return "no temperature was recorded";
    if (c.facts.temperature_span_k < smallest_span_k && c.facts.away_k < smallest_away_k)
      return fmt::format("the temperature spans only {:.1f} K", c.facts.temperature_span_k);
    return std::nullopt;
  }
};

}  // namespace bms::diagnosis
