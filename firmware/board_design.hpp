// Design of this board's pack: limits and capacity of the cell, and what board and truck have.
#pragma once

#include "board_config.hpp"  // generated from boards/<board>/board.cmake and the build options
#include "protection/pack_design.hpp"

namespace bms::firmware {

constexpr protection::PackDesign board_design(const model::Limits& limits, double capacity_ah,
                                              const model::PulseRatings& pulses = {}) {
  return {.limits = limits,
          .capacity_ah = capacity_ah,
          .cells = hal::pack_cells,
          .temperatures = hal::pack_cells > 1 ? 4 : 1,
          .sample_period_s = hal::sample_period_s,
          .closing_current_max_a = hal::closing_a,
          .closing_loop_ohm = hal::closing_ohm,
          .dc_link = hal::has_dc_link,
          .precharge_time_constant_s = hal::precharge_s,
          .bleed_ohm = hal::bleed_ohm,
          .current_range_a = hal::current_range_a,
          .pulses = pulses};
}

/// Returns true for values with which the checks of the precharge work: a sample comes within half a time constant, and
/// the closing difference is less than a pack of eight cells has.
constexpr bool possible_truck(const protection::PackDesign& d) {
  const double closing_v = d.closing_current_max_a * d.closing_loop_ohm;
  return !d.dc_link || (d.precharge_time_constant_s >= 2 * d.sample_period_s && d.precharge_time_constant_s <= 4 &&
                        closing_v > 0 && closing_v <= 12);
}

}  // namespace bms::firmware
