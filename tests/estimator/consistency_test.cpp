#include "estimator/consistency.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

namespace bms::estimator {
namespace {

constexpr double share = 1.0 / 1'800;  // one second

TEST(Consistency, ADeviationThatLastsIsFoundAsAMeanOverHalfAnHourWouldFindIt) {
  Consistency<double> monitor;
  const double expected_v2 = 0.010 * 0.010;
  int seconds = 0;
  while (!monitor.is_inconsistent(expected_v2, share)) {
    monitor.add(0.045, 0, share);
    ++seconds;
  }
  EXPECT_NEAR(seconds, -1'800 * std::log(1 - 2.0 / 3), 5) << "an exponential mean of 45 mV reaches 30 mV";
}

/// Seconds until a deviation is inconsistent whose readings are all wrong but one in `one_good_in`; 0: not in an hour.
int found_after_s(double deviation_v, int one_good_in) {
  Consistency<double> monitor;
  for (int k = 0; k < 3'600; ++k) {
    monitor.add(k % one_good_in == one_good_in - 1 ? 0 : deviation_v, 0, share);
    if (monitor.is_inconsistent(0.010 * 0.010, share)) return k;
  }
  return 0;
}

TEST(Consistency, AVoltageThatStaysFarOffForMinutesNeedNotWaitForTheMean) {
  EXPECT_NEAR(found_after_s(0.055, 10'000), 180, 2) << "the mean would need 24 min";
  EXPECT_GT(found_after_s(0.055, 100), 1'200) << "the voltage comes back: the mean decides";
}

TEST(Consistency, ACheckThatNothingSuspectedEndsAFarDeviation) {
  Consistency<double> monitor;
  for (int k = 0; k < 170; ++k) {
    monitor.add(0.055, 0, share);
    EXPECT_FALSE(monitor.is_inconsistent(0.010 * 0.010, share));
  }
  monitor.add(0, 0, share);  // is not even judged
  for (int k = 0; k < 20; ++k) {
    monitor.add(0.055, 0, share);
    EXPECT_FALSE(monitor.is_inconsistent(0.010 * 0.010, share));
  }
}

TEST(Consistency, ADeviationInsideItsSigmaIsNeverInconsistent) {
  Consistency<double> monitor;
  for (int k = 0; k < 100'000; ++k) {
    monitor.add(0.02, 0, share);
    EXPECT_FALSE(monitor.is_inconsistent(0.010 * 0.010, share));
  }
}

TEST(Consistency, OneWrongReadingIsNotEvenSuspect) {
  Consistency<double> monitor;
  for (int k = 0; k < 10; ++k) monitor.add(2, 0, share);
  EXPECT_FALSE(monitor.is_suspect());
}

TEST(Consistency, ALoadThatHasEndedStillExplainsADeviation) {
  Consistency<double> monitor;
  for (int k = 0; k < 1'800; ++k) {
    monitor.add(0.2, 0, share);
    EXPECT_FALSE(monitor.is_inconsistent(0.1 * 0.1, share)) << "under load 100 mV are expected";
  }
  EXPECT_FALSE(monitor.is_inconsistent(1e-4, share)) << "the first second of the rest";
}

TEST(Consistency, AnOverpotentialCountsForHalfAnHourAfterItsLoad) {
  Consistency<double> monitor;
  for (int k = 0; k < 7'200; ++k) monitor.add(0, 0.1, share);
  EXPECT_NEAR(monitor.overpotential_v2(), 0.01, 4e-4);
  for (int k = 0; k < 1'800; ++k) monitor.add(0, 0, share);
  EXPECT_NEAR(std::sqrt(monitor.overpotential_v2()), 0.1 / std::exp(1.0), 2e-3);
}

TEST(Consistency, ALoadInBothDirectionsLeavesNoOverpotential) {
  Consistency<double> monitor;
  for (int k = 0; k < 7'200; ++k) monitor.add(0, k % 2 == 0 ? 0.1 : -0.1, share);
  EXPECT_LT(monitor.overpotential_v2(), 1e-6);
  EXPECT_NEAR(monitor.loads_v2(), 0.01, 2e-4) << "which counts where the time constants are unknown";
}

/// Seconds, from 1, whose samples are checked, and the time since the check before.
std::vector<std::pair<int, std::uint64_t>> checks(Consistency<double>& monitor, int seconds, bool every) {
  std::vector<std::pair<int, std::uint64_t>> which;
  for (int k = 1; k <= seconds; ++k) {
    const auto now_us = static_cast<std::uint64_t>(k) * 1'000'000;
    if (Consistency<double>::turn_ends(now_us - 1'000'000, now_us)) monitor.force_check();
    if (monitor.is_due(0.001)) which.emplace_back(k, monitor.begin(now_us, every));
  }
  return which;
}

/// A monitor that has seen a load switch every minute for some minutes; the overpotential's relative error is given,
/// and the mean deviation.
Consistency<double> after_minutes(int minutes, double relative_error, double mean_v) {
  Consistency<double> monitor;
  for (int k = 0; k < minutes; ++k) {
    const double overpotential_v = k % 2 == 0 ? -0.04 : 0;
    const double deviation_v = mean_v + relative_error * overpotential_v;
    monitor.add(deviation_v, overpotential_v, 60 * share);
    monitor.add_scatter(deviation_v, 60 * share);
  }
  return monitor;
}

TEST(Consistency, TheScatterIsThatOfTheTimeSinceTheStartAndNotTheMean) {
  for (const int minutes : {10, 30, 200}) {
    for (const double mean_v : {0.0, -0.1})
      EXPECT_NEAR(std::sqrt(after_minutes(minutes, 0.5, mean_v).scatter_v2()), 0.5 * 0.02, 0.001) << minutes;
  }
  EXPECT_EQ(Consistency<double>{}.scatter_v2(), 0);
}

TEST(Consistency, TheScatterUnderALoadShowsTheErrorOfTheOverpotential) {
  EXPECT_NEAR(std::sqrt(after_minutes(200, 0.5, -0.1).seen_error2(1e-8)), 0.5, 0.01);
  EXPECT_NEAR(std::sqrt(after_minutes(200, -2, 0).seen_error2(1e-8)), 2, 0.05);
  EXPECT_LT(after_minutes(200, 0, -0.1).seen_error2(1e-8), 1e-12);
  EXPECT_GT(std::sqrt(after_minutes(10, 0.5, -0.1).seen_error2(1e-8)), 0.5) << "half an hour of the load is not known";
}

TEST(Consistency, AScatterWithoutALoadIsNotThatOfAnOverpotential) {
  Consistency<double> rest;
  for (int k = 0; k < 100; ++k) rest.add_scatter(k % 2 == 0 ? 0.001 : -0.001, 60 * share);
  EXPECT_LT(rest.seen_error2(0.005 * 0.005), 0.05);
  EXPECT_EQ(Consistency<double>{}.seen_error2(0.005 * 0.005), 0);
}

TEST(Consistency, TheFirstSampleAndThenOneInAMinuteIsChecked) {
  Consistency<double> monitor;
  const std::vector<std::pair<int, std::uint64_t>> expected = {
      {1, 0}, {68, 67'000'000}, {135, 67'000'000}, {202, 67'000'000}};  // multiples of 67.1 s
  EXPECT_EQ(checks(monitor, 220, false), expected);
}

TEST(Consistency, EverySampleIsCheckedWhileThatIsAskedFor) {
  Consistency<double> monitor;
  EXPECT_EQ(checks(monitor, 40, true).size(), 40U);
}

TEST(Consistency, ASuspectVoltageInBetweenDoesNotMoveTheTurn) {
  Consistency<double> monitor;
  EXPECT_TRUE(monitor.is_due(0.001));
  EXPECT_EQ(monitor.begin(1'000'000, false), 0U);
  EXPECT_FALSE(monitor.is_due(0.001));
  EXPECT_TRUE(monitor.is_due(0.5));
  EXPECT_EQ(monitor.begin(2'000'000, false), 0U);
  monitor.force_check();
  EXPECT_EQ(monitor.begin(34'000'000, false), 33'000'000U);
}

TEST(Consistency, NotANumberIsChecked) {
  Consistency<double> monitor;
  monitor.begin(1'000'000, false);
  EXPECT_TRUE(monitor.is_due(std::nan("")));
}

TEST(Consistency, TheSampleAfterAContradictionIsChecked) {
  Consistency<double> monitor;
  monitor.begin(1'000'000, false);
  monitor.reset();
  EXPECT_TRUE(monitor.is_due(0));
}

}  // namespace
}  // namespace bms::estimator
