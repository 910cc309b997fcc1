// Overload integral I2t of one direction: h += rate dt, not below 0. Its row forbids the direction at 30 s. With
// x = (I / L)^2 and L = 1.05 x continuous limit:
//
//   without ratings  rate = x - 1: a thermal replica after IEC 60255-149, without its exponential. At rest 30 s of
//                    overload decay in 30 s. From rest, 2 L last 10 s and 1.41 L last 30 s.
//   with ratings     of pulses for 10 s and 30 s, in the cell file: the largest of three integrals
//     time           a pulse lasts as long as it is rated and no longer. Its rate is s (x - 1), also below L, and
//                      up to the rating for 30 s     at most 1
//                      up to the rating for 10 s     at most 3
//                      above the larger of both      30, or x - 1 if that is more: forbidden within a second
//                    s >= 1 is 1, or what ends a rating of less than 1.41 L or 2 L after its time. A reading of 1.05 of
//                    a rating still counts as the rating. It is never more than s times the heat of rated pulses, so
//                    pulses whose heat has decayed leave nothing. It ends at 30 s: what flows on is heat, and a truck
//                    that reacts after a second does not pay for minutes.
//     heat           r (x - 1): r <= 1 is the smallest quotient of the rates above and x - 1 above L. From one full
//                    integral to the next the mean square of any current is at most L^2, beyond 30 s as well.
//     cold           x - 1 below the temperature from which the ratings hold, or without any; above it only decays. So
//                    nothing lasts longer in the cold than without ratings
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

/// Rates in 1/65536.
struct OverloadRates {
  std::int64_t time, heat, cold;

  constexpr std::int64_t largest() const { return std::max({time, heat, cold}); }
};

/// times_256: current over L in this direction, 0 to most_times_256. holds: the cells are warm enough for the ratings.
constexpr OverloadRates overload_rates(const OverloadPlan& plan, std::int32_t times_256, bool holds) {
  constexpr std::int64_t one = 65'536;
  const std::int64_t square = std::int64_t{times_256} * times_256 - one;
  std::int64_t time = (square * plan.slope_64ths) >> 6;
  if (!plan.rated() || square <= 0) {
  } else if (times_256 <= plan.for_30s_256ths) {
    time = std::min(time, one);
  } else if (times_256 <= plan.for_10s_256ths) {
    time = std::min(time, 3 * one);
  } else {
    time = std::max(square, 30 * one);
  }
  return {time, (square * plan.recovery_32768ths) >> 15, holds ? std::min<std::int64_t>(square, 0) : square};
}

class OverloadIntegral {
 public:
  /// step_us: time since the last call.
  constexpr void update(const OverloadPlan& plan, std::int32_t times_256, bool holds, std::uint32_t step_us) {
    const OverloadRates rates = overload_rates(plan, times_256, holds);
    add(time_us_, rates.time, step_us, full_overload_us + 1);  // the row compares with >
    add(heat_us_, rates.heat, step_us, most_us);
    add(cold_us_, rates.cold, step_us, most_us);
  }
  /// The largest current, as times_256 up to that of the larger rating, that fills no integral in duration_us from now.
  constexpr std::int32_t carries_256ths(const OverloadPlan& plan, bool holds, std::uint32_t duration_us) const {
    const auto fits = [&](std::int32_t times_256) {
      const OverloadRates rates = overload_rates(plan, times_256, holds);
      const auto after_us = [&](std::int32_t us, std::int64_t rate) { return us + ((rate * duration_us) >> 16); };
      return after_us(time_us_, rates.time) <= full_overload_us && after_us(heat_us_, rates.heat) <= full_overload_us &&
             after_us(cold_us_, rates.cold) <= full_overload_us;
    };
    std::int32_t low = 0;
    for (std::int32_t high = std::max(plan.for_30s_256ths, plan.for_10s_256ths); low < high;) {
      const std::int32_t middle = (low + high + 1) / 2;
      if (fits(middle))
        low = middle;
      else
        high = middle - 1;
    }
    return low;
  }
  /// Value that the row compares [us].
  constexpr std::int32_t value_us() const { return std::max({time_us_, heat_us_, cold_us_}); }

 private:
  static constexpr std::int32_t most_us = 2'000'000'000;

  static constexpr void add(std::int32_t& us, std::int64_t rate, std::uint32_t step_us, std::int32_t most) {
    us = static_cast<std::int32_t>(std::clamp<std::int64_t>(us + ((rate * step_us) >> 16), 0, most));
  }

  std::int32_t time_us_ = 0, heat_us_ = 0, cold_us_ = 0;
};

}  // namespace bms::protection
