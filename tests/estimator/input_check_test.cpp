#include "estimator/input_check.hpp"

#include <gtest/gtest.h>

namespace bms::estimator {
namespace {

constexpr model::PlausibleRange plausible{.voltage_min_uv = 1'500'000,
                                          .voltage_max_uv = 4'100'000,
                                          .current_max_ua = 60'000'000,
                                          .current_possible_ua = 500'000'000};

TEST(InputCheck, ReplacesAnImplausibleCurrentByTheLastAcceptedOne) {
  InputCheck<float> check;
  std::uint32_t flags = 0;
  EXPECT_EQ(check.current(-3'000'000, plausible, flags).ua, -3'000'000);
  EXPECT_EQ(flags, 0U);
  const AcceptedCurrent missing = check.current(measurement::no_reading, plausible, flags);
  EXPECT_EQ(missing.ua, -3'000'000);
  EXPECT_FALSE(missing.measured);
  EXPECT_EQ(flags, current_missing);
  flags = 0;
  EXPECT_FALSE(check.current(60'000'001, plausible, flags).measured);
  EXPECT_EQ(flags, current_implausible);
}

TEST(InputCheck, UsesACurrentBeyondTheLimitsThatLastsAndFlagsIt) {
  InputCheck<float> check;
  for (int k = 1; k <= 20; ++k) {
    std::uint32_t flags = 0;
    const AcceptedCurrent a = check.current(-90'000'000 + k, plausible, flags);
    EXPECT_EQ(a.measured, k >= 5);
    EXPECT_EQ(flags, k >= 5 ? current_beyond_limits : current_implausible);
    EXPECT_EQ(a.ua, k >= 5 ? -90'000'000 + k : 0);
  }
}

TEST(InputCheck, NeverUsesACurrentThatNoSuchCellCouldCarry) {
  InputCheck<float> check;
  for (int k = 1; k <= 20; ++k) {
    std::uint32_t flags = 0;
    EXPECT_FALSE(check.current(-500'000'001 - k, plausible, flags).measured);
    EXPECT_EQ(flags, current_implausible);
  }
}

TEST(InputCheck, SpikesOfEitherSignOrBetweenGoodReadingsDoNotLast) {
  InputCheck<float> check;
  for (int k = 0; k < 20; ++k) {
    std::uint32_t flags = 0;
    EXPECT_FALSE(check.current(k % 2 == 0 ? 90'000'000 : -90'000'000, plausible, flags).measured);
    if (k % 3 == 0) {
      EXPECT_TRUE(check.current(1'000'000, plausible, flags).measured);
    }
  }
}

TEST(InputCheck, DistinguishesAMissingVoltageFromAnImplausibleOne) {
  InputCheck<float> check;
  std::uint32_t flags = 0;
  EXPECT_FALSE(check.voltage_usable(measurement::no_reading, 3.3F, plausible, flags));
  EXPECT_EQ(flags, voltage_missing);
  flags = 0;
  EXPECT_FALSE(check.voltage_usable(0, 3.3F, plausible, flags));
  EXPECT_FALSE(check.voltage_usable(5'000'000, 3.3F, plausible, flags));
  EXPECT_EQ(flags, voltage_implausible);
}

TEST(InputCheck, AVoltageIsStuckWhenTheModelMovesAndItDoesNotAndIsAcceptedAgainWhenItChanges) {
  InputCheck<float> check;
  std::uint32_t flags = 0;
  for (int k = 0; k <= 5; ++k) EXPECT_TRUE(check.voltage_usable(3'300'000, 3.3F, plausible, flags));
  EXPECT_TRUE(check.voltage_usable(3'300'000, 3.31F, plausible, flags)) << "10 mV are not yet a reason";
  EXPECT_EQ(flags, 0U);
  EXPECT_FALSE(check.voltage_usable(3'300'000, 3.35F, plausible, flags));
  EXPECT_EQ(flags, voltage_stuck);
  EXPECT_FALSE(check.voltage_usable(3'300'000, 3.3F, plausible, flags))
      << "a model that comes back to it proves nothing";
  flags = 0;
  EXPECT_TRUE(check.voltage_usable(3'301'000, 3.35F, plausible, flags));
  EXPECT_EQ(flags, 0U);
}

TEST(InputCheck, ARestingCellMayReadTheSameForHours) {
  InputCheck<float> check;
  std::uint32_t flags = 0;
  for (int k = 0; k < 10'000; ++k) ASSERT_TRUE(check.voltage_usable(3'320'000, 3.3195F, plausible, flags));
}

TEST(InputCheck, AGapIsAStepTenTimesTheUsual) {
  InputCheck<float> check;
  std::uint32_t flags = 0;
  EXPECT_FALSE(check.gap(1'000'000, flags)) << "the first step has nothing to be compared with";
  EXPECT_FALSE(check.gap(10'000'000, flags));
  EXPECT_TRUE(check.gap(101'000'000, flags));
  EXPECT_EQ(flags, time_gap);
}

}  // namespace
}  // namespace bms::estimator
