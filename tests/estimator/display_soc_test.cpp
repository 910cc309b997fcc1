#include "estimator/display_soc.hpp"

#include <cmath>

#include <gtest/gtest.h>

namespace bms::estimator {
namespace {

using Display = DisplaySoc<double>;

TEST(DisplaySoc, BeginsWithTheEstimate) { EXPECT_EQ(Display().update(0.63, 0, 1), 0.63); }

TEST(DisplaySoc, FollowsTheChargeAtOnce) {
  Display display;
  display.update(0.6, 0, 1);
  EXPECT_NEAR(display.update(0.55, -0.05, 60), 0.55, 1e-12);
}

TEST(DisplaySoc, ACorrectionIsNeverAJump) {
  Display display;
  double shown = display.update(0.6, 0, 1);
  for (int second = 1; second <= 3'600; ++second) {
    const double next = display.update(0.4, 0, 1);  // the filter has found 20 % less
    ASSERT_LE(std::abs(next - shown), 1.01 * Display::slow_rate_per_s);
    ASSERT_LE(next, shown);
    shown = next;
  }
  EXPECT_NEAR(shown, 0.4, 1e-12) << "in forty minutes";
}

TEST(DisplaySoc, NearEmptyItDoesNotPromise) {
  Display display;
  display.update(0.3, 0, 1);
  double shown = 1;
  for (int second = 0; second < 240; ++second) shown = display.update(0.02, 0, 1);
  EXPECT_NEAR(shown, 0.02, 0.09) << "20 % in four minutes";
  Display up;
  up.update(0.02, 0, 1);
  for (int second = 0; second < 240; ++second) shown = up.update(0.09, 0, 1);
  EXPECT_LT(shown, 0.045) << "and no haste upwards";
}

TEST(DisplaySoc, StaysBetweenEmptyAndFull) {
  Display display;
  display.update(0.99, 0, 1);
  EXPECT_LE(display.update(1.1, 0.2, 60), 1);
  EXPECT_GE(display.update(-0.1, -1.3, 60), 0);
}

}  // namespace
}  // namespace bms::estimator
