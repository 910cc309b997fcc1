#include "estimator/consistency.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace bms::estimator {
namespace {

constexpr double share = 1.0 / 1'800;  // one second

TEST(Consistency, ADeviationThatLastsIsFoundAsAMeanOverHalfAnHourWouldFindIt) {
  Consistency<double> monitor;
  const double expected_v2 = 0.010 * 0.010;
  int seconds = 0;
  while (!monitor.is_inconsistent(expected_v2, share)) {
    monitor.add(0.05, share);
    ++seconds;
  }
  EXPECT_NEAR(seconds, -1'800 * std::log(1 - 0.5), 5) << "an exponential mean of 50 mV reaches 25 mV";
}

TEST(Consistency, ADeviationInsideItsSigmaIsNeverInconsistent) {
  Consistency<double> monitor;
  for (int k = 0; k < 100'000; ++k) {
    monitor.add(0.02, share);
    EXPECT_FALSE(monitor.is_inconsistent(0.010 * 0.010, share));
  }
}

TEST(Consistency, OneWrongReadingIsNotEvenSuspect) {
  Consistency<double> monitor;
  for (int k = 0; k < 10; ++k) monitor.add(2, share);
  EXPECT_FALSE(monitor.is_suspect());
}

TEST(Consistency, ALoadThatHasEndedStillExplainsADeviation) {
  Consistency<double> monitor;
  for (int k = 0; k < 1'800; ++k) {
    monitor.add(0.2, share);
    EXPECT_FALSE(monitor.is_inconsistent(0.1 * 0.1, share)) << "under load 100 mV are expected";
  }
  EXPECT_FALSE(monitor.is_inconsistent(1e-4, share)) << "the first second of the rest";
}

TEST(Consistency, AnOverpotentialCountsForHalfAnHourAfterItsLoad) {
  Consistency<double> monitor;
  double v2 = 0;
  for (int k = 0; k < 7'200; ++k) v2 = monitor.lasting_overpotential_v2(0.1, share);
  EXPECT_NEAR(v2, 0.01, 2e-4);
  for (int k = 0; k < 1'800; ++k) v2 = monitor.lasting_overpotential_v2(0, share);
  EXPECT_NEAR(v2, 0.01 / std::exp(1.0), 2e-4);
  EXPECT_NEAR(monitor.lasting_overpotential_v2(0.3, share), 0.09, 1e-12) << "a larger one counts at once";
}

}  // namespace
}  // namespace bms::estimator
