#include "estimator/current_at_rest.hpp"

#include <gtest/gtest.h>

namespace bms::estimator {
namespace {

constexpr model::RestingCurrent resting{80'000, 25'000};
constexpr std::uint64_t second_us = 1'000'000;

bool after(CurrentAtRest& r, int seconds, std::int32_t ua) {
  bool rests = false;
  for (int k = 0; k < seconds; ++k) rests = r.is_at_rest(ua, second_us, resting);
  return rests;
}

TEST(CurrentAtRest, ASmallReadingThatStaysForAMinuteRests) {
  CurrentAtRest r;
  EXPECT_FALSE(after(r, 60, 30'000));
  EXPECT_TRUE(r.is_at_rest(35'000, second_us, resting));
  EXPECT_TRUE(after(r, 1, -30'000 + 36'000));
}

TEST(CurrentAtRest, OneThatMovesOrIsTooLargeForAnOffsetDoesNot) {
  CurrentAtRest r;
  EXPECT_TRUE(after(r, 100, 30'000));
  EXPECT_FALSE(r.is_at_rest(56'000, second_us, resting)) << "more than an offset drifts";
  EXPECT_FALSE(after(r, 1'000, 56'000)) << "it was switched on";
  EXPECT_FALSE(after(r, 1'000, 30'000)) << "and reduced";
  EXPECT_FALSE(after(r, 1'000, 81'000));
  EXPECT_FALSE(after(r, 1'000, -81'000));
}

TEST(CurrentAtRest, AfterALoadTheMinuteStartsAgain) {
  CurrentAtRest r;
  EXPECT_TRUE(after(r, 100, 30'000));
  EXPECT_FALSE(after(r, 5, -4'000'000));
  EXPECT_FALSE(after(r, 60, 30'000));
  EXPECT_TRUE(after(r, 2, 30'000));
}

/// The end of a charge at constant voltage: by and by, 2 mA a second and less.
TEST(CurrentAtRest, ACurrentThatSlidesIntoTheRangeOfAnOffsetDoesNotRest) {
  CurrentAtRest r;
  EXPECT_FALSE(after(r, 100, 2'000'000));
  for (double a = 1; a > 0.002; a *= 0.998)
    ASSERT_FALSE(r.is_at_rest(static_cast<std::int32_t>(1e6 * a), second_us, resting)) << a;
  EXPECT_FALSE(after(r, 3'600, 2'000));
}

TEST(CurrentAtRest, AMissingReadingEndsIt) {
  CurrentAtRest r;
  EXPECT_TRUE(after(r, 100, 0));
  r.reset();
  EXPECT_FALSE(after(r, 60, 0));
}

TEST(CurrentAtRest, NoLengthOfARestOrAStepWrapsIt) {
  CurrentAtRest r;
  r.is_at_rest(0, second_us, resting);
  for (int k = 0; k < 100; ++k) ASSERT_TRUE(r.is_at_rest(0, std::uint64_t{1} << 63, resting));
  EXPECT_FALSE(r.is_at_rest(2'147'483'647, second_us, resting));
  EXPECT_FALSE(r.is_at_rest(-2'147'483'647 - 1, second_us, resting));
}

}  // namespace
}  // namespace bms::estimator
