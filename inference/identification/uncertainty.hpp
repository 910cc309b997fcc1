// Uncertainty of the parameters of a fit.
//
//   white      s^2 (J'J)^-1, as if the residuals were white
//   coloured   (J'J)^-1 J' W J (J'J)^-1, W from the autocorrelation of the residuals. Residuals of a battery model come
//              in long runs; each run counts once (Newey and West, Econometrica 55 (1987) 703, Bartlett window)
//   unmodelled what the model lacks and of which only a standard deviation is known: its effect on the parameters is
//              added to the coloured covariance
//   offset     change of the parameters by a voltage error that is constant over the recording (of the OCV curve, of
//              the sensor); more samples do not reduce it
//
// Parameters at a bound are fixed there and have no standard deviation.
#pragma once

#include <Eigen/Core>

namespace bms::identification {

struct Uncertainty {
  Eigen::MatrixXd covariance;  ///< coloured; 0 for fixed parameters
  Eigen::MatrixXd covariance_white;
  Eigen::MatrixXd correlation;    ///< of `covariance`; 1 on its diagonal
  double output_variance_v2 = 0;  ///< of the residuals, over samples minus parameters
  double correlation_length = 1;  ///< samples over which residuals are correlated
  Eigen::VectorXd offset;         ///< change of each parameter by the constant error
  Eigen::VectorXi identifiable;   ///< 0: the data do not depend on this parameter, or only together with others

  double std(Eigen::Index k) const;
  double std_white(Eigen::Index k) const;
  double std_with_offset(Eigen::Index k) const;
};

/// residuals: m. jacobian: m by n. The first `data` rows are samples in order; the others are priors, each of which
/// counts as one run of residuals. fixed: n, not 0 for parameters at a bound. offset_v: the constant error, >= 0.
/// unmodelled: m by any number of columns, the change of the residuals by one standard deviation of each; or empty.
Uncertainty uncertainty(const Eigen::VectorXd& residuals, const Eigen::MatrixXd& jacobian, Eigen::Index data,
                        const Eigen::VectorXi& fixed, double offset_v, const Eigen::MatrixXd& unmodelled = {});

}  // namespace bms::identification
