// Sixteen cells in a driving truck, and a way to bring the quantity of every protection to a value: the cases of the
// fault matrix, for protection on the host (sampled_protection_test.cpp) and for a board's image in the emulator
// (tests/firmware/board_fault_matrix.hpp).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <optional>

#include "plant/link_poles.hpp"
#include "plant/random.hpp"
#include "protection/protection.hpp"
#include "tests/firmware/protection/oracle.hpp"

namespace bms::protection {

inline constexpr int step_ms = 100;
inline constexpr std::uint32_t step_us = 100'000;

constexpr bool has(FaultSet faults, std::size_t k) { return (faults >> k & 1) != 0; }

/// Values around a threshold. noise: three sigma. All in the unit of the quantity.
struct Levels {
  std::int32_t good, just_below, just_above, noise;
};
inline Levels levels(const ExpectedRow& e) {
  const int sign = e.beyond == '>' ? 1 : -1;
  const std::int32_t width = e.threshold == 0 && e.release == 0 ? 0 : std::abs(e.threshold - e.release);
  const std::int32_t noise = width / 4;
  return {e.release - sign * (width > 0 ? 1 : 0), e.threshold, e.threshold + sign, noise};
}
/// Three sigma of the measurement noise of row k.
constexpr std::int32_t measured_noise(std::size_t k) {
  if (k >= 11 && k <= 15) return 15;                    // temperatures
  if (k == 10) return 30'000;                           // current
  return k == 6 || k == 7 || k == 19 ? 60'000 : 3'000;  // pack, cells
}

/// Rows whose quantity comes from samples, without the overload integrals.

constexpr bool visible_in_samples(std::size_t k) { return (k < 26 && k != 8 && k != 9) || k == 35 || k == 42; }
/// Stuck readings are detected only after the others have moved.
constexpr bool waits_for_others(std::size_t k) { return k == 21 || k == 24; }

/// Measurements of a pack with given contactor states. The noise is limited to three sigma: sigma is 1 mV, 10 mA, 0.05
/// K, 20 mV over the pack.
class TruckPack {
 public:
  using Change = std::function<void(measurement::PackSample<16>&, PackEstimate<16>&, ExternalInputs&)>;
  /// True values of a cell.
  struct CellTrajectory {
    double current_ua, voltage_uv, temperature_cdegc;
  };

  explicit TruckPack(std::uint64_t seed) : random_(seed) { inputs.request = Request::drive; }

  void measure(const Outputs& out, const Change& change = {}) {
    ++step_;
    sample = measurement::PackSample<16>{};
    estimate = PackEstimate<16>{};
    const bool closed = out.main_plus && out.main_minus;
    sample.time_us = step_ * step_us;
    // 0 .. 1 .. 0 in 40 s: the load changes all cells and the temperature.
    const double slow = std::abs(static_cast<double>(step_ % 400) - 200) / 200;
    const CellTrajectory cell =
        trajectory.value_or(CellTrajectory{closed ? -2e6 - 1e6 * slow : 0, 3.30e6 - 60e3 * slow, 2'000 + 1'200 * slow});
    sample.current_ua = static_cast<std::int32_t>(cell.current_ua + 30e3 * chance());
    for (std::size_t k = 0; k < 16; ++k)
      sample.cell_uv[k] =
          static_cast<std::int32_t>(cell.voltage_uv + 1e3 * static_cast<double>(k % 5) + 3e3 * chance());
    for (std::size_t k = 0; k < 4; ++k)
      sample.temperature_cdegc[k] =
          static_cast<std::int16_t>(cell.temperature_cdegc + 10 * static_cast<double>(k) + 15 * chance());
    estimate.soc_ppb = 600'000'000;
    pack_offset_uv = 0;
    pack_follows = true;
    if (change) change(sample, estimate, inputs);
    if (pack_follows) {
      std::int64_t sum = 0;
      for (const std::int32_t uv : sample.cell_uv) sum += uv == measurement::no_reading ? 3'300'000 : uv;
      sample.pack_uv = static_cast<std::int32_t>(sum) + pack_offset_uv;
      if (noisy_pack) sample.pack_uv += static_cast<std::int32_t>(60e3 * chance());
    }
    if (!closed && sample.current_ua != measurement::no_reading)
      sample.current_ua = static_cast<std::int32_t>(30e3 * chance());
    const double stack_v = 52.8e6;
    if (closed)
      dc_link_uv_ = stack_v;
    else if (out.precharge && out.main_minus)
      dc_link_uv_ += (stack_v - dc_link_uv_) * 0.18;
    else
      dc_link_uv_ *= 0.97;
    const double pack_uv = closed && sample.pack_uv != measurement::no_reading ? sample.pack_uv : stack_v;
    set_link(plant::link_poles(out.main_plus || out.precharge, out.main_minus, 1e-6 * pack_uv,
                               closed ? 1e-6 * pack_uv : 1e-6 * dc_link_uv_));
  }
  void set_link(const plant::LinkPoles& poles) {
    inputs.link_plus_uv = static_cast<std::int32_t>(std::lround(1e6 * poles.plus_v));
    inputs.link_minus_uv = static_cast<std::int32_t>(std::lround(1e6 * poles.minus_v));
  }

  std::uint64_t steps() const { return step_; }
  double chance() { return std::clamp(random_.normal() / 3, -1.0, 1.0); }

  measurement::PackSample<16> sample;
  PackEstimate<16> estimate;
  ExternalInputs inputs;
  std::optional<CellTrajectory> trajectory;  ///< replaces the built-in trajectory of 40 s
  std::int32_t pack_offset_uv = 0;
  bool pack_follows = true, noisy_pack = true;

 private:
  plant::Random random_;
  std::uint64_t step_ = 0;
  double dc_link_uv_ = 0;
};

/// Expected faults of the rows visible in samples.
class TruckOracle {
 public:
  /// Returns one bit per active fault; 0 for other rows.
  FaultSet check(const measurement::PackSample<16>& sample, bool voltage_rejected) {
    values = quantities_.check(sample, voltage_rejected);
    FaultSet there = 0;
    for (std::size_t k = 0; k < fault_count; ++k) {
      if (visible_in_samples(k) && rows_[k].check(values[k], step_ms, false, *values[23] > 0))
        there |= FaultSet{1} << k;
    }
    return there;
  }

  std::array<Value, fault_count> values;

 private:
  QuantityOracle quantities_;
  std::vector<RowOracle> rows_{std::begin(expected_rows), std::end(expected_rows)};
};

/// Sets the readings of cells and pack so that the quantity of row k has the value.
inline void inject_voltage(std::size_t k, std::int32_t value, TruckPack& truck, measurement::PackSample<16>& s) {
  switch (k) {
    case 0:
    case 1:
    case 2:
      s.cell_uv[5] = value;
      break;
    case 3:
    case 4:
    case 5:
    case 25:
      s.cell_uv[11] = value;
      break;
    case 6:
    case 7:
      s.cell_uv.fill(value / 16);
      s.pack_uv = value;
      truck.pack_follows = false;
      break;
    case 16:
      for (auto& uv : s.cell_uv) uv = 3'300'000 + (s.time_us / step_us % 2 == 0 ? 1'000 : -1'000);
      s.cell_uv[7] = s.cell_uv[0] - value;
      s.cell_uv[8] = s.cell_uv[0] + value;
      break;
    case 17:
      s.cell_uv[2] = s.cell_uv[0] + 40'000;
      s.cell_uv[9] = s.cell_uv[2] - value;
      for (std::size_t c = 0; c < 16; ++c) {
        if (c != 2 && c != 9) s.cell_uv[c] = s.cell_uv[0] + static_cast<std::int32_t>(c);
      }
      break;
    case 19:
      truck.pack_offset_uv = -value;
      truck.noisy_pack = false;
      break;
    case 20:
      if (value > 0) s.cell_uv[4] = measurement::no_reading;
      break;
    case 21:
      if (value > 0) s.cell_uv[13] = 3'287'654;
      break;
    default:
      std::abort();
  }
}

/// Sets readings so that the quantity of row k has the value; for rows that count readings, 1 raises the fault and 0
/// does not. k: visible_in_samples().
inline void inject(std::size_t k, std::int32_t value, TruckPack& truck, measurement::PackSample<16>& s,
                   PackEstimate<16>& e) {
  switch (k) {
    case 10:
      s.current_ua = -value;
      break;
    case 11:
    case 12:
    case 13:
      s.temperature_cdegc[1] = static_cast<std::int16_t>(value);
      break;
    case 14:
    case 15:
      s.temperature_cdegc[3] = static_cast<std::int16_t>(value);
      break;
    case 18:
      e.voltage_rejected = value > 0;
      break;
    case 22:
      if (value > 0) s.current_ua = measurement::no_reading;
      break;
    case 23:
      if (value > 0) s.temperature_cdegc[2] = measurement::no_temperature;
      break;
    case 24:
      if (value > 0) s.temperature_cdegc[0] = 2'345;
      break;
    case 42:
      if (value > 0) s.temperature_cdegc[2] = measurement::shorted_thermistor;
      break;
    case 35:
      if (value > 0) s.temperature_cdegc.fill(measurement::no_temperature);
      break;
    default:
      inject_voltage(k, value, truck, s);
  }
}

}  // namespace bms::protection
