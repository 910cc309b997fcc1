// Validation gate of the voltage: an innovation of more than `max_sigmas` standard deviations of everything known is an
// outlier, and the filter does not use that voltage. Outliers that last contradict the state of charge or the model:
// the monitor decides on them (consistency.hpp).
#pragma once

#include "arithmetic/scalar.hpp"

namespace bms::estimator {

template <class S>
class OutlierGate {
 public:
  /// A cell that was discharged fast shows innovations of five standard deviations for minutes.
  static constexpr double max_sigmas = 8;
  /// Smallest standard deviation of any model's voltage [V], whatever its cell file says.
  static constexpr double min_error_v = 0.01;
  /// Largest innovation that cannot be an outlier [V].
  static constexpr arithmetic::Voltage<S> suspect_v() { return arithmetic::Voltage<S>(max_sigmas * min_error_v); }
  /// Returns true if the innovation is so large, or not a number, that is_outlier() has to decide.
  static constexpr bool is_suspect(const arithmetic::Voltage<S>& innovation_v) {
    return !(arithmetic::magnitude(innovation_v) <= suspect_v());
  }

  /// innovation_v2: variance of the innovation. Not-a-number is an outlier.
  static constexpr bool is_outlier(const arithmetic::Voltage<S>& innovation_v,
                                   const arithmetic::Variance<S>& innovation_v2) {
    using Variance = arithmetic::Variance<S>;
    return !(Variance(innovation_v * innovation_v) <=
             Variance(innovation_v2 * arithmetic::Count<S>(max_sigmas * max_sigmas)));
  }
};

}  // namespace bms::estimator
