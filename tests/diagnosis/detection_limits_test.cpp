#include "diagnosis/detection_limits.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/predicted_band.hpp"
#include "diagnosis/prepare.hpp"
#include "diagnosis/sensor_end.hpp"
#include "tests/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

using ::testing::IsEmpty;

constexpr std::size_t offset = model::mechanism_index_of<model::VoltageOffset>;

ResidualTest leaves(double gain) {
  ResidualTest left;
  left.gain = gain;
  return left;
}

double limit_of_offset(double left, const HealthyGain& healthy = {}) {
  const std::vector<DetectionLimit> limits = limits_of({{offset, 0.001}}, leaves(left), 6, healthy);
  return limits.empty() ? 0 : limits.front().value;
}

TEST(DetectionLimits, AskForWhatTheDecisionAsksFor) {
  EXPECT_NEAR(limit_of_offset(0), 0.001 * (std::sqrt(26) + 1.28), 1e-6);
  EXPECT_NEAR(limit_of_offset(10), 0.001 * (std::sqrt(40) + 1.28), 1e-6) << "four fifths of the misfit";
  EXPECT_NEAR(limit_of_offset(1e4), 0.001 * (std::sqrt(52) + 1.28), 1e-6) << "not faint any more";
}

TEST(DetectionLimits, WithHealthyRecordingsASizeStandsOutFromThem) {
  EXPECT_NEAR(limit_of_offset(0, [](std::size_t) { return 100.0; }), 0.001 * (10 + 1.28), 1e-6);
  EXPECT_NEAR(limit_of_offset(0, [](std::size_t) { return 1.0; }), 0.001 * (std::sqrt(26) + 1.28), 1e-6);
  EXPECT_EQ(limit_of_offset(0, [](std::size_t) { return std::nullopt; }), 0) << "nothing stands out";
}

TEST(DetectionLimits, BeyondTheBoundsNoneIsStated) {
  EXPECT_THAT(limits_of({{offset, 1.0}}, leaves(0), 6, {}), IsEmpty());
}

TEST(PredictedBand, HoldsAHealthyRecordingAndNotAWrongVoltage) {
  const auto share_within = [](double add_v, const measurement::HealthyData& healthy = {}) {
    const PreparedRecording r = test::recorded(test::drive(1, 21), 0.7, 21, [&](auto...) { return add_v; });
    const LikelihoodModel likelihood = likelihood_model_of(test::table9(), {}, {r});
    const std::vector<double> sigma_v = predicted_sigma_v(likelihood, 0, healthy),
                              file_v = likelihood.voltage(likelihood.base(), likelihood.unchanged(), 0);
    double within = 0;
    for (std::size_t k = 0; k < r.size(); ++k)
      within += std::abs(r.voltage_v[k] - file_v[k]) <= 1.96 * sigma_v[k] ? 1 : 0;
    return within / static_cast<double>(r.size());
  };
  EXPECT_GT(share_within(0), 0.9);
  EXPECT_LT(share_within(0.05), 0.2);
  measurement::HealthyData healthy;
  healthy.regimes = {{"soc", 0, 1, 2, 0, 0.05, 0.01, 2, 0.05}};
  EXPECT_GT(share_within(0.05, healthy), 0.9) << "healthy recordings were as wrong";
}

/// The band's standard deviation in a discharge from 70 to 66 %, and that of the cell file alone [V].
std::array<double, 2> band_and_file_v(const measurement::HealthyData& healthy) {
  std::vector<double> current_a(200, 0.0);
  current_a.resize(400, -6.0);
  const LikelihoodModel likelihood = likelihood_model_of(test::table9(), {}, {test::recorded(current_a, 0.7, 21)});
  return {predicted_sigma_v(likelihood, 0, healthy)[350], predicted_sigma_v(likelihood, 0)[350]};
}

measurement::HealthyBlock up_to(double current_a) {
  measurement::HealthyBlock block;
  block.current_a = {-current_a, 0};
  return block;
}

TEST(PredictedBand, WeighsHealthyRecordingsAgainstTheCellFile) {
  measurement::HealthyData healthy;
  healthy.regimes = {{"soc", 0.6, 0.8, 1, 0, 0.02, 0, 3, 0.03}};
  const auto [band_v, file_v] = band_and_file_v(healthy);
  // two of three predicted the third: 1 + 1/2 of a recording's variance; three predict the next one: 1 + 1/3
  const double of_three_v2 = 0.03 * 0.03 * (1 + 1.0 / 3) / (1 + 1.0 / 2);
  EXPECT_NEAR(band_v, std::sqrt((file_v * file_v + 3 * of_three_v2) / 4), 1e-9) << "three recordings and the file";
  healthy.regimes = {{"soc", 0.6, 0.8, 1, 0, 0.02, 0, 1, 0.03}};
  EXPECT_NEAR(band_and_file_v(healthy)[0], std::sqrt((file_v * file_v + 0.03 * 0.03) / 2), 1e-9);
}

TEST(PredictedBand, IsWiderWhereNoHealthyRecordingWas) {
  measurement::HealthyData healthy;
  healthy.regimes = {{"soc", 0, 0.5, 1, 0, 0.02, 0, 3, 0.03}};
  healthy.beyond_tolerance_v = 0.01;
  const auto [band_v, file_v] = band_and_file_v(healthy);
  EXPECT_NEAR(band_v, std::hypot(1.5 * file_v, 0.01), 1e-9) << "they were below 50 %";
  healthy.regimes = {{"soc", 0, 1, 1, 0, 0, 0, 3, 0}};
  healthy.blocks = {up_to(5)};
  EXPECT_NEAR(band_and_file_v(healthy)[0], file_v / 2, 1e-9) << "6 A is near 5 A";
  healthy.blocks = {up_to(4)};
  EXPECT_NEAR(band_and_file_v(healthy)[0], std::hypot(1.5 * file_v, 0.01), 1e-9) << "6 A is far from 4 A";
}

/// Rows of a drive whose current differs from row to row.
std::vector<double> restless(std::size_t rows, std::uint64_t seed) {
  plant::Random random(seed);
  std::vector<double> current_a;
  for (std::size_t k = 0; k < rows; ++k) {
    constexpr std::array phases_a = {-9.0, 0.0, 6.0};
    const double base_a = phases_a[k / 100 % phases_a.size()];
    current_a.push_back(base_a == 0 ? 0 : base_a + 3 * random.normal());
  }
  return current_a;
}

PreparedRecording clipped(PreparedRecording r, double end_a) {
  for (double& a : r.current_a.edit()) a = std::clamp(a, -end_a, end_a);
  return r;
}

TEST(SensorEnd, StandsWhileTheVoltageGoesOnMoving) {
  const PreparedRecording r = test::recorded(restless(3'000, 5), 0.7, 5);
  const SensorEnd end = sensor_end(clipped(r, 9), 0.06, 0.001);
  EXPECT_EQ(end.limit_a, 9);
  EXPECT_NEAR(end.spread_v, 0.013 * 2, 0.014) << "some amperes through R0";
  EXPECT_TRUE(end.holds(-9));
  EXPECT_FALSE(end.holds(8.9));
  EXPECT_FALSE(sensor_end(r, 0.06, 0.001).holds(15)) << "each largest reading comes once";
}

TEST(SensorEnd, IsNotAConstantCurrent) {
  std::vector<double> current_a(1'500, -6.0);
  std::fill(current_a.begin(), current_a.begin() + 300, 0.0);
  const PreparedRecording r = clipped(test::recorded(current_a, 0.9, 6), 6);
  EXPECT_EQ(sensor_end(r, 0.06, 0.001).spread_v, 0);
}

TEST(SensorEnd, AClippedCurrentIsNamedThoughItsExcessDiffers) {
  const PreparedRecording r = clipped(test::recorded(restless(4'000, 7), 0.7, 7), 10);
  const Diagnosis d = diagnose(test::table9(), {}, {r});
  ASSERT_FALSE(d.findings.empty()) << name_of(d.verdict) << ": " << d.statement;
  EXPECT_TRUE(names(d.verdict)) << name_of(d.verdict) << ": " << d.statement;
  EXPECT_EQ(d.findings.front().setting.index, model::mechanism_index_of<model::CurrentClipping>);
}

}  // namespace
}  // namespace bms::diagnosis
