// What a row of the table of protections consists of: a quantity, its threshold, delay, reaction and recovery.
#pragma once

#include <cstddef>
#include <cstdint>

#include "protection/faults.hpp"

namespace bms::protection {

/// Quantities that the table compares, in integers; pack_quantities.hpp computes them from samples.
enum class Quantity : std::uint8_t {
  highest_cell_uv,
  lowest_cell_uv,
  pack_uv,
  charge_overload_i2t_us,  ///< overload integral I2t of the charge current
  discharge_overload_i2t_us,
  current_magnitude_ua,  ///< the largest reading, if the front end reports a short circuit
  highest_cdegc,
  lowest_cdegc,
  opposite_shift_uv,        ///< two neighbouring cells shifted from the mean in opposite directions
  spread_uv,                ///< highest minus lowest cell
  estimator_contradiction,  ///< 0 or 1: the estimator rejects the voltage
  sum_error_uv,             ///< magnitude of sum of cells minus pack
  voltages_missing,         ///< number of cells, and the pack
  voltages_stuck,
  currents_missing,  ///< 0 or 1
  temperatures_missing,
  temperatures_stuck,
  precharge_off_curve,  ///< 0 or 1; this and the next two come from the contactors
  welded,
  not_closed,
  sample_age_us,      ///< since the last usable sample
  integrity_error,    ///< 0 or 1
  storage_failed,     ///< 0 or 1
  second_line_trips,  ///< 0 or 1, as all that follow but the difference of the sensors
  second_line_broken,
  current_difference_ua,  ///< magnitude, less the share of the current that the gains explain
  temperatures_unknown,   ///< no sensor has a reading
  flows_unrequested,      ///< a current flows while the contactors wait for its end
  exceeds_allowed,        ///< the current is above the allowed current
  charge_excess_us,       ///< charge above the allowed current, as time of 1C (excess_charge.hpp)
  discharge_excess_us,
  largest_excess_us,        ///< of both directions
  supply_dips,              ///< 0 or 1
  temperatures_shorted,     ///< number of thermistors
  second_currents_missing,  ///< 0 or 1, as the next three; the sensor is fitted and has no reading
  loop_open,
  crashed,
  insulation_missing,  ///< a monitor is fitted and has no reading
  insulation_ohm,      ///< between battery and frame
  front_end_cdegc,     ///< die of the measuring chip
  batteries_missing,   ///< 0 or 1: nothing arrives from a battery of the group
};
inline constexpr std::size_t quantity_count = with_group ? 41 : 40;

enum class Sense : std::uint8_t { above, below };

struct Rule {
  std::int32_t threshold, release;
  std::uint32_t delay_us, recover_us;
  Fault fault;
  Quantity quantity;
  Sense sense;
  Recovery recovery;
  Reaction reaction;
};

}  // namespace bms::protection
