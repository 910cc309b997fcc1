// A resistance that follows the temperature. At one temperature the share of R0 that follows it and its activation
// energy look alike, so the energy is taken from what is known of most cells.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "model/mechanisms/temperature_resistance.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::TemperatureResistance> : DefaultKnowledge<model::TemperatureResistance> {
  static constexpr MechanismText text = {
      .id = model::TemperatureResistance::id,
      .name = "a resistance that follows the temperature",
      .brief = "the resistance follows the temperature",
      .mark = "changes the voltage drop with the measured temperature, at any load",
      .meaning = "A cold cell has a higher resistance, and the cell file knows one temperature only.",
      .action = "Use the extended cell file, or identify at the temperatures that occur."};
  static constexpr bool follows_temperature = true;
  static constexpr Fact facts = Fact::temperature;
  static constexpr std::size_t r0_energy = 0, r1_energy = 1, r0_share = 3;  ///< places of the parameters
  static constexpr double infinite = std::numeric_limits<double>::infinity();
  static constexpr double smallest_difference_k = 3;  ///< [K] of span, or from the reference temperature
  static constexpr double certain_k = 8;     ///< [K] from the reference temperature where resistances must have changed
  static constexpr double prior_from_k = 5;  ///< [K] from the reference temperature where it becomes likely,
  static constexpr double prior_per_k = 1.5;   ///< gain per kelvin beyond,
  static constexpr double prior_at_most = 15;  ///< gain

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the resistance follows the temperature, R0 with {} and R1 with {}",
                       quantity(s.value[r0_energy], s.deviation[r0_energy], "J/mol"),
                       quantity(s.value[r1_energy], s.deviation[r1_energy], "J/mol"));
  }
  /// A small energy of all of R0 is the usual energy of a share of it.
  static MechanismSetting start(const SignatureFit& s) {
    const auto& parameter = model::TemperatureResistance::parameters;
    MechanismSetting start = s.probe;
    const double of_all = std::clamp(s.found[0], 0.0, parameter[r0_energy].high), usual = parameter[r0_energy].typical;
    start.value[r0_energy] = std::max(of_all, usual);
    start.value[r0_share] = std::clamp(of_all / usual, parameter[r0_share].low, 1.0);
    start.value[r1_energy] = std::clamp(s.found[1], 0.0, thresholds.screening.start_share * parameter[r1_energy].high);
    return start;
  }
  static std::optional<std::string> not_testable(const TestConditions& c) {
    if (!c.facts.temperature) return "no temperature was recorded";
    if (std::max(c.facts.temperature_span_k, c.facts.away_k) < smallest_difference_k)
      return fmt::format("the temperature is within {:.1f} K of the cell file's {:g} degrees C", c.facts.away_k,
                         c.facts.reference_c);
    return std::nullopt;
  }
  /// That of R0 or of R1, whichever is known better.
  static double temperature_sigma(const MechanismSetting& s) {
    const auto relative = [&](std::size_t p) { return s.value[p] > 0 ? s.deviation[p] / s.value[p] : infinite; };
    return std::min(std::hypot(relative(r0_energy), relative(r0_share)), relative(r1_energy));
  }
  /// It is added before the others: a contact that changed early would take its place.
  static bool expected(const model::CellParameters<>&, const RecordingFacts& seen) { return seen.away_k > certain_k; }
  static double prior_gain(const RecordingFacts& seen) {
    return std::clamp((seen.away_k - prior_from_k) * prior_per_k, 0.0, prior_at_most);
  }
};

}  // namespace bms::diagnosis
