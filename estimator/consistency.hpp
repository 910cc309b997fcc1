// Monitor of the filter's consistency: the mean deviation of the voltage from the model over half an hour, as long as a
// model's error lasts.
//
//   d' = d + dt / 1800 s (innovation + estimated voltage error - d)
//
// A filter that is right has d within its own standard deviation: model error, error of the overpotential, slope of the
// OCV times the sigma of the SOC. Two consequences:
//
//   always        the variance of the voltage is at least d^2, counted once in a correlation time
//   d > 2.5 of    the state is inconsistent with the voltages: SocEstimator opens the bank of hypotheses, with d^2 as a
//   its sigma     part of the model's error, because it may be the model that is wrong
//
// The sigma follows the load: the largest of the last half hour counts, since d lags behind.
#pragma once

#include "arithmetic/scalar.hpp"

namespace bms::estimator {

template <class S>
class Consistency {
  using Voltage = arithmetic::Voltage<S>;
  using Variance = arithmetic::Variance<S>;
  using Fraction = arithmetic::Fraction<S>;

 public:
  static constexpr double mean_over_s = 1'800;
  static constexpr double max_sigmas = 2.5;
  /// Smallest standard deviation of any model's voltage over half an hour [V], whatever its cell file says.
  static constexpr double min_error_v = 0.006;

  /// deviation_v: of a reading from the model; share: dt / mean_over_s, 1 at most.
  constexpr void add(const Voltage& deviation_v, const Fraction& share) {
    mean_v_ = Voltage(mean_v_ + share * Voltage(deviation_v - mean_v_));
  }
  /// Square of the overpotential as its error counts: the mean of the last half hour, or its present square if that is
  /// larger. The error of an overpotential lasts beyond the load that made it.
  constexpr Variance lasting_overpotential_v2(const Voltage& overpotential_v, const Fraction& share) {
    const Variance present_v2 = overpotential_v * overpotential_v;
    overpotential_v2_ =
        Variance(overpotential_v2_ + arithmetic::product<Variance>(Variance(present_v2 - overpotential_v2_), share));
    return present_v2 > overpotential_v2_ ? present_v2 : overpotential_v2_;
  }
  constexpr Variance variance() const { return mean_v_ * mean_v_; }

  /// Returns true if the mean is so large, or not a number, that is_inconsistent() has to decide. Costs one comparison.
  constexpr bool is_suspect() const { return !(arithmetic::magnitude(mean_v_) <= Voltage(max_sigmas * min_error_v)); }
  /// expected_v2: variance that the filter expects of a deviation that lasts.
  constexpr bool is_inconsistent(const Variance& expected_v2, const Fraction& share) {
    expected_v2_ = Variance(expected_v2_ - arithmetic::product<Variance>(expected_v2_, share));
    if (expected_v2_ < expected_v2) expected_v2_ = expected_v2;
    return !(variance() <= arithmetic::product<Variance>(expected_v2_, arithmetic::Count<S>(max_sigmas * max_sigmas)));
  }
  constexpr void reset() {
    mean_v_ = Voltage(0);
    expected_v2_ = Variance{};
  }

 private:
  Voltage mean_v_{};
  Variance expected_v2_{}, overpotential_v2_{};
};

}  // namespace bms::estimator
