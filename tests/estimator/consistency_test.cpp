#include "estimator/consistency.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

namespace bms::estimator {
namespace {

constexpr double share = 1.0 / 1'800;  // one second

TEST(Consistency, ADeviationThatLastsIsFoundAsAMeanOverHalfAnHourWouldFindIt) {
  Consistency<double> monitor;
  const double expected_v2 = 0.010 * 0.010;
  int seconds = 0;
  while (!monitor.is_inconsistent(expected_v2, share)) {
    monitor.add(0.05, 0, share);
    ++seconds;
  }
  EXPECT_NEAR(seconds, -1'800 * std::log(1 - 0.6), 5) << "an exponential mean of 50 mV reaches 30 mV";
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
  for (int k = 0; k < 7'200; ++k) monitor.add(0, 0.01, share);
  EXPECT_NEAR(monitor.overpotential_v2(), 0.01, 2e-4);
  for (int k = 0; k < 1'800; ++k) monitor.add(0, 0, share);
  EXPECT_NEAR(monitor.overpotential_v2(), 0.01 / std::exp(1.0), 2e-4);
}

/// Numbers of the samples, from 1, that are checked in turn.
std::vector<int> due(Consistency<double>& monitor, int samples, std::uint32_t per_check) {
  std::vector<int> which;
  for (int k = 1; k <= samples; ++k) {
    if (monitor.is_due() && monitor.begin_turn(per_check)) which.push_back(k);
  }
  return which;
}

TEST(Consistency, TheFirstSampleAndThenOneInAsManyAsAskedForIsDue) {
  Consistency<double> monitor;
  EXPECT_EQ(due(monitor, 80, 37), (std::vector<int>{1, 38, 75}));
  EXPECT_EQ(due(monitor, 35, 1), (std::vector<int>{32, 33, 34, 35}));
}

TEST(Consistency, ASuspectVoltageInBetweenDoesNotMoveTheTurn) {
  Consistency<double> monitor;
  due(monitor, 10, 37);
  EXPECT_FALSE(monitor.begin_turn(37));
  EXPECT_EQ(due(monitor, 40, 37), (std::vector<int>{28}));
}

TEST(Consistency, TheSampleAfterAContradictionIsDue) {
  Consistency<double> monitor;
  due(monitor, 10, 37);
  monitor.reset();
  EXPECT_EQ(due(monitor, 3, 1), (std::vector<int>{1, 2, 3}));
}

}  // namespace
}  // namespace bms::estimator
