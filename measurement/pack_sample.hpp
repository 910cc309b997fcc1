// All measurements of a battery of cells in series at one time: the only input of a pack, as Sample is of a cell.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "measurement/sample.hpp"

namespace bms::measurement {

inline constexpr std::size_t max_temperatures = 4;

/// Integers in micro-units; a missing value is no_reading or no_temperature. Any field may be wrong.
template <std::size_t Cells>
struct PackSample {
  static constexpr std::size_t cells = Cells;

  std::uint64_t time_us = 0;             ///< since start-up, or since time 0 of the recording
  std::int32_t current_ua = no_reading;  ///< mean since the previous sample, > 0 charges; one current through all cells
  std::int32_t pack_uv = no_reading;     ///< over all cells, from a measurement of its own
  std::array<std::int32_t, Cells> cell_uv = filled<Cells>(no_reading);
  std::array<std::int16_t, max_temperatures> temperature_cdegc =
      filled<max_temperatures>(no_temperature);  ///< hundredths of a degree Celsius

 private:
  template <std::size_t N, class T>
  static constexpr std::array<T, N> filled(T value) {
    std::array<T, N> all{};
    all.fill(value);
    return all;
  }
};

}  // namespace bms::measurement
