// The error of an open-circuit voltage curve as a function of the state of charge, marginalised in a fit.
//
// A curve from a slow run lacks the overvoltage of its current; one of straight pieces or of rests is wrong between its
// points. Such an error stays while the state of charge does, so that a fit would explain it by R1 and C1. Its prior is
// a Gauss-Markov process over SOC with the standard deviation of the curve; next to empty and full, where a slow run
// does not measure the curve, it also wanders by as much as the curve changes there. The voltage is linear in it. At
// each iterate the fit therefore takes its best values (variable projection), and the uncertainty of the parameters
// includes it.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace bms::identification {

/// Standard deviations [V].
struct OcvErrorPrior {
  double curve_v = 0;                      ///< of the curve, > 0
  double empty_end_v = 0, full_end_v = 0;  ///< of what the curve does in its unmeasured ends (unmeasured_end), >= 0
};

class OcvError {
 public:
  /// weight_v: residual that stands for one standard deviation, > 0.
  OcvError(const OcvErrorPrior& prior, double weight_v);

  /// Number of nodes over SOC 0 to 1; the error is straight between them and constant beyond.
  static Eigen::Index nodes();

  /// residuals: simulated minus measured [V]; jacobian: of the same rows, or null; soc: of the same rows, NaN for rows
  /// that do not count. Adds the error that is best for these residuals. Then prior_residuals (`nodes` rows) are those
  /// of the prior, and both Jacobians are total derivatives.
  void take_out(const Eigen::VectorXd& soc, Eigen::Ref<Eigen::VectorXd> residuals,
                Eigen::Ref<Eigen::VectorXd> prior_residuals, Eigen::MatrixXd* jacobian, Eigen::Index prior_row) const;

 private:
  Eigen::MatrixXd prior_;  ///< its residuals by the error at the nodes
};

}  // namespace bms::identification
