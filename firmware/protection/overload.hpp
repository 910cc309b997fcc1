// Overload integral I2t of one direction: h += rate dt, not below 0. Its row forbids the direction at 30 s. With
// x = (I / L)^2 and L = 1.05 x continuous limit:
//
//   without ratings  rate = x - 1: a thermal replica after IEC 60255-149, without its exponential. At rest 30 s of
//                    overload decay in 30 s. From rest, 2 L last 10 s and 1.41 L last 30 s.
//   with ratings     of pulses for 10 s and 30 s, in the cell file. They bound this rate, so that a pulse lasts as long
//                    as it is rated and no longer:
//                      up to the rating for 30 s     at most 1
//                      up to the rating for 10 s     at most 3
//                      above the larger of both      at least 30: forbidden within a second
//                    Where a rating is less than 1.41 L or 2 L, the rate is s (x - 1), s > 1, with which it ends after
//                    its time. A reading of 1.05 of a rating still counts as the rating. Below L the rate is r (x - 1):
//                    r <= 1 is the smallest quotient of rate and x - 1 above L. So h / r is never less than the heat,
//                    and from one full integral to the next the mean square of any current is at most L^2.
//   in the cold      below the temperature from which the ratings hold, or without any: the larger of both rates
//
// Currents count as multiples of L, so ratings follow a limit that a workshop lowers. A derated limit is enforced by
// the charge above it (excess_charge.hpp), which knows no ratings. Integers only.
#pragma once

#include <algorithm>
#include <cstdint>

#include "model/pulse_ratings.hpp"
#include "protection/pack_design.hpp"

namespace bms::protection {

struct OverloadPlan {
  std::uint16_t for_30s_256ths = 0, for_10s_256ths = 0;  ///< ratings over the continuous limit; 0: not stated
  std::uint16_t slope_64ths = 64, recovery_32768ths = 32'768;
  std::int16_t from_cdegc = 0;  ///< temperature from which the ratings hold

  constexpr bool rated() const { return (for_30s_256ths | for_10s_256ths) != 0; }
};

/// Current that counts as ten times the limit, which is a short circuit anyway.
inline constexpr std::int32_t most_times_256 = 10 * 256;
/// Value at which a direction is forbidden [us].
inline constexpr std::int32_t full_overload_us = 30'000'000;

constexpr OverloadPlan overload_plan(const model::PulseRating& rating, double continuous_a, double from_c) {
  OverloadPlan plan;
  if (!rating.stated()) return plan;
  plan.from_cdegc = static_cast<std::int16_t>(in_centi(from_c));
  double slope = 1, recovery = 1;
  const auto add = [&](double rating_a, double rate) {
    if (rating_a == 0) return std::uint16_t{0};
    const double times = std::min(std::max(rating_a / continuous_a, 1.0), most_times_256 / 256.0);
    const auto in_256ths = static_cast<std::uint16_t>(256 * times + 0.5);
    // from the rating itself to the one with the errors of the sensor; 1/256 above L is the first visible overload
    const auto quotient = [rate](double of_l) {
      const double seen = std::max(of_l, 257 / 256.0);
      return rate / (seen * seen - 1);
    };
    slope = std::max(slope, quotient(in_256ths / (256 * overcurrent_from)));
    recovery = std::min(recovery, quotient(in_256ths / 256.0));
    return in_256ths;
  };
  plan.for_30s_256ths = add(rating.for_30s_a, 1);
  plan.for_10s_256ths = add(rating.for_10s_a, 3);
  const double slope_64ths = 64 * slope;
  plan.slope_64ths = static_cast<std::uint16_t>(slope_64ths);
  if (plan.slope_64ths < slope_64ths) ++plan.slope_64ths;
  plan.recovery_32768ths = static_cast<std::uint16_t>(32'768 * recovery);
  return plan;
}

/// Rate of the integral in 1/65536. times_256: current over L in this direction, 0 to most_times_256. holds: the cells
/// are warm enough for the ratings.
constexpr std::int64_t overload_rate(const OverloadPlan& plan, std::int32_t times_256, bool holds) {
  constexpr std::int64_t one = 65'536;
  const std::int64_t square = std::int64_t{times_256} * times_256 - one;
  if (square <= 0) return (square * plan.recovery_32768ths) >> 15;
  if (!plan.rated()) return square;
  std::int64_t rate = (square * plan.slope_64ths) >> 6;
  if (times_256 <= plan.for_30s_256ths)
    rate = std::min(rate, one);
  else if (times_256 <= plan.for_10s_256ths)
    rate = std::min(rate, 3 * one);
  else
    rate = std::max(rate, 30 * one);
  return holds ? rate : std::max(rate, square);
}

}  // namespace bms::protection
