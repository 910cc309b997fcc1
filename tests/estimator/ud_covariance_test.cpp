#include "estimator/ud_covariance.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

namespace bms::estimator {
namespace {

/// The textbook filter, dense and in Joseph form, in double: another algorithm for the same mathematics.
template <int N>
struct DenseCovariance {
  using Matrix = Eigen::Matrix<double, N, N>;
  using Vector = Eigen::Matrix<double, N, 1>;
  Matrix p;

  void propagate(const Matrix& f, const Vector& q) { p = f * p * f.transpose() + Matrix(q.asDiagonal()); }
  Vector observe(const Vector& h, double r) {
    const Vector k = p * h / (h.dot(p * h) + r);
    const Matrix a = Matrix::Identity() - k * h.transpose();
    p = a * p * a.transpose() + k * r * k.transpose();
    return k;
  }
};

template <class S, std::size_t N>
void expect_agreement(double tolerance, int steps, bool last_decays = false) {
  constexpr int n = static_cast<int>(N);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0, 1);
  UdCovariance<S, N> ud;
  DenseCovariance<n> dense;
  typename UdCovariance<S, N>::Variances start;
  dense.p.setZero();
  for (std::size_t i = 0; i < N; ++i) {
    const double variance = 1e-3 * (1 + static_cast<double>(i));
    start[i] = arithmetic::Variance<S>(variance);
    dense.p(static_cast<int>(i), static_cast<int>(i)) = variance;
  }
  ud.set_diagonal(start);

  for (int step = 0; step < steps; ++step) {
    typename UdCovariance<S, N>::Matrix f{};
    typename DenseCovariance<n>::Matrix f_dense = DenseCovariance<n>::Matrix::Zero();
    typename UdCovariance<S, N>::Variances q{};
    typename DenseCovariance<n>::Vector q_dense, h_dense;
    typename UdCovariance<S, N>::Row h{};
    for (std::size_t i = 0; i < N; ++i) {
      for (std::size_t j = i; j < N; ++j) {
        // exactly representable in every scalar, so that only the algorithm is compared
        const double entry =
            i == j ? (j + 1 == N && !last_decays ? 1.0 : std::round(1024 * (0.5 + 0.5 * uniform(random))) / 1024)
                   : std::round(1024 * (uniform(random) - 0.5)) / 8192;
        f[i][j] = arithmetic::Coupling<S>(entry);
        f_dense(static_cast<int>(i), static_cast<int>(j)) = entry;
      }
      const double noise = std::ldexp(std::round(16 * (1 + uniform(random))), -28),
                   sensitivity = i == 0 ? 1.0 : std::round(64 * uniform(random)) / 64;
      q[i] = arithmetic::Variance<S>(noise);
      q_dense(static_cast<int>(i)) = noise;
      h[i] = arithmetic::VoltagePerSoc<S>(sensitivity);
      h_dense(static_cast<int>(i)) = sensitivity;
    }
    const double r = std::ldexp(1, -20);
    ud.propagate(f, q);
    dense.propagate(f_dense, q_dense);
    if (step % 3 != 0) {
      const double innovation = 0.0625;
      const auto correction = ud.observe(h, arithmetic::Variance<S>(r), arithmetic::Voltage<S>(innovation));
      const auto gain = dense.observe(h_dense, r);
      for (std::size_t i = 0; i < N; ++i) {
        ASSERT_NEAR(arithmetic::as_double(correction[i]), gain(static_cast<int>(i)) * innovation, tolerance * 10)
            << "state " << i << " in step " << step;
      }
    }
    const auto p = ud.dense();
    const double scale = dense.p.diagonal().maxCoeff();
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        const auto row = static_cast<std::size_t>(i), column = static_cast<std::size_t>(j);
        ASSERT_NEAR(p[row][column], dense.p(i, j), tolerance * scale) << i << "," << j << " in step " << step;
        ASSERT_EQ(p[row][column], p[column][row]);
      }
      ASSERT_GT(p[static_cast<std::size_t>(i)][static_cast<std::size_t>(i)], 0);
    }
  }
}

// the same filter for any number of states: a hysteresis or a second RC joins without a copy
TEST(UdCovariance, AgreesWithADenseJosephFilterForTwoStates) { expect_agreement<double, 2>(1e-11, 2'000); }
TEST(UdCovariance, AgreesWithADenseJosephFilterForThreeStates) { expect_agreement<double, 3>(1e-11, 2'000); }
TEST(UdCovariance, AgreesWithADenseJosephFilterForFiveStates) { expect_agreement<double, 5>(1e-10, 2'000); }
TEST(UdCovariance, AgreesWithADenseJosephFilterWhereTheLastStateDecays) {
  expect_agreement<double, 4>(1e-10, 2'000, true);
}
TEST(UdCovariance, AgreesInFloatToItsDigits) { expect_agreement<float, 2>(1e-4, 2'000); }
TEST(UdCovariance, AgreesInFixedPointToItsDigits) { expect_agreement<arithmetic::FixedPoint, 3>(1e-4, 2'000); }

TEST(UdCovariance, StaysPositiveWhereTheOrdinaryFormOfAFloatFilterDoesNot) {
  // a nearly noiseless measurement of one combination of two states, again and again: the classic way to lose a
  // covariance
  UdCovariance<float, 2> ud;
  ud.set_diagonal({1.0F, 1.0F});
  Eigen::Matrix2f p = Eigen::Matrix2f::Identity();
  const Eigen::Vector2f h(1.0F, 1.0F + 1e-3F);
  bool ordinary_lost_it = false;
  for (int k = 0; k < 1'000; ++k) {
    ud.propagate({{{1.0F, 0.0F}, {0.0F, 1.0F}}}, {1e-12F, 1e-12F});
    ud.observe({1.0F, 1.0F + 1e-3F}, 1e-10F, 0.0F);
    p += 1e-12F * Eigen::Matrix2f::Identity();
    const Eigen::Vector2f gain = p * h / (h.dot(p * h) + 1e-10F);
    p = (p - gain * h.transpose() * p).eval();
    ordinary_lost_it = ordinary_lost_it || Eigen::Matrix2d(p.cast<double>()).determinant() <= 0;
    const auto dense = ud.dense();
    ASSERT_GT(dense[0][0] * dense[1][1] - dense[0][1] * dense[1][0], 0) << "step " << k;
  }
  EXPECT_TRUE(ordinary_lost_it) << "the case is too easy to show anything";
}

}  // namespace
}  // namespace bms::estimator
