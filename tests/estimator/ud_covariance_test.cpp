#include "estimator/ud_covariance.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "tests/estimator/eigen_covariance.hpp"

namespace bms::estimator {
namespace {

/// One step of a filter with N states, in numbers that every scalar represents exactly, so that only the algorithms are
/// compared.
template <std::size_t N>
struct Step {
  Step(std::mt19937& random, bool last_decays) {
    std::uniform_real_distribution<double> uniform(0, 1);
    for (std::size_t i = 0; i < N; ++i) {
      for (std::size_t j = i; j < N; ++j) {
        if (i != j)
          f[i][j] = std::round(1024 * (uniform(random) - 0.5)) / 8192;
        else
          f[i][j] = j + 1 == N && !last_decays ? 1.0 : std::round(1024 * (0.5 + 0.5 * uniform(random))) / 1024;
      }
      q[i] = std::ldexp(std::round(16 * (1 + uniform(random))), -28);
      h[i] = i == 0 ? 1.0 : std::round(64 * uniform(random)) / 64;
    }
  }

  std::array<std::array<double, N>, N> f{};
  std::array<double, N> q{}, h{};
  double r = std::ldexp(1, -20), innovation = 0.0625;
};

template <class S, std::size_t N>
UdCovariance<S, N> with_variances(const std::array<double, N>& variances) {
  typename UdCovariance<S, N>::Variances v{};
  for (std::size_t i = 0; i < N; ++i) v[i] = arithmetic::Variance<S>(variances[i]);
  UdCovariance<S, N> ud;
  ud.set_diagonal(v);
  return ud;
}

template <class S, std::size_t N>
void propagate(UdCovariance<S, N>& ud, const Step<N>& step) {
  typename UdCovariance<S, N>::Matrix f{};
  typename UdCovariance<S, N>::Variances q{};
  for (std::size_t i = 0; i < N; ++i) {
    for (std::size_t j = 0; j < N; ++j) f[i][j] = arithmetic::Coupling<S>(step.f[i][j]);
    q[i] = arithmetic::Variance<S>(step.q[i]);
  }
  ud.propagate(f, q);
}

template <class S, std::size_t N>
std::array<double, N> observe(UdCovariance<S, N>& ud, const Step<N>& step) {
  typename UdCovariance<S, N>::Row h{};
  for (std::size_t i = 0; i < N; ++i) h[i] = arithmetic::VoltagePerSoc<S>(step.h[i]);
  const auto correction = ud.observe(h, arithmetic::Variance<S>(step.r), arithmetic::Voltage<S>(step.innovation));
  std::array<double, N> plain{};
  for (std::size_t i = 0; i < N; ++i) plain[i] = arithmetic::as_double(correction[i]);
  return plain;
}

/// Against the textbook covariance in double: another algorithm for the same mathematics.
template <class S, std::size_t N>
void expect_agreement(double tolerance, int steps, bool last_decays = false) {
  std::mt19937 random(3);
  std::array<double, N> start{};
  for (std::size_t i = 0; i < N; ++i) start[i] = 1e-3 * (1 + static_cast<double>(i));
  auto ud = with_variances<S, N>(start);
  tests::EigenCovariance<double, N> reference;
  reference.set_diagonal(start);
  for (int k = 0; k < steps; ++k) {
    const Step<N> step(random, last_decays);
    propagate(ud, step);
    reference.propagate(step.f, step.q);
    if (k % 3 != 0) {
      const auto found = observe(ud, step), expected = reference.observe(step.h, step.r, step.innovation);
      for (std::size_t i = 0; i < N; ++i)
        ASSERT_NEAR(found[i], expected[i], tolerance * 10) << "state " << i << " in step " << k;
    }
    const auto p = ud.dense();
    const double scale = reference.dense().diagonal().maxCoeff();
    for (std::size_t i = 0; i < N; ++i) {
      for (std::size_t j = 0; j < N; ++j) {
        const double expected = reference.dense()(static_cast<int>(i), static_cast<int>(j));
        ASSERT_NEAR(p[i][j], expected, tolerance * scale) << i << "," << j << " in step " << k;
        ASSERT_EQ(p[i][j], p[j][i]);
      }
      ASSERT_GT(p[i][i], 0);
    }
  }
}

// the same filter for any number of states: a hysteresis or a second RC branch joins without a copy
TEST(UdCovariance, AgreesWithADenseJosephFilterForTwoStates) { expect_agreement<double, 2>(1e-11, 2'000); }
TEST(UdCovariance, AgreesWithADenseJosephFilterForThreeStates) { expect_agreement<double, 3>(1e-11, 2'000); }
TEST(UdCovariance, AgreesWithADenseJosephFilterForFiveStates) { expect_agreement<double, 5>(1e-10, 2'000); }
TEST(UdCovariance, AgreesWithADenseJosephFilterWhereTheLastStateDecays) {
  expect_agreement<double, 4>(1e-10, 2'000, true);
}
TEST(UdCovariance, AgreesInFloatToItsDigits) { expect_agreement<float, 2>(1e-4, 2'000); }
TEST(UdCovariance, AgreesInFixedPointToItsDigits) { expect_agreement<arithmetic::FixedPoint, 3>(1e-4, 2'000); }

/// States that nothing corrects for hours: their couplings would decay to subnormal numbers.
TEST(UdCovariance, CouplingsThatHaveDecayedAreNoSubnormalNumbersAndNoVarianceNoticesIt) {
  UdCovariance<float, 3> ud;
  tests::EigenCovariance<double, 3> reference;
  ud.set_diagonal({1e-4F, 1e-4F, 1e-2F});
  reference.set_diagonal({1e-4, 1e-4, 1e-2});
  ud.observe({1, 1, 0.25F}, 1e-6F, 0);
  reference.observe({1, 1, 0.25}, 1e-6, 0);
  const auto coupling = [&] { return ud.dense()[0][2]; };
  ASSERT_LT(coupling(), -1e-5);
  for (int k = 0; k < 400; ++k) {
    ud.propagate({{{0.875F, 0, 0}, {0, 0.9375F, 0}, {0, 0, 1}}}, {1e-10F, 1e-10F, 1e-10F});
    reference.propagate({{{0.875, 0, 0}, {0, 0.9375, 0}, {0, 0, 1}}}, {1e-10, 1e-10, 1e-10});
    for (std::size_t i = 0; i < 3; ++i) {
      const double expected = reference.dense()(static_cast<int>(i), static_cast<int>(i));
      ASSERT_NEAR(ud.dense()[i][i], expected, 1e-4 * expected) << i << " in step " << k;
    }
    if (k != 50) continue;
    ASSERT_NE(coupling(), 0);
  }
  EXPECT_LT(std::abs(coupling()), 1e-14);  // times the variance of 1e-2
  EXPECT_TRUE(coupling() == 0 || std::abs(coupling()) > 1e-16) << coupling();
}

TEST(UdCovariance, StaysPositiveWhereTheOrdinaryFormOfAFloatFilterDoesNot) {
  // a nearly noiseless measurement of one combination of two states, again and again: the classic way to lose a
  // covariance
  UdCovariance<float, 2> ud;
  tests::EigenCovariance<float, 2, tests::Form::plain> plain;
  ud.set_diagonal({1.0F, 1.0F});
  plain.set_diagonal({1.0F, 1.0F});
  bool plain_lost_it = false;
  for (int k = 0; k < 1'000; ++k) {
    ud.propagate({{{1.0F, 0.0F}, {0.0F, 1.0F}}}, {1e-12F, 1e-12F});
    ud.observe({1.0F, 1.0F + 1e-3F}, 1e-10F, 0.0F);
    plain.propagate({{{1.0F, 0.0F}, {0.0F, 1.0F}}}, {1e-12F, 1e-12F});
    plain.observe({1.0F, 1.0F + 1e-3F}, 1e-10F, 0.0F);
    plain_lost_it = plain_lost_it || Eigen::Matrix2d(plain.dense().cast<double>()).determinant() <= 0;
    const auto dense = ud.dense();
    ASSERT_GT(dense[0][0] * dense[1][1] - dense[0][1] * dense[1][0], 0) << "step " << k;
  }
  EXPECT_TRUE(plain_lost_it) << "the case is too easy to show anything";
}

}  // namespace
}  // namespace bms::estimator
