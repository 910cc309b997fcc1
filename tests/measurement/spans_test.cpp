#include "measurement/spans.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace bms::measurement {
namespace {

std::vector<std::pair<std::size_t, std::size_t>> rows_below_1(const std::vector<double>& values) {
  std::vector<std::pair<std::size_t, std::size_t>> found;
  for (const Rows& rows : consecutive_rows(values.size(), [&](std::size_t k) { return values[k] < 1; }))
    found.emplace_back(rows.begin, rows.end);
  return found;
}

TEST(Spans, ConsecutiveRowsAreOneSpanUpToTheirLastRow) {
  using Found = std::vector<std::pair<std::size_t, std::size_t>>;
  EXPECT_EQ(rows_below_1({0, 0, 5, 0, 5, 5, 0, 0}), (Found{{0, 2}, {3, 4}, {6, 8}}));
  EXPECT_EQ(rows_below_1({5, 0, 0, 5}), (Found{{1, 3}}));
  EXPECT_EQ(rows_below_1({5, 5}), Found{});
  EXPECT_EQ(rows_below_1({}), Found{});
}

TEST(Spans, TimeStepsAreOneFewerThanRows) {
  EXPECT_EQ(time_steps(std::vector<double>{1, 2, 4, 4}), (std::vector<double>{1, 2, 0}));
  EXPECT_TRUE(time_steps(std::vector<double>{1}).empty());
}

TEST(Spans, AVoltageThatFollowsTheCurrentCorrelatesFully) {
  const std::vector<double> current_a = {0, 2, 2, -1}, voltage_v = {3, 3.2, 3.2, 2.9};
  const StepCorrelation c = step_correlation(current_a, voltage_v, 1);
  EXPECT_EQ(c.steps, 2u);
  EXPECT_EQ(c.opposed, 0u);
  EXPECT_NEAR(c.product, 2 * 0.2 + 3 * 0.3, 1e-12);
  EXPECT_NEAR(c.product, c.limit, 1e-12);
}

TEST(Spans, AnInvertedCurrentOpposesTheVoltageInEachStep) {
  const std::vector<double> current_a = {0, -2, -2, 1}, voltage_v = {3, 3.2, 3.2, 2.9};
  const StepCorrelation c = step_correlation(current_a, voltage_v, 1);
  EXPECT_EQ(c.opposed, 2u);
  EXPECT_NEAR(c.product, -c.limit, 1e-12);
}

TEST(Spans, SmallStepsAndMissingReadingsDoNotCount) {
  const double missing = std::nan("");
  const std::vector<double> current_a = {0, 0.5, 2, 5, missing, 0}, voltage_v = {3, 9, missing, 3, 3, 3};
  EXPECT_EQ(step_correlation(current_a, voltage_v, 1).steps, 0u);
  EXPECT_EQ(step_correlation(current_a, voltage_v, 0).steps, 1u);
}

}  // namespace
}  // namespace bms::measurement
