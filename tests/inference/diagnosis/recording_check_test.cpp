#include "diagnosis/recording_check.hpp"

#include <cmath>

#include <gmock/gmock.h>

#include "tests/inference/diagnosis/synthetic_recordings.hpp"

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

/// One sample each second, with a converter of 1 mV.
void append(PreparedRecording& r, double seconds, double current_a, double voltage_v) {
  r.time_s.edit().push_back(r.time_s.back() + seconds);
  r.current_a.edit().push_back(current_a);
  r.voltage_v.edit().push_back(std::round(1e3 * voltage_v) / 1e3);
}

TEST(RecordingCheck, ChargingAtConstantVoltageIsAccepted) {
  for (const double level_v : {3.65, 3.5}) {  // the limit, and a charger that is set lower
    PreparedRecording r = healthy();
    for (int k = 0; k < 2'400; ++k) append(r, 1, 3 * std::exp(-k / 600.0) + 0.01 * (k % 3 - 1), level_v);
    EXPECT_THAT(faults_of(r), ElementsAre()) << level_v;
  }
}

TEST(RecordingCheck, AVoltageThatStandsStillInADriveOrADischargeIsStuck) {
  PreparedRecording rising = healthy(), discharge = healthy();
  for (int k = 0; k < 600; ++k) {
    append(rising, 1, 3 - 3 * std::exp(-k / 200.0), 3.4);  // no charger does that at constant voltage
    append(discharge, 1, -3 * std::exp(-k / 200.0), 3.2);
  }
  EXPECT_THAT(faults_of(rising), ElementsAre("stuck_voltage"));
  EXPECT_THAT(faults_of(discharge), ElementsAre("stuck_voltage"));
}

TEST(RecordingCheck, ARestingVoltageStandsOnTheConvertersLastDigit) {
  PreparedRecording r = healthy();
  for (double& v : r.voltage_v.edit()) v = std::round(200 * v) / 200;  // 5 mV; R0 of the cell is 13 mohm
  for (int k = 0; k < 1'200; ++k) {
    append(r, 1, 0.1 * std::sin(0.1 * k), 3.3);
    r.voltage_v.edit().back() = 3.3;
  }
  EXPECT_THAT(faults_of(r), ElementsAre());
}

/// A row each second while the current changes, else one each minute, as in a cell's pulse test.
PreparedRecording written_on_change() {
  PreparedRecording r = test::recorded({0, 0}, 0.9, 3);
  for (int pulse = 0; pulse < 10; ++pulse) {
    for (int k = 0; k < 60; ++k) append(r, 1, k % 20 < 10 ? -6 : 0, 3.3 - (k % 20 < 10 ? 0.08 : 0) - 1e-4 * k);
    for (int k = 0; k < 7; ++k) append(r, k == 0 ? 1 : 60, -1.5, 3.28 - 1e-3 * pulse);
  }
  return r;
}

TEST(RecordingCheck, RowsWrittenOnChangeAreNotGaps) { EXPECT_THAT(faults_of(written_on_change()), ElementsAre()); }

TEST(RecordingCheck, ALoggerThatStopsIsFoundAmongRowsWrittenOnChange) {
  PreparedRecording r = written_on_change();
  for (std::size_t k = 300; k < r.size(); ++k) r.time_s.edit()[k] += 1'800;
  EXPECT_THAT(faults_of(r), ElementsAre("gaps")) << "half an hour at 1.5 A, where a minute is usual";
  PreparedRecording drive = healthy();
  for (std::size_t k = 0; k < drive.size(); ++k) drive.time_s.edit()[k] += 120.0 * static_cast<double>(k / 100);
  for (std::size_t k = 100; k < drive.size(); k += 100) drive.current_a.edit()[k] = -3 - drive.current_a[k - 1];
  EXPECT_THAT(faults_of(drive), ElementsAre("gaps")) << "the load is another one after each gap";
}

TEST(RecordingCheck, FindsWhatNoPhysicsExplains) {
  PreparedRecording inverted = healthy();
  for (double& a : inverted.current_a.edit()) a = -a;
  EXPECT_THAT(faults_of(inverted), ElementsAre("current_inverted"));
  // a discharge at constant current has no step; the voltage falls while charge is counted in
  PreparedRecording discharge =
      test::recorded(std::vector<double>(1'800, -6.0), 0.6, 5, [](std::size_t k, double, double) {
        return -0.2 * static_cast<double>(k) / 1'800;  // steeper than the plateau of this cell
      });
  EXPECT_THAT(faults_of(discharge), ElementsAre());
  for (double& a : discharge.current_a.edit()) a = -a;
  EXPECT_THAT(faults_of(discharge), ElementsAre("current_inverted"));

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
