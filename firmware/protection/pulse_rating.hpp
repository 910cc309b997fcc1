// Pulses above the continuous current that the maker of a cell rates for 10 s and for 30 s, as shares of two integrals.
// Without a rating the overload integral I2t of pack_quantities.hpp acts alone, with 30 s of its own.
//
//   heat     h += ((I / L)^2 - 1) dt, not below 0, with L = 1.05 x continuous current, as the overload integral. Full
//   at
//            the larger of both ratings' ((P / L)^2 - 1) t, so that each of them lasts its time from rest, and at the
//            mean the square of the current stays below that of L.
//   time     the rating with the smaller heat would last longer than it may. Its own integral is full after its time:
//            for 30 s, currents above it count as this rating; for 10 s, the rating for 30 s takes the place of L. So a
//            current between both lasts 10 to 30 s.
//   above    A current above the largest rating is rated for no time: the heat is full after half a second.
//
// The share is that of the fuller one, in the unit of the overload integral: 30 s are full, so both have the same rows
// of the table. All currents are multiples of L, so a continuous current that a workshop lowers lowers the ratings.
// 1.05 allows for the errors of the sensor: a pulse that reads its rating exactly lasts longer than its time, by 14 %
// at twice the current below it, by 10 % at 4.5 times, by 61 % at 1.15 times, the closest ones that a file may state.
// Integers only.
#pragma once

#include <algorithm>
#include <cstdint>

#include "model/pulse_ratings.hpp"

namespace bms::protection {

/// Value of a full integral, the threshold of the rows charge_overcurrent and discharge_overcurrent [us].
inline constexpr std::int32_t full_overload_us = 30'000'000;

/// An integral: rises by (min(I, most)^2 - base^2) dt. Currents in 1/256 of L.
struct PulseStage {
  std::int32_t base_256, most_256;
  std::uint32_t gain;  ///< 2^32 x full_overload_us over its full value
};

/// Of one direction; top_256 = 0: no rating is stated.
struct PulsePlan {
  std::int32_t top_256 = 0;  ///< above it no time is rated
  PulseStage heat{}, time{};
};

namespace pulse_detail {

inline constexpr std::int32_t unlimited_256 = 10 * 256;

/// Full after `seconds` of the current `full`. Currents as multiples of the continuous one, as their readings are.
constexpr PulseStage stage(double base, double full, double seconds, bool clamps) {
  const double square_256 = 65'536 * (full * full - base * base);
  return {static_cast<std::int32_t>(256 * base + 0.5),
          clamps ? static_cast<std::int32_t>(256 * full + 0.5) : unlimited_256,
          static_cast<std::uint32_t>(4'294'967'296.0 * full_overload_us / (square_256 * 1e6 * seconds))};
}
constexpr double heat_s(double times, double seconds) { return (times * times - 1) * seconds; }

}  // namespace pulse_detail

/// continuous_a: the limit of the direction. The rating must be accepted by model::first_fault().
constexpr PulsePlan pulse_plan(const model::PulseRating& rating, double continuous_a) {
  using namespace pulse_detail;
  if (!rating.stated()) return {};
  const double for_10s = rating.for_10s_a / continuous_a, for_30s = rating.for_30s_a / continuous_a;
  PulsePlan plan;
  plan.top_256 = static_cast<std::int32_t>(256 * rating.most_a() / continuous_a + 0.5);
  if (for_10s == 0 || for_30s == 0) {
    plan.heat = for_10s == 0 ? stage(1, for_30s, 30, false) : stage(1, for_10s, 10, false);
    plan.time = plan.heat;
    return plan;
  }
  const bool longer_is_more = heat_s(for_30s, 30) >= heat_s(for_10s, 10);
  plan.heat = longer_is_more ? stage(1, for_30s, 30, false) : stage(1, for_10s, 10, false);
  plan.time = longer_is_more ? stage(for_30s, for_10s, 10, false) : stage(1, for_30s, 30, true);
  return plan;
}

/// The integrals of one direction.
class PulseIntegral {
 public:
  /// times_256: current over L in this direction, 0 to pulse_detail::unlimited_256. Returns the share, as the overload
  /// integral. The plan has a rating.
  constexpr std::int32_t update(const PulsePlan& plan, std::int32_t times_256, std::uint32_t step_us) {
    add(heat_us_, plan.heat, times_256, step_us);
    add(time_us_, plan.time, times_256, step_us);
    if (times_256 > plan.top_256) heat_us_ = clamped(heat_us_ + std::int64_t{unrated} * step_us);
    return std::max(heat_us_, time_us_);
  }

 private:
  static constexpr std::int32_t unrated = 60;                    ///< full after half a second
  static constexpr std::int64_t most_us = 2 * full_overload_us;  ///< bounds the time of its decay

  static constexpr std::int32_t clamped(std::int64_t us) {
    return static_cast<std::int32_t>(std::clamp<std::int64_t>(us, 0, most_us));
  }
  /// Of the fraction the lower bits are lost: at 10 Hz 1e-6 of a full integral an hour at most.
  static constexpr void add(std::int32_t& us, const PulseStage& stage, std::int32_t times_256, std::uint32_t step_us) {
    const std::int32_t times = std::min(times_256, stage.most_256);
    const std::int64_t square = std::int64_t{times} * times - std::int64_t{stage.base_256} * stage.base_256;
    us = clamped(us + ((((square * step_us) >> 8) * stage.gain) >> 24));
  }

  std::int32_t heat_us_ = 0, time_us_ = 0;
};

}  // namespace bms::protection
