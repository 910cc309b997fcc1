// An error of the temperature sensor. It shows only through something that follows the temperature.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "model/mechanisms/temperature_sensor.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::TemperatureSensor> : DefaultKnowledge<model::TemperatureSensor> {
  static constexpr MechanismText text = {
      .id = model::TemperatureSensor::id,
      .name = "an error of the temperature sensor",
      .brief = "the temperature sensor reads wrong or late",
      .mark = "follows the rate of change of the temperature, or shifts all that depends on it",
      .meaning = "The measured temperature is not that of the cell, or comes late.",
      .action = "Check the sensor and its mounting."};
  static constexpr Fact facts = Fact::temperature;
  static constexpr std::size_t offset = 0, lag = 1;  ///< places of the parameters
  static constexpr double significant_sigma = 2;     ///< standard deviations from which a lag is named,
  static constexpr double largest_law_sigma = 0.3;  ///< of the file's temperature dependence, over its value: beyond it
                                                    ///< an error of the law at another temperature looks the same
  static constexpr double noticeable_lag_s = 30;    ///< [s] if it is longer than this

  static std::string claim(const MechanismSetting& s) {
    const char* high = s.value[offset] >= 0 ? "high" : "low";
    const bool lags = std::abs(s.value[lag]) > significant_sigma * s.deviation[lag] && s.value[lag] > noticeable_lag_s;
    if (!lags) return fmt::format("the temperature sensor reads {} too {}", size_text(s, offset), high);
    return fmt::format("the temperature sensor lags by {} and reads {} too {}", size_text(s, lag), size_text(s, offset),
                       high);
  }
  static std::optional<std::string> not_testable(const TestConditions& c) {
    if (!c.facts.temperature) return "no temperature was recorded";
    if (!c.follows_temperature) return "nothing in the cell file follows the temperature";
    if (c.temperature_sigma > largest_law_sigma)
      return "the cell file does not know well how its resistances follow the temperature";
    return std::nullopt;
  }
  template <class S>
  static void set_up(SimulationSetup<S>& setup, const model::MechanismValues<S>& value) {
    setup.template choose<model::TemperatureSensor>(value);
    setup.temperature_lag_s = value[lag];
  }
};

}  // namespace bms::diagnosis
