// Selects the cells to bleed so that all are full together: by state of charge, not by voltage. On the plateau of LFP
// the voltage says little, and under current the resistance changes it.
//
//   measured   in a charge or at rest, wherever every cell is known to 1 %:
//              excess = (soc of the cell) - (lowest soc) - 2 (sigma of the one + sigma of the other)
//              sigma includes 3 % of what the mean cell lacks to 95 %, because the capacities differ: a difference far
//              below the top may not be one at the top. Two sigma of both then cover a cell that has aged by 10 %.
//              Cells whose excess is above the dead band of 0.5 % are bled. Measured again where that part of sigma has
//              halved, so at the top without it, and in the next charge, when soc was 10 % lower in between. A coarser
//              measurement does not replace a finer one: it can only add
//   bled       exactly that charge, counted by V / R, over the next hours, while charging or at rest, not while driving
//
// So a truck that is charged in its breaks, from 40 to 80 %, is balanced, too, though more coarsely, and a cell with a
// smaller capacity is not bled for it: it is level at the top and low at the bottom. The estimates take what has
// been bled from take_bled_ppm(), because a current of one cell alone is not in their model. The uncertain part of a
// difference remains. The sigmas are added linearly, because the lowest of sixteen cells is the one with the largest
// error; a root of squares would bleed after noise. If neighbours on one monitoring chip may not bleed together, they
// take turns of eight seconds. The remaining charge is not stored; the next full charge measures it again.
//
// While a cell is bled, its reading is lower by the voltage drop on the sense wires: measure with the resistors off, or
// know the drop. Memory: 16 bytes per cell. Integers only.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "measurement/sample.hpp"
#include "protection/pack_design.hpp"

namespace bms::protection {

struct BalancingPlan {
  std::int32_t bleed_ohm, rest_ua, lowest_uv, max_cdegc;
  std::int64_t uams_per_ppb;  ///< charge per 1e-9 of the capacity [uA ms]
  bool neighbours_may_bleed;
};

constexpr BalancingPlan balancing_plan(const PackDesign& d) {
  const double span_v = d.limits.voltage_max_v - d.limits.voltage_min_v;
  return {std::max(static_cast<std::int32_t>(d.bleed_ohm + 0.5), std::int32_t{1}),
          in_micro(d.rest_current_c_rate * d.capacity_ah),
          in_micro(d.limits.voltage_min_v + 0.6 * span_v),
          in_centi(d.bleed_temperature_max_c),
          static_cast<std::int64_t>(d.capacity_ah * 3'600 + 0.5),
          d.neighbours_may_bleed};
}

template <std::size_t Cells>
struct BalancingInput {
  const std::array<std::int32_t, Cells>& cell_uv;
  const std::array<std::int32_t, Cells>& soc_ppb;  ///< of each cell minus the mean; no_reading: unknown
  const std::array<std::int32_t, Cells>& sigma_ppb;
  std::int32_t mean_soc_ppb, current_ua, highest_cdegc;  ///< no_reading: unknown
  bool allowed;                                          ///< no fault forbids it
};

template <std::size_t Cells>
class Balancing {
 public:
  static_assert(Cells <= 32, "one bit per cell");
  static constexpr std::int32_t top_ppb = 950'000'000, rearm_ppb = 100'000'000, dead_band_ppb = 5'000'000,
                                max_sigma_ppb = 10'000'000, capacity_sigma_per_1000 = 30;
  static constexpr std::uint32_t turn_us = 8'000'000;

  constexpr explicit Balancing(const BalancingPlan& plan) : plan_(&plan) {}

  /// Returns the cells to bleed until the next call, one bit each. step_us: time since the last call.
  constexpr std::uint32_t update(const BalancingInput<Cells>& in, std::uint32_t step_us) {
    count_bled(in.cell_uv, step_us);
    turn_us_ = (turn_us_ + step_us) % (2 * turn_us);
    mask_ = 0;
    if (in.current_ua == measurement::no_reading || in.mean_soc_ppb == measurement::no_reading) return 0;
    const bool discharging = in.current_ua < -plan_->rest_ua;
    if (in.mean_soc_ppb < measured_at_ppb_ - rearm_ppb) measured_ = false;
    const std::int32_t unsure_ppb =
        std::max<std::int32_t>((top_ppb - in.mean_soc_ppb) / 1'000, 0) * capacity_sigma_per_1000;
    if ((!measured_ || 2 * unsure_ppb < unsure_ppb_) && !discharging) measure(in, unsure_ppb);
    if (!in.allowed || discharging || in.highest_cdegc == measurement::no_reading ||
        in.highest_cdegc > plan_->max_cdegc)
      return 0;
    constexpr std::uint32_t even = 0x5555'5555;
    std::uint32_t turn = 0xFFFF'FFFF;
    if (!plan_->neighbours_may_bleed) turn = turn_us_ < turn_us ? even : ~even;
    for (std::size_t k = 0; k < Cells; ++k) {
      const std::uint32_t mask = std::uint32_t{1} << k;
      if (remaining_uams_[k] > 0 && (turn & mask) != 0 && in.cell_uv[k] >= plan_->lowest_uv) mask_ |= mask;
    }
    return mask_;
  }

  /// Charge that was bled from a cell since the last call, in whole 1e-6 of the capacity. The rest is kept.
  constexpr std::int32_t take_bled_ppm(std::size_t cell) {
    const std::int64_t uams_per_ppm = 1'000 * plan_->uams_per_ppb;
    if (bled_uams_[cell] < uams_per_ppm) [[likely]]
      return 0;
    const std::int64_t ppm = bled_uams_[cell] / uams_per_ppm;
    bled_uams_[cell] -= ppm * uams_per_ppm;
    return static_cast<std::int32_t>(ppm);
  }
  /// Call when the resistors are switched off for another reason.
  constexpr void stop() { mask_ = 0; }
  /// Time until the last cell is done without interruption [s]. cell_uv: voltage of a cell.
  constexpr std::uint32_t left_s(std::int32_t cell_uv) const {
    const std::int64_t most_uams = *std::max_element(remaining_uams_.begin(), remaining_uams_.end());
    if (most_uams <= 0 || cell_uv <= 0) return 0;
    const std::int64_t ms = most_uams / std::max(cell_uv / plan_->bleed_ohm, std::int32_t{1});
    return static_cast<std::uint32_t>(
        std::min<std::int64_t>(ms / (plan_->neighbours_may_bleed ? 1'000 : 500), 0xFFFF'FFFF));
  }

 private:
  constexpr void count_bled(const std::array<std::int32_t, Cells>& cell_uv, std::uint32_t step_us) {
    left_us_ += step_us;
    const std::uint32_t ms = left_us_ / 1'000;
    left_us_ %= 1'000;
    for (std::size_t k = 0; k < Cells; ++k) {
      if ((mask_ >> k & 1) != 0 && cell_uv[k] > 0)
        count_bled(k, static_cast<std::int64_t>(cell_uv[k] / plan_->bleed_ohm) * ms);
    }
  }

  constexpr void count_bled(std::size_t k, std::int64_t uams) {
    remaining_uams_[k] -= uams;
    bled_uams_[k] += uams;
  }

  constexpr void measure(const BalancingInput<Cells>& in, std::int32_t unsure_ppb) {
    std::size_t lowest = Cells;
    for (std::size_t k = 0; k < Cells; ++k) {
      if (in.soc_ppb[k] == measurement::no_reading || in.sigma_ppb[k] > max_sigma_ppb)
        return;  // an unknown cell may be the lowest
      if (lowest == Cells || in.soc_ppb[k] < in.soc_ppb[lowest]) lowest = k;
    }
    for (std::size_t k = 0; k < Cells; ++k) {
      const std::int64_t excess_ppb = std::int64_t{in.soc_ppb[k]} - in.soc_ppb[lowest] -
                                      2 * (std::int64_t{in.sigma_ppb[k]} + in.sigma_ppb[lowest] + 2 * unsure_ppb);
      const std::int64_t uams = excess_ppb > dead_band_ppb ? excess_ppb * plan_->uams_per_ppb : 0;
      remaining_uams_[k] = unsure_ppb <= finest_ppb_ ? uams : std::max(uams, remaining_uams_[k]);
    }
    measured_ = true;
    unsure_ppb_ = unsure_ppb;
    finest_ppb_ = std::min(finest_ppb_, unsure_ppb);
    measured_at_ppb_ = in.mean_soc_ppb;
  }

  const BalancingPlan* plan_;
  std::array<std::int64_t, Cells> remaining_uams_{};   ///< charge still to bleed, by cell
  std::array<std::int64_t, Cells> bled_uams_{};        ///< not taken yet
  std::int32_t unsure_ppb_ = 0, measured_at_ppb_ = 0;  ///< of the last measurement
  std::int32_t finest_ppb_ = top_ppb;                  ///< the smallest unsure_ppb_ so far
  std::uint32_t mask_ = 0, turn_us_ = 0, left_us_ = 0;
  bool measured_ = false;
};

}  // namespace bms::protection
