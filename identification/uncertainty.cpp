#include "identification/uncertainty.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>

#include "identification/residuals.hpp"

namespace bms::identification {

namespace {

/// Sum over all pairs of samples at most `window` apart, weighted by 1 - distance / window, of score score'. As sums
/// over a moving window, whose products have just these weights.
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

}  // namespace

double Uncertainty::std(Eigen::Index k) const { return std::sqrt(std::max(0.0, covariance(k, k))); }
double Uncertainty::std_with_offset(Eigen::Index k) const { return std::hypot(std(k), offset[k]); }
double Uncertainty::std_white(Eigen::Index k) const { return std::sqrt(std::max(0.0, covariance_white(k, k))); }

Uncertainty uncertainty(const Eigen::VectorXd& residuals, const Eigen::MatrixXd& jacobian, Eigen::Index data,
                        const Eigen::VectorXi& fixed, double offset_v) {
  const Eigen::Index m = jacobian.rows(), n = jacobian.cols(), beliefs = m - data;
  Uncertainty u;
  u.covariance = u.covariance_white = Eigen::MatrixXd::Zero(n, n);
  u.correlation = Eigen::MatrixXd::Identity(n, n);
  u.identifiable = Eigen::VectorXi::Zero(n);
  u.offset = Eigen::VectorXd::Zero(n);

  // free parameters in units of what moves the voltage by the same amount, so that one threshold serves ohm and farad
  std::vector<Eigen::Index> free;
  const double largest = jacobian.size() > 0 ? jacobian.colwise().norm().maxCoeff() : 0;
  for (Eigen::Index k = 0; k < n; ++k) {
    if (fixed[k] == 0 && jacobian.col(k).norm() > 1e-14 * largest) free.push_back(k);
  }
  const auto f = static_cast<Eigen::Index>(free.size());
  u.output_variance_v2 = residuals.head(data).squaredNorm() / static_cast<double>(std::max<Eigen::Index>(1, data - f));
  u.correlation_length = correlation_length(residuals.head(data));
  if (f == 0) return u;
  Eigen::VectorXd norm(f);
  Eigen::MatrixXd scores(m, f);
  for (Eigen::Index k = 0; k < f; ++k) {
    norm[k] = jacobian.col(free[static_cast<std::size_t>(k)]).norm();
    scores.col(k) = jacobian.col(free[static_cast<std::size_t>(k)]) / norm[k];
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(Eigen::MatrixXd(scores.transpose() * scores));
  // directions that the data do not show: their parameters are not seen, the others are judged without them
  constexpr double unseen = 1e-12;
  Eigen::VectorXd inverse = eigen.eigenvalues();
  for (Eigen::Index k = 0; k < f; ++k) inverse[k] = inverse[k] > unseen ? 1 / inverse[k] : 0;
  for (Eigen::Index k = 0; k < f; ++k) {
    double hidden = 0;
    for (Eigen::Index e = 0; e < f; ++e)
      hidden += inverse[e] > 0 ? 0 : eigen.eigenvectors()(k, e) * eigen.eigenvectors()(k, e);
    u.identifiable[free[static_cast<std::size_t>(k)]] = hidden < 0.01 ? 1 : 0;
  }
  const Eigen::MatrixXd bread = eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose();
  const Eigen::VectorXd shift = bread * scores.topRows(data).colwise().sum().transpose() * offset_v;
  const Eigen::MatrixXd of_beliefs = scores.bottomRows(beliefs).transpose() * scores.bottomRows(beliefs) *
                                     (u.output_variance_v2 * u.correlation_length);
  scores.conservativeResize(data, Eigen::NoChange);
  scores.array().colwise() *= residuals.head(data).array();
  const auto window = static_cast<Eigen::Index>(
      std::clamp(6 * u.correlation_length, 1.0, std::max(1.0, 0.25 * static_cast<double>(data))));
  // parameters take some freedom from the residuals, and the window some from the long run
  const auto n_data = static_cast<double>(data);
  const double freedom =
      n_data / std::max(1.0, n_data - static_cast<double>(f)) * n_data / (n_data - static_cast<double>(window - 1));
  const Eigen::MatrixXd coloured = bread * (long_run(scores, window) * freedom + of_beliefs) * bread;
  for (Eigen::Index a = 0; a < f; ++a) {
    u.offset[free[static_cast<std::size_t>(a)]] = shift[a] / norm[a];
    for (Eigen::Index b = 0; b < f; ++b) {
      const Eigen::Index row = free[static_cast<std::size_t>(a)], column = free[static_cast<std::size_t>(b)];
      u.covariance(row, column) = coloured(a, b) / (norm[a] * norm[b]);
      u.covariance_white(row, column) = u.output_variance_v2 * bread(a, b) / (norm[a] * norm[b]);
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
