// A recording where no healthy one was: nothing found there does not prove that nothing is there.
#include "diagnosis/healthy_coverage.hpp"

#include <gmock/gmock.h>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/texts.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

healthy_data::HealthyData healthy_at(double temperature_c) {
  healthy_data::HealthyData healthy;
  healthy.known = true;
  for (int n = 0; n < 4; ++n) {
    healthy_data::HealthyBlock b;
    b.recording = "healthy.csv";
    b.duration_s = 3'600;
    b.soc = {0, 1};
    b.current_a = {-20, 20};
    b.temperature_c = {temperature_c, temperature_c + 2};
    healthy.blocks.push_back(b);
  }
  return healthy;
}

PreparedRecording recorded_at(double temperature_c, std::uint64_t seed) {
  PreparedRecording r = test::recorded(test::drive(0.5, seed), 0.7, seed);
  r.temperature_c.edit().assign(r.size(), temperature_c);
  return r;
}

TEST(HealthyCoverage, SaysWhereAndHowFarARecordingGoesBeyond) {
  const HealthyCoverage here = coverage_of({recorded_at(25, 1)}, healthy_at(25), 6);
  EXPECT_EQ(here.share, 1);
  EXPECT_EQ(here.least, 1);
  EXPECT_TRUE(here.beyond.empty());
  const HealthyCoverage warmer = coverage_of({recorded_at(25, 1), recorded_at(40, 1)}, healthy_at(25), 6);
  EXPECT_NEAR(warmer.share, 0.5, 0.01);
  EXPECT_EQ(warmer.least, 0) << "the second recording";
  ASSERT_EQ(warmer.beyond.size(), 1);
  EXPECT_EQ(warmer.beyond.front().axis, "temperature_c");
  EXPECT_EQ(warmer.beyond.front().recorded.high, 40);
  EXPECT_EQ(warmer.beyond.front().healthy.high, 27);
}

TEST(HealthyCoverage, AFewLargeCurrentsCarryMostOfARecording) {
  PreparedRecording r = recorded_at(25, 1);
  std::vector<double>& current_a = r.current_a.edit();
  for (std::size_t k = 0; k < current_a.size(); ++k) current_a[k] = k % 20 == 0 ? -60 : 5;
  const HealthyCoverage c = coverage_of({r}, healthy_at(25), 6);
  EXPECT_NEAR(c.share, 0.117, 0.01) << "19 * 25 of 19 * 25 + 3600 A^2, though 95 % of the rows";
  EXPECT_EQ(c.least, c.share);
  ASSERT_EQ(c.beyond.size(), 1);
  EXPECT_NEAR(c.beyond.front().share, 0.05, 0.01);
}

TEST(HealthyCoverage, NothingFoundElsewhereIsNotNoMismatch) {
  Options options;
  options.healthy = healthy_at(25);
  const PreparedRecording there = recorded_at(26, 203), elsewhere = recorded_at(40, 203);
  EXPECT_EQ(diagnose(test::table9(), {}, {there}, options).verdict, Verdict::no_mismatch);
  Diagnosis d = diagnose(test::table9(), {}, {elsewhere}, options);
  EXPECT_EQ(d.verdict, Verdict::not_testable) << "its tolerance is all that is known of the file there";
  EXPECT_TRUE(d.withheld.empty());
  describe(d, test::table9(), {elsewhere});
  EXPECT_THAT(d.statement, testing::HasSubstr("its temperature is 40 to 40 degrees C, that of the healthy ones 25"));
  EXPECT_EQ(diagnose(test::table9(), {}, {elsewhere}, {}).verdict, Verdict::no_mismatch) << "without healthy data";
}

TEST(HealthyCoverage, ARecordingNextToIt) {
  Options options;
  options.healthy = healthy_at(25);
  const Diagnosis d = diagnose(test::table9(), {}, {recorded_at(26, 203), recorded_at(40, 204)}, options);
  EXPECT_EQ(d.verdict, Verdict::not_testable) << "half of the rows are covered, the second recording is not";
}

}  // namespace
}  // namespace bms::diagnosis
