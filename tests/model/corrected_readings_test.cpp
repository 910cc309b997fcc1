#include "model/corrected_readings.hpp"

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace bms::model {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

struct Columns {
  std::vector<double> time_s, current_a, temperature_c;
};
Columns uneven(std::size_t rows, double shortest_s = 0) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0, 1);
  Columns c;
  double time_s = 100;
  for (std::size_t k = 0; k < rows; ++k) {
    c.time_s.push_back(time_s);
    if (k % 37 == 36)
      time_s += 40;
    else
      time_s += k % 11 == 10 ? shortest_s : 0.5 + uniform(random);
    c.current_a.push_back(10 * uniform(random) - 5);
    c.temperature_c.push_back(20 + 0.01 * time_s);
  }
  return c;
}

CorrectedReadings<double> corrected(const Columns& c, double delay_s, double lag_s) {
  return {c.time_s, c.current_a, c.temperature_c, delay_s, lag_s};
}

TEST(CorrectedReadings, WithNothingToUndoAreTheReadings) {
  const Columns c = uneven(200);
  const auto r = corrected(c, 0, 0);
  const CorrectedReadings<ceres::Jet<double, 1>> jets(c.time_s, c.current_a, c.temperature_c, {0, 0}, {0, 0});
  for (std::size_t k = 0; k < c.time_s.size(); ++k) {
    ASSERT_EQ(r.current(k), c.current_a[k]);
    ASSERT_EQ(r.temperature(k), c.temperature_c[k]);
    ASSERT_EQ(jets.current(k).a, c.current_a[k]);
    ASSERT_EQ(jets.temperature(k).a, c.temperature_c[k]);
  }
}

TEST(CorrectedReadings, ADelayOfWholeStepsMovesTheRows) {
  Columns c = uneven(100);
  for (std::size_t k = 0; k < 100; ++k) c.time_s[k] = static_cast<double>(k);
  const auto late = corrected(c, 3, 0), early = corrected(c, -2, 0);
  for (std::size_t k = 2; k < 97; ++k) {
    ASSERT_NEAR(late.current(k), c.current_a[k + 3], 1e-12);
    if (k > 3) {
      ASSERT_NEAR(early.current(k), c.current_a[k - 2], 1e-12);
    }
  }
  EXPECT_NEAR(late.current(99), c.current_a[99], 1e-12) << "after the end the last current goes on";
}

TEST(CorrectedReadings, APartOfAStepIsUndone) {
  Columns c = uneven(200);
  for (std::size_t k = 0; k < 200; ++k) c.time_s[k] = static_cast<double>(k);
  for (const double part : {0.3, -0.2}) {
    for (const double whole : {0.0, 2.0, -3.0}) {
      // a channel that is late: each reading has a part of the interval before (early: after) in it
      Columns late = c;
      for (std::size_t k = 10; k < 190; ++k) {
        const std::size_t from = k - static_cast<std::size_t>(static_cast<int>(whole) + 3) + 3;
        late.current_a[k] =
            (1 - std::abs(part)) * c.current_a[from] + std::abs(part) * c.current_a[part > 0 ? from - 1 : from + 1];
      }
      const auto r = corrected(late, whole + part, 0);
      for (std::size_t k = 60; k < 140; ++k)
        ASSERT_NEAR(r.current(k), c.current_a[k], 1e-6) << k << " " << whole << " " << part;
    }
  }
}

TEST(CorrectedReadings, MoveChargeAndLoseNone) {
  Columns c = uneven(500);
  for (std::size_t k = 0; k < 500; ++k) c.time_s[k] = static_cast<double>(k + 40 * (k / 37));
  for (const double delay_s : {-7.3, 0.4, 11.0}) {
    const auto r = corrected(c, delay_s, 0);
    double by = 0, read = 0;
    for (std::size_t k = 1; k < 500; ++k) {
      const double duration_s = c.time_s[k] - c.time_s[k - 1];
      by += r.current(k) * duration_s;
      read += c.current_a[k] * duration_s;
    }
    EXPECT_NEAR(by, read, 5 * std::abs(delay_s) * 2) << "but for what the ends do not show";
  }
}

TEST(CorrectedReadings, DerivativeByTheDelayIsADifferenceQuotient) {
  using Jet = ceres::Jet<double, 2>;
  const Columns c = uneven(300, 0.9);
  for (const double delay_s : {0.11, 0.27, -4.2}) {
    const CorrectedReadings<Jet> jets(c.time_s, c.current_a, c.temperature_c, Jet(delay_s, 0), Jet(120, 1));
    const auto more = corrected(c, delay_s + 1e-6, 120), less = corrected(c, delay_s - 1e-6, 120);
    for (std::size_t k = 1; k < 300; ++k) {
      ASSERT_NEAR(jets.current(k).v[0], (more.current(k) - less.current(k)) / 2e-6, 1e-5) << k << " " << delay_s;
      ASSERT_NEAR(jets.temperature(k).v[1],
                  corrected(c, delay_s, 121).temperature(k) - corrected(c, delay_s, 120).temperature(k), 1e-9);
    }
  }
}

TEST(CorrectedReadings, ALagOfARampIsUndone) {
  Columns c = uneven(300);
  for (std::size_t k = 0; k < 300; ++k)
    c.temperature_c[k] = 20 + 0.01 * (c.time_s[k] - 80);  // what a sensor with a lag of 80 s reads
  const auto r = corrected(c, 0, 80);
  for (std::size_t k = 0; k < 300; ++k) ASSERT_NEAR(r.temperature(k), 20 + 0.01 * c.time_s[k], 1e-7) << k;
}

TEST(CorrectedReadings, AMissingReadingIsTheLastOneKnown) {
  const std::vector<double> time_s = {0, 1, 2, 3}, current_a = {nan, 2, nan, 4}, temperature_c = {nan, 31, nan, 33};
  const CorrectedReadings<double> r(time_s, current_a, temperature_c, 0, 0), none(time_s, current_a, {}, 0, 100);
  EXPECT_EQ(r.current(0), 0);
  EXPECT_EQ(r.current(2), 2);
  EXPECT_EQ(r.temperature(0), 25);
  EXPECT_EQ(r.temperature(2), 31);
  EXPECT_EQ(none.temperature(3), 25);
}

}  // namespace
}  // namespace bms::model
