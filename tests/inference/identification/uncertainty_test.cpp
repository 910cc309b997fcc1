#include "identification/uncertainty.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include <Eigen/Dense>

#include "identification/residuals.hpp"

namespace bms::identification {
namespace {

/// Autoregressive noise with a lag-one correlation of `fading` and unit variance.
Eigen::VectorXd coloured(std::mt19937_64& random, Eigen::Index n, double fading) {
  std::normal_distribution<double> normal;
  Eigen::VectorXd e(n);
  double state = normal(random);
  for (Eigen::Index k = 0; k < n; ++k) {
    state = fading * state + std::sqrt(1 - fading * fading) * normal(random);
    e[k] = state;
  }
  return e;
}

struct Coverage {
  double coloured = 0,
         white = 0;  ///< fraction of draws with the truth within two sigma, mean of both parameters
};

/// Many draws of a linear regression with a known result.
Coverage coverage(double fading) {
  constexpr Eigen::Index n = 3'000;
  constexpr int draws = 400;
  Eigen::MatrixXd jacobian(n, 2);
  for (Eigen::Index k = 0; k < n; ++k)
    jacobian.row(k) << 1e-3 * std::sin(0.01 * static_cast<double>(k)), 1e3 * (k / 300 % 2 == 0 ? 1.0 : -0.5);
  std::mt19937_64 random(5);
  Coverage c;
  for (int draw = 0; draw < draws; ++draw) {
    const Eigen::VectorXd noise = coloured(random, n, fading);
    const Eigen::VectorXd off = jacobian.colPivHouseholderQr().solve(noise);
    const Uncertainty u = uncertainty(noise - jacobian * off, jacobian, n, Eigen::VectorXi::Zero(2), 0);
    for (Eigen::Index k = 0; k < 2; ++k) {
      c.coloured += std::abs(off[k]) <= 2 * u.std(k) ? 0.5 / draws : 0;
      c.white += std::abs(off[k]) <= 2 * u.std_white(k) ? 0.5 / draws : 0;
    }
  }
  return c;
}

TEST(Uncertainty, OfWhiteResidualsIsThatOfTheTextbook) {
  const Coverage c = coverage(0);
  EXPECT_NEAR(c.white, 0.954, 0.025);
  EXPECT_NEAR(c.coloured, 0.954, 0.03);
}

TEST(Uncertainty, OfCorrelatedResidualsCountsRunsWhereTheWhiteFormulaIsWrong) {
  const Coverage c = coverage(0.97);
  EXPECT_GT(c.coloured, 0.88);
  EXPECT_LT(c.coloured, 0.99);
  EXPECT_LT(c.white, 0.5);
}

TEST(Uncertainty, FindsTheParametersThatTheDataDoNotDetermine) {
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(100, 4);
  for (Eigen::Index k = 0; k < 100; ++k)
    jacobian.row(k) << std::sin(0.3 * static_cast<double>(k)), 0, static_cast<double>(k % 7),
        2 * static_cast<double>(k % 7);
  std::mt19937_64 random(1);
  const Eigen::VectorXd r = coloured(random, 100, 0);
  const Uncertainty u = uncertainty(r, jacobian, 100, Eigen::VectorXi::Zero(4), 0);
  EXPECT_EQ(u.identifiable[0], 1);
  EXPECT_EQ(u.identifiable[1], 0) << "no column";
  EXPECT_EQ(u.identifiable[2], 0) << "only together with the next";
  EXPECT_EQ(u.identifiable[3], 0);
  Eigen::VectorXi fixed = Eigen::VectorXi::Zero(4);
  fixed[3] = 1;
  const Uncertainty with_one_fixed = uncertainty(r, jacobian, 100, fixed, 0);
  EXPECT_EQ(with_one_fixed.identifiable[2], 1);
  EXPECT_EQ(with_one_fixed.std(3), 0);
}

TEST(Uncertainty, AConstantErrorMovesParametersWithAConstantEffect) {
  Eigen::MatrixXd jacobian(50, 2);
  for (Eigen::Index k = 0; k < 50; ++k) jacobian.row(k) << 4, k % 2 == 0 ? 1 : -1;
  const Uncertainty u = uncertainty(Eigen::VectorXd::Constant(50, 1e-9), jacobian, 50, Eigen::VectorXi::Zero(2), 0.002);
  EXPECT_NEAR(u.offset[0], 0.0005, 1e-12);
  EXPECT_NEAR(u.offset[1], 0, 1e-12);
}

TEST(Residuals, DistinguishWhiteNoiseColouredNoiseAndBias) {
  std::mt19937_64 random(2);
  const Eigen::VectorXd current = coloured(random, 4'000, 0.9), white = coloured(random, 4'000, 0),
                        slow = coloured(random, 4'000, 0.95);
  const ResidualAnalysis of_white = analyse(white, current), of_slow = analyse(slow, current);
  EXPECT_LT(of_white.autocorrelated, 0.2);
  EXPECT_GT(of_slow.autocorrelated, 0.9);
  EXPECT_NEAR(of_slow.autocorrelation[0], 0.95, 0.02);
  EXPECT_NEAR(of_slow.correlation_length, 39, 15);  // (1 + 0.95) / (1 - 0.95)
  EXPECT_FALSE(of_white.biased());
  EXPECT_TRUE(analyse((white.array() + 0.2).matrix(), current).biased());
  Eigen::VectorXd driven = white;
  driven.tail(3'999) += 0.5 * current.head(3'999);
  EXPECT_GT(analyse(driven, current).input_correlated, 0.5);
  EXPECT_LT(of_white.input_correlated, 0.3);
}

TEST(Residuals, PredictionUsesTheLastError) {
  std::mt19937_64 random(4);
  const Eigen::VectorXd slow = coloured(random, 20'000, 0.9);
  const double f = fading(slow);
  EXPECT_NEAR(f, 0.9, 0.02);
  const auto rms = [](const Eigen::VectorXd& e) { return std::sqrt(e.squaredNorm() / static_cast<double>(e.size())); };
  EXPECT_NEAR(rms(prediction_error(slow, 1, f)), std::sqrt(1 - 0.81), 0.02);
  EXPECT_NEAR(rms(prediction_error(slow, 5, f)), std::sqrt(1 - std::pow(0.9, 10)), 0.03);
}

// A column of the unmodelled is one standard deviation of something that moves the parameters.
TEST(Uncertainty, IncludesWhatTheModelLacks) {
  Eigen::MatrixXd jacobian(4, 2), unmodelled(4, 1);
  jacobian << 2, 0, 2, 0, 0, 5, 0, 5;
  unmodelled << 0.3, 0.3, 0.1, 0.4;
  const Eigen::VectorXd residuals = Eigen::Vector4d(0.01, -0.01, 0.01, -0.01);
  const Eigen::VectorXi free = Eigen::VectorXi::Zero(2);
  const Uncertainty without = uncertainty(residuals, jacobian, 4, free, 0),
                    with = uncertainty(residuals, jacobian, 4, free, 0, unmodelled);
  EXPECT_NEAR(with.covariance(0, 0) - without.covariance(0, 0), 0.15 * 0.15, 1e-12);
  EXPECT_NEAR(with.covariance(1, 1) - without.covariance(1, 1), 0.05 * 0.05, 1e-12);
  EXPECT_NEAR(with.covariance(0, 1) - without.covariance(0, 1), 0.15 * 0.05, 1e-12);
}

}  // namespace
}  // namespace bms::identification
