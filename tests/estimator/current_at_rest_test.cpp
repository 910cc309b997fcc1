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
  EXPECT_FALSE(after(r, 59, 56'000)) << "the minute starts again";
  EXPECT_TRUE(after(r, 2, 56'000));
  EXPECT_FALSE(after(r, 1'000, 81'000));
  EXPECT_FALSE(after(r, 1'000, -81'000));
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
