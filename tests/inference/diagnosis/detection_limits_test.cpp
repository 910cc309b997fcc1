#include "diagnosis/detection_limits.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/prepare.hpp"
#include "diagnosis/sensor_end.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr std::size_t offset = model::mechanism_index_of<model::VoltageOffset>,
                      leak = model::mechanism_index_of<model::Leakage>;

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

TEST(DetectionLimits, WhatWasTestedAndHasNoLimitIsNotVisible) {
  const std::vector<DetectionLimit> limits = limits_of({{offset, 0.001}, {leak, 10}}, leaves(0), 6, {});
  ASSERT_EQ(limits.size(), 1U) << "no cell leaks 60 A";
  Diagnosis d;
  d.verdict = Verdict::no_mismatch;
  d.limits = limits;
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    if (m != offset && m != leak) d.not_testable.push_back({m, "too short"});
  }
  EXPECT_THAT(not_visible(d), ElementsAre(leak));
  d.verdict = Verdict::data_fault;
  EXPECT_THAT(not_visible(d), IsEmpty());
}

TEST(DetectionLimits, WithHealthyRecordingsASizeStandsOutFromThem) {
  EXPECT_NEAR(limit_of_offset(0, [](std::size_t) { return 100.0; }), 0.001 * (10 + 1.28), 1e-6);
  EXPECT_NEAR(limit_of_offset(0, [](std::size_t) { return 1.0; }), 0.001 * (std::sqrt(26) + 1.28), 1e-6);
  EXPECT_EQ(limit_of_offset(0, [](std::size_t) { return std::nullopt; }), 0) << "nothing stands out";
}

TEST(DetectionLimits, BeyondTheBoundsNoneIsStated) {
  EXPECT_THAT(limits_of({{offset, 1.0}}, leaves(0), 6, {}), IsEmpty());
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
