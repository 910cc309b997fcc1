#include "diagnosis/noise.hpp"

#include <cmath>

#include <gmock/gmock.h>

#include "diagnosis/denoise_current.hpp"
#include "plant/random.hpp"

namespace bms::diagnosis {
namespace {

struct Drawn {
  std::vector<double> time_s;
  RowNoise rows;
  std::vector<char> usable;
  Columns residual;
};

/// Noise drawn from the model itself.
Drawn drawn(const NoiseModel& n, std::size_t samples, std::uint64_t seed) {
  plant::Random random(seed);
  Drawn d{{}, RowNoise(samples), std::vector<char>(samples, 1), Columns(static_cast<Eigen::Index>(samples), 1)};
  double fast = n.fast_v * random.normal(), slow = n.slow_v * random.normal(), t = 0;
  for (std::size_t k = 0; k < samples; ++k) {
    const double dt = k % 7 == 0 ? 3 : 1;
    t += dt;
    const double f = std::exp(-dt / n.fast_s), s = std::exp(-dt / n.slow_s);
    fast = f * fast + n.fast_v * std::sqrt(1 - f * f) * random.normal();
    slow = s * slow + n.slow_v * std::sqrt(1 - s * s) * random.normal();
    d.time_s.push_back(t);
    d.residual(static_cast<Eigen::Index>(k), 0) = fast + slow + n.white_v * random.normal();
  }
  return d;
}

TEST(Whitener, WhitensItsOwnNoise) {
  const NoiseModel n{.white_v = 0.001, .fast_v = 0.003, .fast_s = 60, .slow_v = 0.005, .slow_s = 3'600};
  Drawn d = drawn(n, 40'000, 1);
  d.usable[100] = 0;
  const Whitener whitener(n, d.time_s, d.rows, d.usable);
  whitener.whiten(d.residual);
  const Eigen::VectorXd w = d.residual.col(0);
  EXPECT_EQ(w[100], 0);
  EXPECT_EQ(whitener.used(), 39'999U);
  EXPECT_NEAR(w.squaredNorm() / 39'999, 1, 0.03);
  for (const Eigen::Index lag : {1, 10, 100, 1'000})
    EXPECT_NEAR(w.head(w.size() - lag).dot(w.tail(w.size() - lag)) / w.squaredNorm(), 0, 0.02) << lag;
}

TEST(Whitener, ASlowDriftIsWorthFewSamplesAndAStepMany) {
  const NoiseModel n;
  const std::size_t samples = 20'000;
  Drawn d = drawn(n, samples, 2);
  Columns columns(static_cast<Eigen::Index>(samples), 2);
  for (Eigen::Index k = 0; k < columns.rows(); ++k) {
    columns(k, 0) = 0.001;
    columns(k, 1) = k / 30 % 2 == 0 ? 0.001 : -0.001;
  }
  Whitener(n, d.time_s, d.rows, d.usable).whiten(columns);
  EXPECT_LT(columns.col(0).squaredNorm(), 30);
  EXPECT_GT(columns.col(1).squaredNorm(), 1'000);
}

TEST(Whitener, ALargeErrorCountsLittleWhereTheOcvIsSteep) {
  NoiseModel n;
  const std::size_t samples = 2'000;
  Drawn d = drawn(n, samples, 4);
  Columns jump = Columns::Zero(static_cast<Eigen::Index>(samples), 1);
  for (Eigen::Index k = 1'000; k < 2'000; ++k) jump(k, 0) = 0.02;
  Columns steep = jump;
  Whitener(n, d.time_s, d.rows, d.usable).whiten(jump);
  for (std::size_t k = 1'000; k < samples; ++k) d.rows.slow_v2[k] = 0.02 * 0.02;
  Whitener(n, d.time_s, d.rows, d.usable).whiten(steep);
  EXPECT_GT(jump.squaredNorm(), 100);
  EXPECT_LT(steep.squaredNorm(), 10);
}

TEST(WhiteNoise, IsMeasuredWhereTheCurrentIsConstant) {
  plant::Random random(3);
  std::vector<double> voltage_v, current_a;
  for (int k = 0; k < 5'000; ++k) {
    current_a.push_back(k % 50 < 25 ? 5 : -5);
    voltage_v.push_back(3.3 + 0.02 * current_a.back() + 0.0008 * random.normal());
  }
  EXPECT_NEAR(white_noise(voltage_v, current_a, 0.1, 0.01), 0.0008, 0.0001);
  EXPECT_EQ(white_noise(std::vector<double>(50, 3.3), std::vector<double>(50, 0.0), 0.1, 0.01), 0.01) << "too few";
  for (double& v : voltage_v) v = std::round(v / 0.01) * 0.01;
  EXPECT_GE(white_noise(voltage_v, current_a, 0.1, 0.01), 0.01 / std::sqrt(12.0))
      << "a quantised channel is no better than its step";
}

TEST(DenoiseCurrent, KeepsStepsAndRemovesNoise) {
  plant::Random random(4);
  std::vector<double> read_a, true_a;
  for (int k = 0; k < 4'000; ++k) {
    true_a.push_back(k % 400 < 200 ? 3 : 0);
    read_a.push_back(true_a.back() + 0.02 * random.normal());
  }
  EXPECT_NEAR(current_noise(read_a), 0.02, 0.005);
  const std::vector<double> denoised_a = denoise_current(read_a, 0.02);
  double before = 0, after = 0;
  for (std::size_t k = 0; k < read_a.size(); ++k) {
    before += std::pow(read_a[k] - true_a[k], 2);
    after += std::pow(denoised_a[k] - true_a[k], 2);
    ASSERT_NEAR(denoised_a[k], true_a[k], 0.09) << k;
  }
  EXPECT_LT(after, before / 10);
}

}  // namespace
}  // namespace bms::diagnosis
