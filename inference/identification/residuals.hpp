// Analysis of residuals: are they white noise? (Appendix C; Ljung, System Identification, 2nd ed., 16.6)
#pragma once

#include <vector>

#include <Eigen/Core>

namespace bms::identification {

struct ResidualAnalysis {
  double mean_v = 0;       ///< bias
  double mean_band_v = 0;  ///< two sigma of the bias; within it the bias is not significant. Counts runs, not samples
  double correlation_length = 1;                    ///< samples
  std::vector<double> autocorrelation;              ///< lag 1, 2 ...
  std::vector<double> input_correlation;            ///< of residual and earlier current, lag 0, 1 ...
  double white_band = 0;                            ///< two sigma of both for a white residual
  double autocorrelated = 0, input_correlated = 0;  ///< fraction of lags outside the band; white: about 0.05
  bool biased() const { return mean_v > mean_band_v || mean_v < -mean_band_v; }
};

/// Residuals and currents of one recording, in order.
ResidualAnalysis analyse(const Eigen::VectorXd& residuals, const Eigen::VectorXd& current, int lags = 25);

/// The finite values, in order.
Eigen::VectorXd without_missing(const Eigen::VectorXd& values);

/// Samples over which residuals are correlated: 1 + 2 * sum of the autocorrelation up to its first zero. 1: white.
double correlation_length(const Eigen::VectorXd& residuals);

/// The portmanteau test: are residuals white noise? (Ljung and Box, Biometrika 65 (1978) 297)
struct Whiteness {
  double statistic = 0;
  double limit = 0;  ///< white residuals exceed it in 1 % of cases
  bool white() const { return statistic <= limit; }
};
Whiteness whiteness(const Eigen::VectorXd& residuals);

/// Error of the k-step prediction of the voltage at each sample from k on. The prediction is the simulation plus the
/// last known residual, which decays by fading_per_step (first-order disturbance). residuals: measured minus simulated.
Eigen::VectorXd prediction_error(const Eigen::VectorXd& residuals, int k, double fading_per_step);

/// Lag-one autocorrelation, 0..1, for `prediction_error`.
double fading(const Eigen::VectorXd& residuals);

}  // namespace bms::identification
