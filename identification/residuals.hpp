// Is what the model leaves over only noise? (Appendix C; Ljung, System Identification, 2nd ed., 16.6)
#pragma once

#include <vector>

#include <Eigen/Core>

namespace bms::identification {

struct ResidualAnalysis {
  double mean_v = 0,
         mean_band_v = 0;         ///< bias, and the two sigma band within which it is none; counts runs, not samples
  double correlation_length = 1;  ///< samples
  std::vector<double> autocorrelation;              ///< lag 1, 2 ...
  std::vector<double> input_correlation;            ///< of residual and current before it, lag 0, 1 ...
  double white_band = 0;                            ///< two sigma of either if the residual were white
  double autocorrelated = 0, input_correlated = 0;  ///< fraction of lags outside the band; white: about 0.05
  bool biased() const { return mean_v > mean_band_v || mean_v < -mean_band_v; }
};

/// Residuals and currents of one record, in order.
ResidualAnalysis analyse(const Eigen::VectorXd& residuals, const Eigen::VectorXd& current, int lags = 25);

/// Those that are numbers, in order.
Eigen::VectorXd without_missing(const Eigen::VectorXd& values);

/// How many samples in a row are alike: 1 + 2 * sum of the autocorrelation up to its first zero. 1: white.
double correlation_length(const Eigen::VectorXd& residuals);

/// k-step prediction of the voltage: the simulation, and the last known residual fading as the residuals have been seen
/// to do (first-order disturbance). residuals: measured less simulated. Returns the prediction's error at each sample
/// from k on.
Eigen::VectorXd prediction_error(const Eigen::VectorXd& residuals, int k, double fading_per_step);

/// Lag-one autocorrelation, 0..1: what `prediction_error` takes.
double fading(const Eigen::VectorXd& residuals);

}  // namespace bms::identification
