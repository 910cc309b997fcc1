// What the summary of faults in real recordings counts.
#include "proof/semi_real_tables.hpp"

#include <gmock/gmock.h>

#include "proof/faults_put_in.hpp"

namespace bms::proof {
namespace {

const InjectedFault& fault(std::string_view id) {
  return *std::find_if(injected_faults.begin(), injected_faults.end(), [&](const auto& f) { return f.id == id; });
}

SemiRealResult result(double over_limit, bool within, const char* verdict) {
  SemiRealResult r;
  r.fault = "current_gain";
  r.over_limit = over_limit;
  r.within_bounds = within;
  r.verdict = verdict;
  r.named = r.verdict == "CAUSE";
  r.detected = r.named || r.verdict == "UNKNOWN";
  return r;
}

TEST(SemiReal, ASizeIsWithinTheBoundsOfItsParameter) {
  EXPECT_TRUE(is_within_bounds(fault("current_gain"), 0.99, 2));
  EXPECT_FALSE(is_within_bounds(fault("current_gain"), 1.2, 2)) << "a reading more than twice as large";
  EXPECT_FALSE(is_within_bounds(fault("voltage_offset"), 0.6, 2));
  EXPECT_TRUE(is_within_bounds(fault("current_offset"), 0.29, 2)) << "0.29C, whatever the capacity";
  EXPECT_TRUE(is_within_bounds(fault("contact_step"), 1.4, 2)) << "0.7 ohm of a cell of 2 Ah";
  EXPECT_FALSE(is_within_bounds(fault("contact_step"), 1.6, 2));
  EXPECT_TRUE(is_within_bounds(fault("current_clipping"), 0.4, 2)) << "has no size that is compared";
}

TEST(SemiReal, FaultsBeyondTheBoundsStandApart) {
  SemiRealResult right = result(4, true, "CAUSE"), wrong = result(4, true, "CAUSE");
  right.first_right = true;
  const std::string text = by_size({right,
                                    wrong,
                                    result(4, true, "UNKNOWN"),
                                    result(4, false, "DATA_FAULT"),
                                    result(4, false, "CAUSE"),
                                    result(2, true, "NOT_TESTABLE"),
                                    {}});
  EXPECT_THAT(text, testing::HasSubstr("| 2 | within | 1 | 0 | 0 | 0 | 0 | 1 |\n"));
  EXPECT_THAT(text, testing::HasSubstr("| 4 | within | 3 | 3 | 1 | 1 | 0 | 0 |\n"));
  EXPECT_THAT(text, testing::HasSubstr("| 4 | beyond | 2 | 1 | 0 | 1 | 1 | 0 |\n"));
  EXPECT_EQ(by_size({{}}), "") << "healthy recordings alone";
}

TEST(SemiReal, ProbabilitiesAreComparedWithHowOftenTheyComeTrue) {
  std::vector<SemiRealResult> all(10, result(4, true, "CAUSE"));
  for (SemiRealResult& r : all) {
    r.probability = 0.9;
    r.is_the_fault = true;
  }
  all.back().fault = "";  // a null that was blamed
  all.back().is_the_fault = false;
  EXPECT_THAT(table_of(all), testing::HasSubstr("expected calibration error | 9 of 10; 0.90; 0.00 | - |\n"));
  for (std::size_t k = 0; k < 5; ++k) all[k].is_the_fault = false;
  EXPECT_THAT(table_of(all), testing::HasSubstr("expected calibration error | 4 of 10; 0.90; 0.50 | - |\n"));
}

}  // namespace
}  // namespace bms::proof
