// The statistics of a depot against values from elsewhere: closed forms, a published example, simulation.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "fleet/statistics.hpp"

namespace bms::fleet {
namespace {

TEST(FalseAlarms, AgreeWithTheMomentsOfABetaBinomialDistribution) {
  const double mean = 0.02, correlation = 0.1;
  EXPECT_DOUBLE_EQ(false_alarm_probability(0, 5, mean, correlation), 1);
  EXPECT_NEAR(false_alarm_probability(1, 1, mean, correlation), mean, 1e-12);
  EXPECT_NEAR(false_alarm_probability(2, 2, mean, correlation), mean * (mean + (1 - mean) * correlation), 1e-12);
  double expected = 0;
  for (std::size_t k = 1; k <= 30; ++k) expected += false_alarm_probability(k, 30, mean, correlation);
  EXPECT_NEAR(expected, 30 * mean, 1e-9);  // the mean is the sum of the tails
}

TEST(FalseAlarms, OfOneCellCountLessThanThoseOfManyCells) {
  const double independent = 1 - std::pow(0.98, 20) - 20 * 0.02 * std::pow(0.98, 19);  // binomial
  EXPECT_GT(false_alarm_probability(2, 20, 0.02, 0.1), 1.4 * independent);
  EXPECT_LT(false_alarm_probability(8, 20, 0.014, 0.1), 3e-3);
}

TEST(FalseAlarms, InOrderOfTimeAreSeldomAboveTheirProbability) {
  std::mt19937 random(8);
  const double mean = 0.05, correlation = 0.05, sum = (1 - correlation) / correlation;
  std::gamma_distribution<double> a(mean * sum), b((1 - mean) * sum);
  int below = 0;
  for (int n = 0; n < 4'000; ++n) {
    const double x = a(random), rate = x / (x + b(random));
    std::bernoulli_distribution alarm(rate);
    std::vector<bool> happened;
    for (int d = 0; d < 25; ++d) happened.push_back(alarm(random));
    below += false_alarm_probability(happened, mean, correlation) < 0.01 ? 1 : 0;
  }
  EXPECT_LE(below, 60);
  EXPECT_GE(below, 2);
}

TEST(FalseDiscoveries, AreThoseOfThePublishedExample) {
  // Benjamini and Hochberg 1995, section 4: at a rate of 0.05 the first four of fifteen are accepted
  const std::vector<double> p = {0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344,
                                 0.0459, 0.3240, 0.4262, 0.5719, 0.6528, 0.7590, 1.0000};
  const std::vector<double> rates = false_discovery_rates(p, p.size());
  for (std::size_t k = 0; k < p.size(); ++k) EXPECT_EQ(rates[k] <= 0.05, k < 4) << k;
  EXPECT_NEAR(rates[3], 0.0095 * 15 / 4, 1e-12);
  // hypotheses that are not listed count as well
  EXPECT_GT(false_discovery_rates(p, 150)[3], 0.05);
}

std::vector<Reading> noisy(std::mt19937& random, int days, double sigma, double (*value)(double)) {
  std::normal_distribution<double> noise(0, sigma);
  std::vector<Reading> readings;
  for (int d = 0; d < days; ++d) readings.push_back({double(d), value(d) + noise(random), 0});
  return readings;
}

TEST(OnsetOfAChange, IsFoundWithinTwoDays) {
  std::mt19937 random(3);
  for (int n = 0; n < 50; ++n) {
    const auto readings = noisy(random, 25, 0.002, [](double day) { return 0.01 - 0.006 * std::max(0.0, day - 7); });
    const auto onset = onset_of(readings, 0.002);
    ASSERT_TRUE(onset);
    EXPECT_NEAR(onset->day, 8, 2);
    EXPECT_NEAR(onset->per_day, -0.006, 0.001);
    EXPECT_LT(onset->p_value, 1e-6);
  }
}

TEST(OnsetOfAChange, IsSeldomFoundInNoise) {
  std::mt19937 random(4);
  int found = 0;
  for (int n = 0; n < 400; ++n) {
    const auto onset = onset_of(noisy(random, 25, 0.002, [](double) { return 0.0; }), 0.002);
    found += onset && onset->p_value < 0.01 ? 1 : 0;
  }
  EXPECT_LE(found, 12);
}

TEST(OnsetOfAChange, IsNeitherHiddenNorMadeByOneBadDay) {
  std::mt19937 random(5);
  int made = 0;
  for (int n = 0; n < 200; ++n) {
    const std::size_t bad = n % 2 == 0 ? 24 : random() % 25;
    auto readings = noisy(random, 25, 0.002, [](double day) { return 0.01 - 0.002 * std::max(0.0, day - 10); });
    readings[bad].value += 0.04;
    const auto onset = onset_of(readings, 0.002);
    ASSERT_TRUE(onset);
    EXPECT_NEAR(onset->day, 11, 3) << bad;
    EXPECT_NEAR(onset->per_day, -0.002, 0.0006) << bad;
    EXPECT_LT(onset->p_value, 1e-4) << bad;
    auto constant = noisy(random, 25, 0.002, [](double) { return 0.0; });
    constant[bad].value += 0.04;
    const auto none = onset_of(constant, 0.002);
    made += none && none->p_value < 0.01 ? 1 : 0;
  }
  EXPECT_LE(made, 6);
}

TEST(Trend, CoversTheSlopeAndTheDayOfTheLimit) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 0.01);
  int covered = 0, crossings = 0;
  for (int n = 0; n < 200; ++n) {
    std::vector<Reading> readings;
    for (int d = 0; d < 30; ++d) readings.push_back({double(d), 0.1 + 0.004 * d + noise(random), 0.01});
    const auto trend = trend_of(readings);
    ASSERT_TRUE(trend);
    covered += std::abs(trend->per_day - 0.004) < 2 * trend->per_day_sigma ? 1 : 0;
    const auto crossing = crossing_of(*trend, 0.5, 3'650);  // on day 100
    if (!crossing) continue;
    ++crossings;
    EXPECT_LT(crossing->earliest, crossing->day);
    EXPECT_NEAR(crossing->day, 100, 25);
  }
  EXPECT_GE(covered, 180);
  EXPECT_GE(crossings, 195);
}

TEST(Trend, HasNoCrossingWithoutASlope) {
  std::mt19937 random(6);
  std::normal_distribution<double> noise(0, 0.01);
  int crossings = 0;
  for (int n = 0; n < 200; ++n) {
    std::vector<Reading> readings;
    for (int d = 0; d < 30; ++d) readings.push_back({double(d), noise(random), 0.01});
    crossings += crossing_of(*trend_of(readings), 0.5, 3'650) ? 1 : 0;
  }
  EXPECT_LE(crossings, 3);
  EXPECT_FALSE(trend_of({{0, 1, 1}, {1, 1, 1}, {2, 1, 1}}));
}

TEST(Outlook, SaysWhyALimitHasNoDay) {
  const auto of = [](std::vector<Reading> readings, double most_days = 3'650) {
    return outlook_of(readings, trend_of(readings), 0.5, most_days);
  };
  EXPECT_EQ(of({{0, 0.1, 0.01}, {60, 0.25, 0.01}, {120, 0.4, 0.01}}), Outlook::few_readings);
  EXPECT_EQ(of({{0, 0.1, 0.01}, {60, 0.55, 0.01}}), Outlook::reached);
  EXPECT_EQ(of({{0, 0.1, 0.01}, {1, 0.1, 0.01}, {1.5, 0.1, 0.01}, {2, 0.1, 0.01}}), Outlook::short_time);
  std::vector<Reading> rising, flat;
  for (int d = 0; d < 30; ++d) {
    rising.push_back({double(d), 0.1 + 0.005 * d, 0.01});
    flat.push_back({double(d), 0.1 + (d % 2 ? 0.01 : -0.01), 0.01});
  }
  EXPECT_EQ(of(rising), Outlook::forecast);
  EXPECT_EQ(of(rising, 10), Outlook::far);
  EXPECT_EQ(of(flat), Outlook::no_slope);
}

TEST(FirstOfMany, IsTheDayFromWhichTheRateIsHigh) {
  EXPECT_EQ(first_of_many({false, false, false, true, true, false, true, true}), 3U);
  EXPECT_EQ(first_of_many({true, false, false, false, false, false, false, false, true, true, true, true}), 8U);
  EXPECT_EQ(first_of_many({true, true, true}), 0U);
  EXPECT_EQ(first_of_many({false, false}), 2U);
}

}  // namespace
}  // namespace bms::fleet
