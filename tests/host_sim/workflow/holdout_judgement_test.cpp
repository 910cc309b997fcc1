// Whether errors of a hold-out are larger than its interval states: few of them are independent.
#include "workflow/holdout_judgement.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace bms::workflow {
namespace {

/// Errors in standard deviations, correlated over so many rows.
std::vector<double> correlated(std::size_t rows, double over_rows, double size, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const double keeps = std::exp(-1 / over_rows);
  std::vector<double> errors;
  double now = normal(random);
  for (std::size_t k = 0; k < rows; ++k) {
    errors.push_back(size * now);
    now = keeps * now + std::sqrt(1 - keeps * keeps) * normal(random);
  }
  return errors;
}

struct Alarms {
  int beyond = 0, below_95 = 0;
};

Alarms of_healthy(double over_rows) {
  Alarms alarms;
  for (std::uint32_t seed = 0; seed < 300; ++seed) {
    const std::vector<double> errors = correlated(400, over_rows, 1, seed);
    diagnosis::Coverage coverage;
    for (const double e : errors) coverage.add(e, 1);
    alarms.below_95 += coverage.share() < diagnosis::nominal_coverage ? 1 : 0;
    alarms.beyond += probability_of(errors) < 0.01 ? 1 : 0;
  }
  return alarms;
}

TEST(HoldoutJudgement, FewHealthyRecordingsAreBeyondHoweverTheirErrorsAreCorrelated) {
  for (const double over_rows : {5.0, 30.0}) {
    const Alarms alarms = of_healthy(over_rows);
    EXPECT_LE(alarms.beyond, 12) << over_rows;
    EXPECT_GE(alarms.below_95, 60) << "the share alone says nothing";
  }
}

TEST(HoldoutJudgement, ErrorsThatAreTooLargeAreBeyond) {
  EXPECT_LT(probability_of(std::vector<double>(1'000, 5.0)), 1e-4) << "a single independent one";
  EXPECT_GT(probability_of(std::vector<double>(1'000, 1.9)), 0.02);
  int beyond = 0;
  for (std::uint32_t seed = 0; seed < 100; ++seed) beyond += probability_of(correlated(400, 5, 2, seed)) < 0.01 ? 1 : 0;
  EXPECT_GE(beyond, 95);
  EXPECT_EQ(probability_of({}), 1);
  EXPECT_EQ(probability_of(std::vector<double>(5, std::nan(""))), 1);
}

}  // namespace
}  // namespace bms::workflow
