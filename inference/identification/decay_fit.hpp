// Exponential decay of a voltage, v(t) = A + B exp(-t / tau), by least squares.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace bms::identification {

struct Trace {
  std::vector<double> t_s, v;  ///< t from the step
};

struct Decay {
  double level_v = 0, amplitude_v = 0, tau_s = 0;  ///< A, B, tau
  double squares = INFINITY;                       ///< sum of squared residuals; infinite: no fit
};

/// A decay and the voltages that it was fitted to.
struct FittedDecay {
  Trace trace;
  Decay decay;
};

/// The best decay of a trace with at least three samples.
Decay best_decay(const Trace& trace);

/// The trace without outliers beyond five (robust) standard deviations of the fit, such as a loose contact or a lost
/// bit.
Trace without_outliers(const Trace& trace, const Decay& decay);

/// Covariance of A, B and tau for white residuals of this variance.
Eigen::Matrix3d covariance_of(const FittedDecay& fitted, double variance_v2);

/// Mean residual of the first samples, which contains a faster relaxation if there is one.
struct FirstSamples {
  std::size_t count = 0;
  double residual_v = 0;
};
FirstSamples first_samples(const FittedDecay& fitted);

}  // namespace bms::identification
