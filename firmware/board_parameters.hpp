// The parameters of a board that has them (BMS_PARAMETERS): the block in flash and the plan that follows from it.
// Another board has the empty base class, and its image nothing of all this.
#pragma once

#include <algorithm>
#include <cstdint>

#include "hal/calibration.hpp"
#include "parameters/active_plan.hpp"
#include "parameters/parameter_block.hpp"

namespace bms::firmware {

template <bool fitted>
struct ParametersOfBoard {};

template <>
struct ParametersOfBoard<true> {
  static parameters::ParameterBlock& parameters();
  /// Makes the plan follow the active parameters. Call after the start of the block, and with open contactors.
  static void apply_parameters();
  static const protection::ProtectionPlan& active_plan();
  static bool plan_intact();
};

/// The plan with the parameters of the board, or that of the build for a board without parameters.
template <class Board>
const protection::ProtectionPlan& active_plan_or(const protection::ProtectionPlan& of_build) {
  if constexpr (requires { Board::active_plan(); })
    return Board::active_plan();
  else
    return of_build;
}

/// The gains for which the current rows and the front end's own are proved: a reading is at most 5 % low.
inline constexpr std::int32_t most_gain_ppm = 50'000;

/// Calibration with the shunt of this battery: its resistance, relative to the one that the board assumes, is a gain.
/// May exceed most_gain_ppm together with the calibrated gain.
inline hal::SensorCalibration with_shunt(hal::SensorCalibration calibration,
                                         const parameters::ParameterBlock& parameters) {
  using parameters::Parameter;
  const std::int64_t of_build = at(parameters.ranges(), Parameter::shunt).initial,
                     nohm = at(parameters.active(), Parameter::shunt);
  calibration.current_gain_ppm =
      static_cast<std::int32_t>((1'000'000 + calibration.current_gain_ppm) * of_build / nohm - 1'000'000);
  return calibration;
}
constexpr bool gain_proved(const hal::SensorCalibration& calibration) {
  return calibration.current_gain_ppm >= -most_gain_ppm && calibration.current_gain_ppm <= most_gain_ppm;
}
/// Readings of a shunt that contradicts the calibrated gain: they are wrong by what is beyond the limit.
constexpr hal::SensorCalibration limited(hal::SensorCalibration calibration) {
  calibration.current_gain_ppm = std::clamp(calibration.current_gain_ppm, -most_gain_ppm, most_gain_ppm);
  return calibration;
}

}  // namespace bms::firmware
