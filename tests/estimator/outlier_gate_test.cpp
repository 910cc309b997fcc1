#include "estimator/outlier_gate.hpp"

#include <gtest/gtest.h>

namespace bms::estimator {
namespace {

using Gate = OutlierGate<double>;

TEST(OutlierGate, RejectsWhatIsBeyondEightStandardDeviations) {
  EXPECT_FALSE(Gate::is_suspect(0.0799));
  EXPECT_TRUE(Gate::is_suspect(-0.0801)) << "eight times the smallest standard deviation of any model";
  EXPECT_FALSE(Gate::is_outlier(0.159, 0.02 * 0.02));
  EXPECT_TRUE(Gate::is_outlier(-0.161, 0.02 * 0.02));
}

}  // namespace
}  // namespace bms::estimator
