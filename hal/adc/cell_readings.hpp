// Conversion of converter counts of a single-cell board to voltage, current and temperature of a sample.
//
//   supply      = 3.3 V * reference_at_3v3 / reference       internal reference, same converter (RM0090, 13.10)
//   pin         = supply * counts / 4095
//   voltage     = pin * divider                              times (1 + gain), plus offset
//   current     = (pin - supply / 2) / (amplifier * shunt)   times (1 + gain), plus offset; > 0 charges
//   temperature   thermistor 103AT of 10 kohm, pulled up to the supply by 10 kohm; linear between the manufacturer's
//                 values each 10 K, with an error of at most 0.45 K from -25 to 85 degrees C
//
// Counts are sums over many conversions; their noise averages out the converter's steps (0.8 mV at the pin, ST AN2834).
// There is no reading if the converter does not answer or the supply is outside 2.4 to 3.6 V, and no temperature if the
// thermistor is open or shorted. A saturated amplifier gives its full range, which is above the short-circuit
// threshold.
//
// 64-bit integers only. Cost: 5 divisions, about 600 instructions per sample (Cortex-M4F).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/calibration.hpp"
#include "measurement/sample.hpp"

namespace bms::hal::adc {

/// Divider, amplifier and shunt between the cell and the pins.
struct AnalogFrontEnd {
  std::int32_t divider_ppm = 2'000'000;  ///< cell voltage / pin voltage: two equal resistors
  std::int32_t amplifier = 20;           ///< gain for the shunt voltage, around half the supply (INA240A1)
  std::int32_t shunt_uohm = 2'000;       ///< range +-41 A
};

/// Sums of converter counts and the number of conversions in them.
struct AdcCounts {
  std::uint32_t n = 0, voltage = 0, current = 0, temperature = 0;
  std::uint32_t n_reference = 0, reference = 0;
};

inline constexpr std::int64_t full_scale = 4'095;

namespace detail {

struct Point {
  std::int32_t cdegc, ohm;
};
/// Data sheet of Semitec, AT thermistors, 103AT.
inline constexpr std::array<Point, 13> thermistor{{{-3'000, 111'300},
                                                   {-2'000, 67'770},
                                                   {-1'000, 42'470},
                                                   {0, 27'280},
                                                   {1'000, 17'960},
                                                   {2'000, 12'090},
                                                   {3'000, 8'313},
                                                   {4'000, 5'827},
                                                   {5'000, 4'160},
                                                   {6'000, 3'020},
                                                   {7'000, 2'228},
                                                   {8'000, 1'668},
                                                   {9'000, 1'266}}};
inline constexpr std::int32_t pull_up_ohm = 10'000;

/// Pin voltage / supply of a thermistor with `ohm`, in 1e-6. Falls with temperature.
constexpr std::int32_t ratio_ppm(std::int32_t ohm) {
  return static_cast<std::int32_t>(1'000'000LL * ohm / (ohm + pull_up_ohm));
}

constexpr std::int64_t rounded_quotient(std::int64_t a, std::int64_t by) {
  return (a >= 0 ? a + by / 2 : a - by / 2) / by;
}

}  // namespace detail

/// ratio_ppm: pin voltage / supply, 1e-6. Extrapolates the first and the last line of the table to -40 and 100 degrees
/// C; beyond, a thermistor is open or shorted: no_temperature.
constexpr std::int16_t temperature_of(std::int32_t ratio_ppm) {
  using namespace detail;
  if (ratio_ppm > 960'000 || ratio_ppm < 80'000) return measurement::no_temperature;  // below -40, above 100 degrees C
  std::size_t k = 1;
  while (k + 1 < thermistor.size() && ratio_ppm < detail::ratio_ppm(thermistor[k].ohm)) ++k;
  const Point warm = thermistor[k], cold = thermistor[k - 1];
  const std::int32_t from = detail::ratio_ppm(cold.ohm), to = detail::ratio_ppm(warm.ohm);
  return static_cast<std::int16_t>(
      cold.cdegc + rounded_quotient(std::int64_t{ratio_ppm - from} * (warm.cdegc - cold.cdegc), to - from));
}

/// Writes all fields of `into` except the time. reference_at_3v3: adc_reference_at_3v3() of hal/adc.hpp.
constexpr void read(const AdcCounts& c, std::uint32_t reference_at_3v3, const AnalogFrontEnd& front_end,
                    const SensorCalibration& calibration, measurement::Sample& into) {
  using detail::rounded_quotient;
  into.voltage_uv = into.current_ua = measurement::no_reading;
  into.temperature_cdegc = measurement::no_temperature;
  if (c.n == 0 || c.n_reference == 0 || c.reference == 0) return;
  const std::int64_t supply_uv = 3'300'000LL * reference_at_3v3 * c.n_reference / c.reference;
  if (supply_uv < 2'400'000 || supply_uv > 3'600'000) return;
  const std::int64_t most = full_scale * c.n;
  const auto pin_nv = [&](std::uint32_t sum) { return rounded_quotient(1'000 * supply_uv * sum, most); };
  const std::int64_t cell_uv = rounded_quotient(pin_nv(c.voltage) * front_end.divider_ppm, 1'000'000'000);
  into.voltage_uv =
      static_cast<std::int32_t>(corrected(cell_uv, calibration.voltage_gain_ppm, calibration.voltage_offset_uv));
  const std::int64_t shunt_nv = pin_nv(c.current) - 500 * supply_uv;
  const std::int64_t current_ua =
      rounded_quotient(1'000 * shunt_nv, std::int64_t{front_end.amplifier} * front_end.shunt_uohm);
  into.current_ua =
      static_cast<std::int32_t>(corrected(current_ua, calibration.current_gain_ppm, calibration.current_offset_ua));
  into.temperature_cdegc = temperature_of(static_cast<std::int32_t>(1'000'000LL * c.temperature / most));
}

}  // namespace bms::hal::adc
