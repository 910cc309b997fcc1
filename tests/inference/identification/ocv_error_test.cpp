#include "identification/ocv_error.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include <Eigen/Dense>

namespace bms::identification {
namespace {

constexpr double sigma_v = 0.006, weight_v = 0.002;
constexpr Eigen::Index rows = 120, hundredths = 101;  // of samples, and of nodes between which they lie

struct Result {
  Eigen::VectorXd residuals, prior = Eigen::VectorXd::Zero(OcvError::nodes());
  Eigen::MatrixXd jacobian;
  double cost() const { return residuals.squaredNorm() + prior.squaredNorm(); }
};

Eigen::VectorXd soc_of_rows() {
  Eigen::VectorXd soc = Eigen::VectorXd::LinSpaced(rows, 0.97, 0.13);
  soc[7] = std::numeric_limits<double>::quiet_NaN();
  return soc;
}

/// Residuals and Jacobian of two unknowns; nothing in the row that does not count.
Result before() {
  Result r;
  r.residuals.resize(rows);
  r.jacobian = Eigen::MatrixXd::Zero(rows + OcvError::nodes(), 2);
  for (Eigen::Index k = 0; k < rows; ++k) {
    const auto at = static_cast<double>(k);
    r.residuals[k] = 0.004 * std::cos(0.05 * at) + 0.001 * std::sin(1.7 * at);
    r.jacobian.row(k) << (k % 10 < 4 ? 0.3 : -0.1), 0.2 * std::sin(0.11 * at);
  }
  r.residuals[7] = 0;
  r.jacobian.row(7).setZero();
  return r;
}

Result after(Result r) {
  OcvError({sigma_v, 0, 0}, weight_v).take_out(soc_of_rows(), r.residuals, r.prior, &r.jacobian, rows);
  return r;
}

/// Covariance of the error at two states of charge, as the header states the process.
double covariance(Eigen::Index a, Eigen::Index b) {
  return sigma_v * sigma_v * std::exp(-0.01 * std::abs(static_cast<double>(a - b)) / 0.1);
}

// The least sum of squares over the error is that of the residuals weighted by their marginal covariance.
TEST(OcvError, HasTheCostOfTheMarginalCovariance) {
  const Eigen::VectorXd soc = soc_of_rows();
  Eigen::MatrixXd to_rows = Eigen::MatrixXd::Zero(rows, hundredths), process(hundredths, hundredths);
  for (Eigen::Index k = 0; k < rows; ++k) {
    if (std::isnan(soc[k])) continue;
    const auto below = static_cast<Eigen::Index>(100 * soc[k]);
    const double above_part = 100 * soc[k] - static_cast<double>(below);
    to_rows(k, below) = 1 - above_part;
    to_rows(k, below + 1) = above_part;
  }
  for (Eigen::Index a = 0; a < hundredths; ++a) {
    for (Eigen::Index b = 0; b < hundredths; ++b) process(a, b) = covariance(a, b);
  }
  const Eigen::MatrixXd marginal =
      Eigen::MatrixXd::Identity(rows, rows) + to_rows * process * to_rows.transpose() / (weight_v * weight_v);
  const Eigen::VectorXd residuals = before().residuals;
  const double expected = residuals.dot(marginal.ldlt().solve(residuals));
  EXPECT_NEAR(after(before()).cost(), expected, 1e-9 * expected);
  EXPECT_LT(expected, 0.5 * residuals.squaredNorm());
}

TEST(OcvError, HasTheTotalDerivative) {
  Result moved = before();
  const Eigen::Vector2d by(0.01, -0.02);
  moved.residuals += moved.jacobian.topRows(rows) * by;
  const Result from = after(before()), to = after(moved);
  EXPECT_LT((to.residuals - from.residuals - from.jacobian.topRows(rows) * by).norm(), 1e-12);
  EXPECT_LT((to.prior - from.prior - from.jacobian.bottomRows(OcvError::nodes()) * by).norm(), 1e-12);
  EXPECT_GT(from.jacobian.bottomRows(OcvError::nodes()).norm(), 1e-3);
}

/// What is left of 20 mV over half a per cent of the state of charge.
double cost_of_a_bend(double at_soc, const OcvErrorPrior& prior) {
  const Eigen::VectorXd soc = Eigen::VectorXd::LinSpaced(rows, at_soc, at_soc + 0.01);
  Result r;
  r.residuals = Eigen::VectorXd::Zero(rows);
  r.residuals.tail(rows / 2).setConstant(0.02);
  OcvError(prior, weight_v).take_out(soc, r.residuals, r.prior, nullptr, rows);
  return r.cost();
}

// A slow run does not measure the last per cent before full, nor the first after empty.
TEST(OcvError, IsFreeInTheUnmeasuredEndsOnly) {
  const OcvErrorPrior measured{sigma_v, 0, 0}, full{sigma_v, 0, 0.03}, empty{sigma_v, 0.03, 0};
  EXPECT_LT(cost_of_a_bend(0.99, full), 0.5 * cost_of_a_bend(0.99, measured));
  EXPECT_LT(cost_of_a_bend(0, empty), 0.5 * cost_of_a_bend(0, measured));
  EXPECT_NEAR(cost_of_a_bend(0.99, empty), cost_of_a_bend(0.99, measured), 1e-9 * cost_of_a_bend(0.99, measured));
  EXPECT_NEAR(cost_of_a_bend(0.5, full), cost_of_a_bend(0.5, measured), 1e-9 * cost_of_a_bend(0.5, measured));
}

}  // namespace
}  // namespace bms::identification
