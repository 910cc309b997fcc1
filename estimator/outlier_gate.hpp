// Validation gate of the voltage: an innovation of more than `max_sigmas` standard deviations of everything known is an
// outlier, and the filter does not use that voltage. Outliers that persist for `restart_after_us` contradict the state
// of charge itself: then it is estimated again (SocEstimator opens the bank of hypotheses).
#pragma once

#include <cstdint>

#include "arithmetic/scalar.hpp"

namespace bms::estimator {

template <class S>
class OutlierGate {
 public:
  /// A cell that was discharged fast shows innovations of five standard deviations for minutes.
  static constexpr double max_sigmas = 8;
  /// Smallest standard deviation of any model's voltage [V], whatever its cell file says.
  static constexpr double min_error_v = 0.01;
  /// Time in outliers before the restart: a nearly empty cell needs minutes to recover.
  static constexpr std::uint32_t restart_after_us = 600'000'000;
  /// Time without outliers after which the count starts again.
  static constexpr std::uint32_t reset_after_us = 60'000'000;

  /// Returns true if the innovation is so large, or not a number, that is_outlier() has to decide. Costs one
  /// comparison.
  static constexpr bool is_suspect(const arithmetic::Voltage<S>& innovation_v) {
    return !(arithmetic::magnitude(innovation_v) <= arithmetic::Voltage<S>(max_sigmas * min_error_v));
  }

  /// innovation_v2: variance of the innovation. Not-a-number is an outlier.
  static constexpr bool is_outlier(const arithmetic::Voltage<S>& innovation_v,
                                   const arithmetic::Variance<S>& innovation_v2) {
    using Variance = arithmetic::Variance<S>;
    return !(Variance(innovation_v * innovation_v) <=
             Variance(innovation_v2 * arithmetic::Count<S>(max_sigmas * max_sigmas)));
  }

  /// Counts an outlier at time_us, step_us after the previous sample. Returns true if outliers have lasted for
  /// restart_after_us; the count then starts again.
  constexpr bool has_persisted(std::uint64_t time_us, std::uint64_t step_us) {
    if (time_us - last_us_ > reset_after_us + step_us) duration_us_ = 0;
    last_us_ = time_us;
    duration_us_ += step_us < reset_after_us ? static_cast<std::uint32_t>(step_us) : reset_after_us;
    if (duration_us_ < restart_after_us) return false;
    duration_us_ = 0;
    return true;
  }

 private:
  std::uint64_t last_us_ = 0;
  std::uint32_t duration_us_ = 0;
};

}  // namespace bms::estimator
