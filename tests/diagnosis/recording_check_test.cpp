#include "diagnosis/recording_check.hpp"

#include <cmath>

#include <gmock/gmock.h>

#include "tests/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

using testing::ElementsAre;

std::vector<std::string> faults_of(PreparedRecording r) {
  std::vector<std::string> ids;
  for (const DataFault& f : check_recording(r, test::table9()).faults) ids.push_back(f.id);
  return ids;
}

PreparedRecording healthy() { return test::recorded(test::drive(1, 1), 0.7, 1); }

TEST(RecordingCheck, AHealthyRecordingHasNoFault) {
  PreparedRecording r = healthy();
  const RecordingCheck check = check_recording(r, test::table9());
  EXPECT_TRUE(check.faults.empty());
  EXPECT_TRUE(check.warnings.empty());
}

TEST(RecordingCheck, AConstantReadingAtConstantCurrentOnAFlatOcvIsAccepted) {
  PreparedRecording r = healthy();
  for (std::size_t k = 1'000; k < 1'400; ++k) {
    r.current_a.edit()[k] = -6 + 0.003 * (k % 2 == 0 ? 1 : -1);
    r.voltage_v.edit()[k] = 3.2;
  }
  EXPECT_TRUE(check_recording(r, test::table9()).faults.empty());
}

TEST(RecordingCheck, FindsWhatNoPhysicsExplains) {
  PreparedRecording inverted = healthy();
  for (double& a : inverted.current_a.edit()) a = -a;
  EXPECT_THAT(faults_of(inverted), ElementsAre("current_inverted"));

  PreparedRecording milli = healthy();
  for (double& a : milli.current_a.edit()) a *= 1'000;
  EXPECT_THAT(faults_of(milli), ElementsAre("current_in_ma"));

  PreparedRecording millivolts = healthy();
  for (double& v : millivolts.voltage_v.edit()) v *= 1'000;
  EXPECT_THAT(faults_of(millivolts), ElementsAre("voltage_in_mv"));

  PreparedRecording stuck = healthy();
  for (std::size_t k = 1'000; k < 1'400; ++k) stuck.voltage_v.edit()[k] = stuck.voltage_v[999];
  EXPECT_THAT(faults_of(stuck), ElementsAre("stuck_voltage"));

  PreparedRecording dropouts = healthy();
  for (std::size_t k = 100; k < dropouts.size(); k += 60) dropouts.voltage_v.edit()[k] = 0;
  EXPECT_THAT(faults_of(dropouts), ElementsAre("dropouts"));

  PreparedRecording gaps = healthy();
  for (std::size_t k = 0; k < gaps.size(); ++k) gaps.time_s.edit()[k] += 120.0 * static_cast<double>(k / 600);
  EXPECT_THAT(faults_of(gaps), ElementsAre("gaps"));
}

TEST(RecordingCheck, AFewBadReadingsAreRemovedAndReported) {
  PreparedRecording r = healthy();
  r.voltage_v.edit()[500] = 0;
  r.voltage_v.edit()[700] = 4.9;
  const RecordingCheck check = check_recording(r, test::table9());
  EXPECT_TRUE(check.faults.empty());
  EXPECT_EQ(check.warnings.size(), 1U);
  EXPECT_TRUE(std::isnan(r.voltage_v[500]));
  EXPECT_TRUE(std::isnan(r.voltage_v[700]));
}

}  // namespace
}  // namespace bms::diagnosis
