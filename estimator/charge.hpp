// The charge of a cell, counted in integers. A float32 sum of 10 mA over 10 ms into a cell of 6 Ah would never change.
//
//   charge += current_ua * duration_us        exact, in 1e-12 A s
//   soc     = charge / capacity               read in counts of 2^shift (model::ChargeScale), below 4e-9
//
// The charge is clamped to -1/4 .. 5/4 of the capacity: nothing overflows, however long a sensor is wrong (asserted
// below). A dual number (an unknown of a fit) keeps its derivatives instead: Charge<Jet> sums in Jets.
#pragma once

#include <concepts>
#include <cstdint>

#include "model/cell.hpp"

namespace bms::estimator {

inline constexpr std::int32_t longest_count_us = 2'000'000'000;

namespace charge_ranges {

using namespace model;
inline constexpr double largest_uaus = accepted::capacity_ah.high * 3'600e12;
static_assert(max_soc * largest_uaus + max_soc * largest_uaus < 0x1p63, "full, plus the largest correction");
static_assert(max_soc * largest_uaus + 0x1p31 * longest_count_us < 0x1p63,
              "full, plus the largest current over the longest count");
static_assert(max_soc * 0x1p29 < 0x1p31, "read in counts");
static_assert(accepted::capacity_ah.low * 3'600e12 / 0x1p32 > 5'000,
              "the upper 32 bits resolve 1/5000 of the smallest cell");

}  // namespace charge_ranges

template <class S>
inline constexpr bool counts_in_integers = std::floating_point<S> || std::same_as<S, arithmetic::FixedPoint>;

template <class S>
class Charge {
  using Soc = arithmetic::Soc<S>;
  using Scale = model::ChargeScale<S>;

 public:
  constexpr void set(const Soc& soc, const Scale& scale) {
    uaus_ = 0;
    correct(soc, scale);
  }

  /// current_ua: at least -2^31 + 1; duration_us: 0 to longest_count_us.
  constexpr void count(std::int32_t current_ua, std::int32_t duration_us, const Scale& scale) {
    uaus_ += arithmetic::wide_product(current_ua, duration_us);
    limit_soc(scale);
  }

  /// Moves soc by delta, to the nearest count.
  constexpr void correct(const Soc& delta, const Scale& scale) {
    uaus_ += static_cast<std::int64_t>(to_counts(delta, scale)) << scale.shift;
    limit_soc(scale);
  }

  constexpr Soc soc(const Scale& scale) const {
    const auto counts = static_cast<std::int32_t>(uaus_ >> scale.shift);
    if constexpr (arithmetic::is_q<Soc>) {
      return Soc::from_raw(counts) * scale.soc_per_count;
    } else {
      return static_cast<Soc>(counts) * scale.soc_per_count;
    }
  }

 private:
  friend struct LaneAccess;

  static constexpr std::int32_t to_counts(const Soc& delta, const Scale& scale) {
    const Soc most(model::max_soc);
    const Soc clamped = limited(delta, most);
    if constexpr (arithmetic::is_q<Soc>) {
      return Soc(clamped * scale.counts_per_soc).raw();
    } else {
      return static_cast<std::int32_t>(clamped * scale.counts_per_soc + half_signed(clamped));
    }
  }

  /// Within +-most; not-a-number becomes 0.
  static constexpr Soc limited(const Soc& delta, const Soc& most) {
    if (!(delta <= most)) [[unlikely]]
      return delta > most ? most : Soc(0);
    return delta < -most ? Soc(-most) : delta;
  }

  /// 1/2 with the sign of x. A builtin copies the sign without a branch; a branch on noise would be mispredicted every
  /// second time.
  static constexpr Soc half_signed(Soc x) {
    if constexpr (std::same_as<Soc, float>)
      return __builtin_copysignf(0.5F, x);
    else
      return __builtin_copysign(0.5, x);
  }

  constexpr void limit_soc(const Scale& scale) {
    // the upper 32 bits are enough: they resolve 1/5000 of the smallest cell
    const auto upper = static_cast<std::uint32_t>(uaus_ >> 32),
               lowest = static_cast<std::uint32_t>(scale.lowest_uaus >> 32);
    if (upper - lowest < static_cast<std::uint32_t>(scale.highest_uaus >> 32) - lowest) [[likely]]
      return;
    uaus_ = uaus_ < 0 ? scale.lowest_uaus : scale.highest_uaus;
  }

  std::int64_t uaus_ = 0;
};

template <class S>
requires(!counts_in_integers<S>) class Charge<S> {
  using Scale = model::ChargeScale<S>;

 public:
  void set(const S& soc, const Scale&) { soc_ = soc; }
  void count(std::int32_t current_ua, std::int32_t duration_us, const Scale& scale) {
    soc_ += S(static_cast<double>(current_ua) * static_cast<double>(duration_us) /
              static_cast<double>(scale.capacity_uaus));
  }
  void correct(const S& delta, const Scale&) { soc_ += delta; }
  S soc(const Scale&) const { return soc_; }

 private:
  S soc_{};
};

}  // namespace bms::estimator
