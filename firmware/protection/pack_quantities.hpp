// Quantities that the table compares, computed from a sample. Readings are not repaired: an impossible reading counts
// as missing.
//
//   overload I2t      overload.hpp
//   opposite shift    a broken sense wire floats between its neighbours: one cell reads low, the next equally high.
//                     Counts if the two shifts differ by less than half of the smaller.
//   stuck             a cell repeats its reading exactly for five samples or more while the other cells moved by 20 mV:
//                     their mean without highest and lowest, so that one that moves alone does not count; with less
//                     than four cells the pack's own reading. A temperature, while most of the others moved by 5 K: the
//                     second lowest and the second highest of all; with two sensors the other one. So two warm sensors
//                     of four do not make the constant ones stuck.
//
// A quantity that cannot be computed is unknown (measurement::no_reading). Memory: 12 bytes per cell. Cost: README.md.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "measurement/pack_sample.hpp"
#include "protection/fault_monitor.hpp"
#include "protection/overload.hpp"
#include "protection/pack_design.hpp"

namespace bms::protection {

/// Limits of a pack as integers.
struct PackLimits {
  std::int32_t charge_ua_256th, discharge_ua_256th;  ///< 1.05 x continuous limit / 256
  std::int32_t common_range_ua;                      ///< that both current sensors can measure, at most 1,000 A
  std::int32_t gain_error_256ths;                    ///< of both current sensors together
  std::uint8_t temperatures;
  OverloadPlan charge_overload, discharge_overload;
};

constexpr PackLimits pack_limits(const PackDesign& d) {
  const auto part = [](double a) { return std::max(in_micro(overcurrent_from * a) / 256, std::int32_t{1}); };
  return {part(d.limits.charge_current_max_a),
          part(d.limits.discharge_current_max_a),
          in_micro(std::min({d.current_range_a, d.second_current_range_a, 1'000.0})),
          static_cast<std::int32_t>(256 * d.current_gain_error + 0.5),
          std::min<std::uint8_t>(d.temperatures, measurement::max_temperatures),
          overload_plan(d.pulses.charge, d.limits.charge_current_max_a, d.pulses.temperature_min_c),
          overload_plan(d.pulses.discharge, d.limits.discharge_current_max_a, d.pulses.temperature_min_c)};
}

/// Magnitude of the difference of two current readings, less the part that the error of their gains explains [uA]. May
/// be negative; unknown without both readings. Each reading counts as at most the range that both sensors have.
constexpr std::int32_t current_difference_ua(const PackLimits& limits, std::int32_t first_ua, std::int32_t second_ua) {
  if (first_ua == measurement::no_reading || second_ua == measurement::no_reading) return measurement::no_reading;
  const std::int32_t most = limits.common_range_ua, a = std::clamp(first_ua, -most, most),
                     b = std::clamp(second_ua, -most, most);
  return magnitude(a - b) - std::max(magnitude(a), magnitude(b)) / 256 * limits.gain_error_256ths;
}

/// Returns true for a possible cell voltage. A reversed cell reads a little below 0.
constexpr bool cell_possible(std::int32_t uv) { return uv >= -500'000 && uv <= 6'000'000; }

/// The two lowest and the two highest of the values that were added. Of a single value the second ones stay at their
/// initial value.
struct TwoEnds {
  std::int32_t lowest = std::numeric_limits<std::int32_t>::max(), second_lowest = lowest,
               highest = std::numeric_limits<std::int32_t>::min(), second_highest = highest;

  constexpr void add(std::int32_t value) {
    second_lowest = std::min(second_lowest, std::max(lowest, value));
    lowest = std::min(lowest, value);
    second_highest = std::max(second_highest, std::min(highest, value));
    highest = std::max(highest, value);
  }
};

template <std::size_t Cells>
class PackQuantities {
 public:
  static constexpr std::int32_t stuck_move_uv = 20'000, stuck_move_cdegc = 500;
  static constexpr std::uint8_t stuck_after = 5;

  constexpr explicit PackQuantities(const PackLimits& limits) : limits_(limits) {}

  /// Writes the quantities of the sample into q. step_us: time since the last sample.
  constexpr void update(const measurement::PackSample<Cells>& sample, std::uint32_t step_us, Quantities& q) {
    update_cells(sample, q);
    update_temperatures(sample.temperature_cdegc, q);
    update_current(sample.current_ua, step_us, q);
  }

  constexpr const OverloadIntegral& charge_overload() const { return charge_overload_; }
  constexpr const OverloadIntegral& discharge_overload() const { return discharge_overload_; }
  /// Sum of all cells of the last sample [uV], or measurement::no_reading.
  constexpr std::int32_t sum_uv() const { return sum_uv_; }

 private:
  struct Repeats {
    std::int32_t value = measurement::no_reading;
    std::int32_t others;  ///< mean of the others when `value` last changed
    std::uint8_t count;   ///< samples without a change
  };

  static constexpr bool stuck(Repeats& r, std::int32_t value, std::int32_t others, std::int32_t move) {
    if (value != r.value) {
      r = {value, others, 0};
      return false;
    }
    if (r.count < stuck_after) ++r.count;
    return r.count == stuck_after && magnitude(others - r.others) > move;
  }

  constexpr void update_cells(const measurement::PackSample<Cells>& sample, Quantities& q) {
    std::int32_t high = measurement::no_reading, low = measurement::no_reading, missing = 0, sum = 0;
    for (const std::int32_t uv : sample.cell_uv) {
      if (!cell_possible(uv)) {
        ++missing;
        continue;
      }
      sum += uv;
      high = std::max(high, uv);  // no_reading is less than any voltage
      low = low == measurement::no_reading ? uv : std::min(low, uv);
    }
    const auto known = static_cast<std::int32_t>(Cells) - missing;
    sum_uv_ = missing == 0 ? sum : measurement::no_reading;
    const bool pack_known = sample.pack_uv >= 0;  // no_reading is less
    at(q, Quantity::voltages_missing) = missing + (pack_known ? 0 : 1);
    at(q, Quantity::pack_uv) = pack_known ? sample.pack_uv : measurement::no_reading;
    at(q, Quantity::sum_error_uv) =
        pack_known && missing == 0 ? magnitude(sum - sample.pack_uv) : measurement::no_reading;
    at(q, Quantity::highest_cell_uv) = high;
    at(q, Quantity::lowest_cell_uv) = low;
    at(q, Quantity::spread_uv) = known > 0 ? high - low : measurement::no_reading;
    at(q, Quantity::opposite_shift_uv) =
        known > 0 ? opposite_shift(sample.cell_uv, sum / known) : measurement::no_reading;
    std::int32_t stuck_cells = measurement::no_reading;
    if (known >= 4)
      stuck_cells = cells_stuck(sample.cell_uv, (sum - high - low) / (known - 2));
    else if (known > 0 && pack_known)
      stuck_cells = cells_stuck(sample.cell_uv, sample.pack_uv / static_cast<std::int32_t>(Cells));
    at(q, Quantity::voltages_stuck) = stuck_cells;
  }

  static constexpr std::int32_t opposite_shift(const std::array<std::int32_t, Cells>& cell_uv, std::int32_t mean_uv) {
    std::int32_t most = 0;
    for (std::size_t k = 0; k + 1 < Cells; ++k) {
      if (!cell_possible(cell_uv[k]) || !cell_possible(cell_uv[k + 1])) continue;
      const std::int32_t a = cell_uv[k] - mean_uv, b = cell_uv[k + 1] - mean_uv;
      if ((a < 0) == (b < 0)) continue;
      const std::int32_t both = std::min(magnitude(a), magnitude(b));
      if (both > most && magnitude(a + b) <= both / 2) most = both;
    }
    return most;
  }

  constexpr std::int32_t cells_stuck(const std::array<std::int32_t, Cells>& cell_uv, std::int32_t others_uv) {
    std::int32_t count = 0;
    for (std::size_t k = 0; k < Cells; ++k) {
      if (cell_possible(cell_uv[k]) && stuck(cell_[k], cell_uv[k], others_uv, stuck_move_uv)) ++count;
    }
    return count;
  }

  constexpr void update_current(std::int32_t current_ua, std::uint32_t step_us, Quantities& q) {
    const bool known = current_ua != measurement::no_reading;
    at(q, Quantity::currents_missing) = known ? 0 : 1;
    at(q, Quantity::current_magnitude_ua) = known ? magnitude(current_ua) : measurement::no_reading;
    if (known) {
      const std::int32_t coldest_cdegc = at(q, Quantity::lowest_cdegc);  // unknown: less than any temperature
      integrate(charge_overload_, limits_.charge_overload, current_ua / limits_.charge_ua_256th, coldest_cdegc,
                step_us);
      integrate(discharge_overload_, limits_.discharge_overload, -current_ua / limits_.discharge_ua_256th,
                coldest_cdegc, step_us);
    }
    at(q, Quantity::charge_overload_i2t_us) = known ? charge_overload_.value_us() : measurement::no_reading;
    at(q, Quantity::discharge_overload_i2t_us) = known ? discharge_overload_.value_us() : measurement::no_reading;
  }

  /// times_256: current / limit in 1/256, negative in the other direction. A reading at the end of the sensor's range
  /// counts as this current.
  static constexpr void integrate(OverloadIntegral& overload, const OverloadPlan& plan, std::int32_t times_256,
                                  std::int32_t coldest_cdegc, std::uint32_t step_us) {
    overload.update(plan, std::clamp(times_256, std::int32_t{0}, most_times_256), coldest_cdegc >= plan.from_cdegc,
                    step_us);
  }

  constexpr void update_temperatures(const std::array<std::int16_t, measurement::max_temperatures>& all,
                                     Quantities& q) {
    TwoEnds ends;
    std::int32_t sum = 0, known = 0, shorted = 0;
    for (std::size_t k = 0; k < limits_.temperatures; ++k) {
      if (all[k] == measurement::shorted_thermistor) ++shorted;
      if (!measurement::temperature_possible(all[k])) continue;
      ++known;
      sum += all[k];
      ends.add(all[k]);
    }
    at(q, Quantity::temperatures_missing) = limits_.temperatures - known;
    at(q, Quantity::temperatures_shorted) = shorted;
    at(q, Quantity::temperatures_unknown) = known == 0 && limits_.temperatures > 0;
    at(q, Quantity::highest_cdegc) = known > 0 ? ends.highest : measurement::no_reading;
    at(q, Quantity::lowest_cdegc) = known > 0 ? ends.lowest : measurement::no_reading;
    std::int32_t count = 0;
    for (std::size_t k = 0; k < limits_.temperatures && known > 1; ++k) {
      if (!measurement::temperature_possible(all[k])) continue;
      const std::int32_t other = sum - all[k];
      const bool low = stuck(temperature_[k][0], all[k], known > 2 ? ends.second_lowest : other, stuck_move_cdegc);
      const bool high = stuck(temperature_[k][1], all[k], known > 2 ? ends.second_highest : other, stuck_move_cdegc);
      if (low && high) ++count;
    }
    at(q, Quantity::temperatures_stuck) = known > 1 ? count : measurement::no_reading;
  }

  PackLimits limits_;
  std::array<Repeats, Cells> cell_{};
  std::array<std::array<Repeats, 2>, measurement::max_temperatures> temperature_{};  ///< against the two middle ones
  OverloadIntegral charge_overload_, discharge_overload_;
  std::int32_t sum_uv_ = measurement::no_reading;
};

}  // namespace bms::protection
