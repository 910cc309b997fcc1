// Counts the charge with the capacity that the cell has, and finds that out: of the change of the SOC, what the
// voltages did not move has been counted. The capacity itself: CapacityHealth (health.hpp).
#pragma once

#include <cstdint>

#include "arithmetic/wide_product.hpp"
#include "estimator/charge.hpp"
#include "estimator/health.hpp"
#include "measurement/sample.hpp"

namespace bms::estimator {

/// The capacity with which the charge is counted. Counter and tables stay those of the cell file: a cell of 80 % moves
/// through them in 80 % of the time. So nothing jumps when the capacity changes.
class CountedCapacity {
 public:
  static constexpr std::int32_t step_ppm = 500;  ///< of the CAN message Health
  static constexpr std::int32_t least_ppm = 500'000, most_ppm = 1'500'000;
  static constexpr int differs_sigmas = 2;

  /// Takes another capacity if the present one is differs_sigmas away from it. Returns true if it did.
  template <class S>
  constexpr bool follow(const LearnedRatio<S>& found) {
    const std::int32_t ppm = arithmetic::to_micro(found.ratio());
    return found.away(ratio<S>(), arithmetic::Variance<S>(0), arithmetic::Count<S>(differs_sigmas * differs_sigmas)) &&
           set(ppm);
  }
  [[gnu::cold]] constexpr bool set(std::int32_t ppm) {
    if (ppm < least_ppm) ppm = least_ppm;
    if (ppm > most_ppm) ppm = most_ppm;
    const std::int32_t units = (ppm + step_ppm / 2) / step_ppm;
    if (ppm_ == units * step_ppm) return false;
    ppm_ = units * step_ppm;
    per_file_ = static_cast<std::int32_t>(((1'000'000U / step_ppm << bits) + static_cast<std::uint32_t>(units) / 2) /
                                          static_cast<std::uint32_t>(units));
    return true;
  }
  /// Relative to the cell file [1e-6].
  constexpr std::int32_t ppm() const { return ppm_; }
  template <class S>
  constexpr arithmetic::Soc<S> ratio() const {
    return arithmetic::from_micro<arithmetic::Soc<S>>(ppm_);
  }

  /// Time in which a current moves a cell with the file's capacity as far as this one in duration_us, >= 0.
  [[gnu::noinline]] constexpr std::int32_t file_us(std::int32_t duration_us) const {
    return static_cast<std::int32_t>((arithmetic::wide_product(duration_us, per_file_) + (1 << (bits - 1))) >> bits);
  }

 private:
  static constexpr int bits = 20;

  std::int32_t ppm_ = 1'000'000;
  std::int32_t per_file_ = 1 << bits;  ///< capacity of the file over this one [2^-bits]
};

template <class S>
class ChargeCount {
  using Soc = arithmetic::Soc<S>;
  using Voltage = arithmetic::Voltage<S>;
  using Variance = arithmetic::Variance<S>;

 public:
  /// The OCV curve at the SOC.
  struct Curve {
    arithmetic::VoltagePerSoc<S> slope;
    Variance error_v2;
  };

  /// Goes on with the capacity that an earlier run has found.
  [[gnu::cold, gnu::noinline]] constexpr void restore(const measurement::StartingCapacity& found) {
    counted_.set(found.ratio_ppm);
    health_.restore(counted_.ppm(), found.sigma_ppm);
  }
  constexpr const LearnedRatio<S>& capacity() const { return health_.learned(); }
  constexpr std::int32_t counted_ppm() const { return counted_.ppm(); }

  constexpr void begin(const Soc& soc) {
    checked_soc_ = soc;
    corrected_ = Soc(0);
  }
  constexpr void set_time_step(std::uint64_t step_us) {
    file_us_ = step_us > most_counted_us ? -1 : counted_.file_us(static_cast<std::int32_t>(step_us));
  }
  constexpr void count(Charge<S>& charge, std::int32_t current_ua, std::uint64_t step_us,
                       const model::ChargeScale<S>& scale) const {
    if (file_us_ < 0) [[unlikely]]
      return count_in_parts(charge, current_ua, step_us, scale);
    charge.count(current_ua, file_us_, scale);
  }
  /// Voltages moved the SOC.
  constexpr void corrected(const Soc& by) { corrected_ = Soc(corrected_ + by); }
  /// variance: that of the counted charge grows by it.
  constexpr void lose(const Variance& variance) { health_.lose(variance); }
  /// Variance of the charge counted since the capacity was last measured.
  constexpr const Variance& variance() const { return health_.reference_variance(); }

  /// Once a minute. off_v: of a voltage from the curve at the SOC; usable: whether it is; reading_v2(): its variance
  /// without that of the curve; counted2: by how much that of the counted charge has grown since the last call. Returns
  /// true if the charge is counted with another capacity from now on: then set the time step again.
  template <class F>
  [[gnu::cold, gnu::noinline]] constexpr bool update(const Soc& soc, const Voltage& off_v, const Curve& curve,
                                                     bool usable, const Variance& counted2, F&& reading_v2) {
    health_.count(Soc(Soc(Soc(soc - checked_soc_) - corrected_) * counted_.template ratio<S>()), counted2);
    begin(soc);
    const Voltage known_v = Voltage(curve.slope * arithmetic::Fraction<S>(CapacityHealth<S>::known_soc));
    const Variance known_v2 = known_v * known_v;
    Variance v2(1);
    if (usable && curve.error_v2 < known_v2 && arithmetic::magnitude(off_v) < known_v)
      v2 = Variance(curve.error_v2 + reading_v2());
    const bool found =
        v2 < known_v2
            ? health_.read(Soc(soc + arithmetic::ratio<Soc>(off_v, curve.slope)),
                           arithmetic::ratio<Variance>(arithmetic::ratio<Variance>(v2, curve.slope), curve.slope))
            : health_.leave();
    return found && counted_.follow(health_.learned());
  }

 private:
  friend struct LaneAccess;

  /// Counted at once: half of what the charge accepts, since a cell of half the capacity counts twice the time.
  static constexpr std::uint64_t most_counted_us = longest_count_us / (1'000'000 / CountedCapacity::least_ppm);
  static constexpr int longest_gap_counts = 2'000;  ///< of most_counted_us: 23 days; nothing is known after that

  /// Not inline: the compiler would multiply 64 bits in every step.
  [[gnu::cold, gnu::noinline]] constexpr void count_in_parts(Charge<S>& charge, std::int32_t current_ua,
                                                             std::uint64_t step_us,
                                                             const model::ChargeScale<S>& scale) const {
    for (int counts = 0; step_us > 0 && counts < longest_gap_counts; ++counts) {
      const auto part_us = static_cast<std::int32_t>(step_us < most_counted_us ? step_us : most_counted_us);
      charge.count(current_ua, counted_.file_us(part_us), scale);
      step_us -= static_cast<std::uint64_t>(part_us);
    }
  }

  CapacityHealth<S> health_;
  CountedCapacity counted_;
  std::int32_t file_us_ = 0;         ///< CountedCapacity::file_us() of a step; -1 if that is counted in parts
  Soc checked_soc_{}, corrected_{};  ///< SOC at the last update; by how much voltages moved it since
};

}  // namespace bms::estimator
