// How far the parameters of a fit are to be believed.
//
//   white      s^2 (J'J)^-1, as if each residual were new
//   coloured   (J'J)^-1 J' W J (J'J)^-1, W from the residuals as they follow each other: residuals of a battery model
//   come in long
//              runs, each run counts once (Newey and West, Econometrica 55 (1987) 703, Bartlett window)
//   offset     what a voltage error that is constant over the record (of the OCV curve, of the sensor) would move; more
//   samples do not help
//
// Parameters at a bound are held there and have no deviation of their own.
#pragma once

#include <Eigen/Core>

namespace bms::identification {

struct Uncertainty {
  Eigen::MatrixXd covariance;  ///< coloured; 0 for parameters that were held
  Eigen::MatrixXd covariance_white;
  Eigen::MatrixXd correlation;    ///< of `covariance`; 1 on its diagonal
  double output_variance_v2 = 0;  ///< of the residuals, over samples less parameters
  double correlation_length = 1;  ///< samples over which residuals are alike
  Eigen::VectorXd offset;         ///< how far each parameter would move with the constant error
  Eigen::VectorXi identifiable;   ///< 0: nothing in the data depends on this parameter, or only together with others

  double std(Eigen::Index k) const;
  double std_white(Eigen::Index k) const;
  double std_with_offset(Eigen::Index k) const;
};

/// residuals: m. jacobian: m by n. The first `data` rows are samples in order, the rest beliefs, which count as one run
/// of residuals each. held: n, not 0 for parameters at a bound. offset_v: a constant error to reckon with, >= 0.
Uncertainty uncertainty(const Eigen::VectorXd& residuals, const Eigen::MatrixXd& jacobian, Eigen::Index data,
                        const Eigen::VectorXi& fixed, double offset_v);

}  // namespace bms::identification
