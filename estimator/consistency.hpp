// Monitor of the filter's consistency: the mean deviation of the voltage from the model over half an hour, as long as a
// model's error lasts.
//
//   d' = d + share (innovation + estimated voltage error - d)         share = time since the last check / 1800 s
//
// A filter that is right has d within its own standard deviation: model error, error of the overpotential, slope of the
// OCV times the sigma of the SOC. d beyond 3 of them is inconsistent: one false alarm in 370 half hours if the errors
// are normal. SocEstimator then opens the bank of hypotheses, with d^2 as a part of the model's error, because it may
// be the model that is wrong. The largest sigma of the last half hour counts, since d lags behind.
//
// The overpotential counts in the same way: the mean of its square over half an hour is a part of the voltage noise,
// because the error of a polarisation outlasts the load.
//
// One sample in `samples_per_check` is checked, so that a step costs no more. At 1 s that number is prime: a load that
// repeats in whole minutes is then seen at all its phases.
#pragma once

#include <cstdint>

#include "arithmetic/scalar.hpp"

namespace bms::estimator {

template <class S>
class Consistency {
  using Voltage = arithmetic::Voltage<S>;
  using Variance = arithmetic::Variance<S>;
  using Fraction = arithmetic::Fraction<S>;

 public:
  static constexpr double mean_over_s = 1'800;
  static constexpr double max_sigmas = 3;
  /// Smallest standard deviation of any model's voltage over half an hour [V], whatever its cell file says.
  static constexpr double min_error_v = 0.005;
  static constexpr std::uint32_t check_after_us = 60'000'000, max_samples_per_check = 59;

  /// Counts a sample. Returns true if it is to be checked, the first one too.
  constexpr bool is_due() { return --samples_left_ == 0; }
  /// Starts the next turn. Returns true if this one had ended; a suspect voltage is checked before that.
  constexpr bool begin_turn(std::uint32_t samples) {
    if (samples_left_ != 0 && samples > 1) return false;
    samples_left_ = samples;
    return true;
  }

  /// deviation_v: of a reading from the model; overpotential_v2: present square; share: of this check in the mean.
  constexpr void add(const Voltage& deviation_v, const Variance& overpotential_v2, const Fraction& share) {
    mean_v_ = Voltage(mean_v_ + share * Voltage(deviation_v - mean_v_));
    overpotential_v2_ = Variance(overpotential_v2_ +
                                 arithmetic::product<Variance>(Variance(overpotential_v2 - overpotential_v2_), share));
  }
  constexpr Variance variance() const { return mean_v_ * mean_v_; }
  /// Mean square of the overpotential.
  constexpr const Variance& overpotential_v2() const { return overpotential_v2_; }

  /// Returns true if the mean is so large, or not a number, that is_inconsistent() has to decide. Costs one comparison.
  constexpr bool is_suspect() const { return !(arithmetic::magnitude(mean_v_) <= Voltage(max_sigmas * min_error_v)); }
  /// expected_v2: variance that the filter expects of a deviation that lasts.
  constexpr bool is_inconsistent(const Variance& expected_v2, const Fraction& share) {
    expected_v2_ = Variance(expected_v2_ - arithmetic::product<Variance>(expected_v2_, share));
    if (expected_v2_ < expected_v2) expected_v2_ = expected_v2;
    return !(variance() <= arithmetic::product<Variance>(expected_v2_, arithmetic::Count<S>(max_sigmas * max_sigmas)));
  }
  /// The deviation so far is explained; the next sample is checked.
  constexpr void reset() {
    samples_left_ = 1;
    mean_v_ = Voltage(0);
    expected_v2_ = Variance{};
  }

 private:
  std::uint32_t samples_left_ = 1;
  Voltage mean_v_{};
  Variance expected_v2_{}, overpotential_v2_{};
};

}  // namespace bms::estimator
