// Readings of the chip's inputs as a sample of the pack: cells in the order of the pack, corrected by the calibration.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "hal/bq76952/configuration.hpp"
#include "hal/calibration.hpp"
#include "measurement/pack_sample.hpp"

namespace bms::hal::bq76952 {

/// The corrected reading, within +-2,147 of the unit in millions; no_reading stays.
constexpr std::int32_t corrected_reading(std::int32_t reading, std::int32_t gain_ppm, std::int64_t offset) {
  constexpr std::int64_t most = 2'147'000'000;
  if (reading == measurement::no_reading) return reading;
  return static_cast<std::int32_t>(std::clamp(corrected(reading, gain_ppm, offset), -most, most));
}

/// Voltage gain and offset hold for each cell. The stack gets the same gain and the offsets of all cells, so that it
/// still agrees with their sum.
template <std::size_t Cells>
constexpr void read_pack(const measurement::PackSample<cell_inputs>& inputs, const Configuration& configuration,
                         const SensorCalibration& by, measurement::PackSample<Cells>& into) {
  into.time_us = inputs.time_us;
  into.temperature_cdegc = inputs.temperature_cdegc;
  into.current_ua = corrected_reading(inputs.current_ua, by.current_gain_ppm, by.current_offset_ua);
  into.pack_uv =
      corrected_reading(inputs.pack_uv, by.voltage_gain_ppm, static_cast<std::int64_t>(Cells) * by.voltage_offset_uv);
  for (std::size_t k = 0; k < Cells; ++k)
    into.cell_uv[k] =
        corrected_reading(inputs.cell_uv[configuration.input_of_cell[k]], by.voltage_gain_ppm, by.voltage_offset_uv);
}

/// Inputs of cells, one bit each.
constexpr std::uint16_t inputs_of(const Configuration& configuration, std::uint32_t cells) {
  std::uint32_t inputs = 0;
  for (std::size_t k = 0; k < configuration.cells; ++k) inputs |= (cells >> k & 1) << configuration.input_of_cell[k];
  return static_cast<std::uint16_t>(inputs);
}

}  // namespace bms::hal::bq76952
