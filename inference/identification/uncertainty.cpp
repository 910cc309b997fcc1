#include "identification/uncertainty.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "identification/residuals.hpp"
#include "numerics/symmetric_eigen.hpp"

namespace bms::identification {

namespace {

/// Sum of score score' over all pairs of samples at most `window` apart, weighted by 1 - distance / window. Computed
/// with sums over a moving window, whose products have these weights.
Eigen::MatrixXd long_run(const Eigen::MatrixXd& scores, Eigen::Index window) {
  Eigen::MatrixXd total = Eigen::MatrixXd::Zero(scores.cols(), scores.cols());
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(scores.cols());
  for (Eigen::Index k = 0; k < scores.rows() + window - 1; ++k) {
    if (k < scores.rows()) sum += scores.row(k).transpose();
    if (k >= window) sum -= scores.row(k - window).transpose();
    total.selfadjointView<Eigen::Lower>().rankUpdate(sum);
  }
  total /= static_cast<double>(window);
  return total.selfadjointView<Eigen::Lower>();
}

/// The columns of J that count, each scaled to length 1, so that one threshold serves ohm and farad.
struct FreeColumns {
  std::vector<Eigen::Index> index;  ///< of the parameter
  Eigen::VectorXd norm;
  Eigen::MatrixXd scaled;
  Eigen::Index size() const { return static_cast<Eigen::Index>(index.size()); }
  Eigen::Index of(Eigen::Index k) const { return index[static_cast<std::size_t>(k)]; }
};

FreeColumns free_columns(const Eigen::MatrixXd& jacobian, const Eigen::VectorXi& fixed) {
  constexpr double negligible = 1e-14;  // length of a column, relative to the longest
  FreeColumns free;
  const double largest = jacobian.size() > 0 ? jacobian.colwise().norm().maxCoeff() : 0;
  for (Eigen::Index k = 0; k < jacobian.cols(); ++k) {
    if (fixed[k] == 0 && jacobian.col(k).norm() > negligible * largest) free.index.push_back(k);
  }
  free.norm.resize(free.size());
  free.scaled.resize(jacobian.rows(), free.size());
  for (Eigen::Index k = 0; k < free.size(); ++k) {
    free.norm[k] = jacobian.col(free.of(k)).norm();
    free.scaled.col(k) = jacobian.col(free.of(k)) / free.norm[k];
  }
  return free;
}

/// (J'J)^-1 of the scaled columns without the directions that the data do not determine. Sets `identifiable`.
Eigen::MatrixXd pseudo_inverse(const FreeColumns& free, Eigen::VectorXi& identifiable) {
  constexpr double undetermined = 1e-12;  // eigenvalue
  constexpr double largest_part = 0.01;   // of a parameter that lies in undetermined directions
  const auto [values, vectors] = numerics::symmetric_eigen(free.scaled.transpose() * free.scaled);
  Eigen::VectorXd inverse = values;
  for (double& value : inverse) value = value > undetermined ? 1 / value : 0;
  for (Eigen::Index k = 0; k < free.size(); ++k) {
    double hidden = 0;
    for (Eigen::Index e = 0; e < free.size(); ++e) hidden += inverse[e] > 0 ? 0 : vectors(k, e) * vectors(k, e);
    identifiable[free.of(k)] = hidden < largest_part ? 1 : 0;
  }
  return vectors * inverse.asDiagonal() * vectors.transpose();
}

/// The middle of the coloured covariance: the long-run covariance of the scores of the samples, and the priors.
/// A sample that decides a parameter alone pulls the fit to itself: its residual is divided by 1 - leverage (HC3;
/// MacKinnon and White, Journal of Econometrics 29 (1985) 305).
Eigen::MatrixXd coloured_scores(const Eigen::VectorXd& sample_residuals, Eigen::MatrixXd scores,
                                const Eigen::MatrixXd& inverse, const Uncertainty& u) {
  constexpr double least_free = 0.1;  // of a sample
  const Eigen::Index data = sample_residuals.size(), priors = scores.rows() - data;
  const Eigen::MatrixXd of_priors =
      scores.bottomRows(priors).transpose() * scores.bottomRows(priors) * (u.output_variance_v2 * u.correlation_length);
  const auto parameters = static_cast<double>(scores.cols()), n = static_cast<double>(data);
  scores.conservativeResize(data, Eigen::NoChange);
  const Eigen::VectorXd leverage = (scores * inverse).cwiseProduct(scores).rowwise().sum();
  scores.array().colwise() *= sample_residuals.array() / (1 - leverage.array()).max(least_free);
  const auto window = static_cast<Eigen::Index>(std::clamp(6 * u.correlation_length, 1.0, std::max(1.0, 0.25 * n)));
  // parameters take some freedom from the residuals, and the window takes some from the long run
  const double freedom = n / std::max(1.0, n - parameters) * n / (n - static_cast<double>(window - 1));
  return long_run(scores, window) * freedom + of_priors;
}

}  // namespace

double Uncertainty::std(Eigen::Index k) const { return std::sqrt(std::max(0.0, covariance(k, k))); }
double Uncertainty::std_with_offset(Eigen::Index k) const { return std::hypot(std(k), offset[k]); }
double Uncertainty::std_white(Eigen::Index k) const { return std::sqrt(std::max(0.0, covariance_white(k, k))); }

Uncertainty uncertainty(const Eigen::VectorXd& residuals, const Eigen::MatrixXd& jacobian, Eigen::Index data,
                        const Eigen::VectorXi& fixed, double offset_v, const Eigen::MatrixXd& unmodelled) {
  const Eigen::Index n = jacobian.cols();
  Uncertainty u;
  u.covariance = u.covariance_white = Eigen::MatrixXd::Zero(n, n);
  u.correlation = Eigen::MatrixXd::Identity(n, n);
  u.identifiable = Eigen::VectorXi::Zero(n);
  u.offset = Eigen::VectorXd::Zero(n);

  const FreeColumns free = free_columns(jacobian, fixed);
  const Eigen::Index f = free.size();
  u.output_variance_v2 = residuals.head(data).squaredNorm() / static_cast<double>(std::max<Eigen::Index>(1, data - f));
  u.correlation_length = correlation_length(residuals.head(data));
  if (f == 0) return u;
  const Eigen::MatrixXd inverse = pseudo_inverse(free, u.identifiable);
  const Eigen::VectorXd shift = inverse * free.scaled.topRows(data).colwise().sum().transpose() * offset_v;
  Eigen::MatrixXd coloured = inverse * coloured_scores(residuals.head(data), free.scaled, inverse, u) * inverse;
  if (unmodelled.size() > 0) {
    const Eigen::MatrixXd shifts = inverse * (free.scaled.transpose() * unmodelled);
    coloured += shifts * shifts.transpose();
  }
  for (Eigen::Index a = 0; a < f; ++a) {
    u.offset[free.of(a)] = shift[a] / free.norm[a];
    for (Eigen::Index b = 0; b < f; ++b) {
      const double norms = free.norm[a] * free.norm[b];
      u.covariance(free.of(a), free.of(b)) = coloured(a, b) / norms;
      u.covariance_white(free.of(a), free.of(b)) = u.output_variance_v2 * inverse(a, b) / norms;
    }
  }
  for (Eigen::Index a = 0; a < n; ++a) {
    for (Eigen::Index b = 0; b < n; ++b) {
      if (a != b && u.std(a) > 0 && u.std(b) > 0) u.correlation(a, b) = u.covariance(a, b) / (u.std(a) * u.std(b));
    }
  }
  return u;
}

}  // namespace bms::identification
