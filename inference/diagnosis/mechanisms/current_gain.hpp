// A gain error of the current sensor.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/mechanisms/needs_current.hpp"
#include "model/mechanisms/current_gain.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::CurrentGain> : DefaultKnowledge<model::CurrentGain> {
  static constexpr MechanismText text = {
      .id = model::CurrentGain::id,
      .name = "a gain error of the current sensor",
      .brief = "the current sensor's scale is off",
      .mark = "scales the voltage drop and the counted charge alike",
      .meaning = "The shunt value or the amplifier gain is not what the software assumes.",
      .action = "Check the shunt value and the scaling against a reference current."};
  static constexpr bool report_limit = true;

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the current sensor reads {} by {}", s.value[0] >= 0 ? "high" : "low", size_text(s, 0, "%"));
  }
  static std::optional<std::string> not_testable(const TestConditions& c) { return needs_current(c); }
  static std::vector<std::vector<double>> far_starts(const MechanismSetting&, const RecordingFacts&) {
    return {{-0.3}, {-0.2}, {-0.12}, {-0.06}, {0.06}, {0.12}, {0.18}, {0.25},
            {0.3},  {0.36}, {0.43},  {0.5},   {0.6},  {0.7},  {0.8},  {0.9}};
  }
  /// Acts together with the calibration's own gain error.
  template <class S>
  static void set_up(SimulationSetup<S>& setup, const model::MechanismValues<S>& value) {
    setup.gain_error += value[0];
  }
};

}  // namespace bms::diagnosis
