#include "diagnosis/trust.hpp"

#include <cmath>

#include <gmock/gmock.h>

#include "tests/diagnosis/evidence.hpp"

namespace bms::diagnosis {
namespace {

using testing::ElementsAre;

std::vector<std::string> faults_of(Record r) {
  std::vector<std::string> ids;
  for (const DataFault& f : examine(r, test::table9()).faults) ids.push_back(f.id);
  return ids;
}

Record healthy() { return test::recorded(test::drive(1, 1), 0.7, 1); }

TEST(Trust, AHealthyRecordingHasNoFault) {
  Record r = healthy();
  const Trust trust = examine(r, test::table9());
  EXPECT_TRUE(trust.faults.empty());
  EXPECT_TRUE(trust.warnings.empty());
}

TEST(Trust, AReadingThatStandsStillAtConstantCurrentOnAFlatCurveIsNoFault) {
  Record r = healthy();
  for (std::size_t k = 1'000; k < 1'400; ++k) {
    r.current_a[k] = -6 + 0.003 * (k % 2 == 0 ? 1 : -1);
    r.voltage_v[k] = 3.2;
  }
  EXPECT_TRUE(examine(r, test::table9()).faults.empty());
}

TEST(Trust, FindsWhatNoPhysicsExplains) {
  Record inverted = healthy();
  for (double& a : inverted.current_a) a = -a;
  EXPECT_THAT(faults_of(inverted), ElementsAre("current_inverted"));

  Record milli = healthy();
  for (double& a : milli.current_a) a *= 1'000;
  EXPECT_THAT(faults_of(milli), ElementsAre("current_in_ma"));

  Record millivolts = healthy();
  for (double& v : millivolts.voltage_v) v *= 1'000;
  EXPECT_THAT(faults_of(millivolts), ElementsAre("voltage_in_mv"));

  Record stuck = healthy();
  for (std::size_t k = 1'000; k < 1'400; ++k) stuck.voltage_v[k] = stuck.voltage_v[999];
  EXPECT_THAT(faults_of(stuck), ElementsAre("stuck_voltage"));

  Record dropouts = healthy();
  for (std::size_t k = 100; k < dropouts.size(); k += 60) dropouts.voltage_v[k] = 0;
  EXPECT_THAT(faults_of(dropouts), ElementsAre("dropouts"));

  Record gaps = healthy();
  for (std::size_t k = 0; k < gaps.size(); ++k) gaps.time_s[k] += 120.0 * static_cast<double>(k / 600);
  EXPECT_THAT(faults_of(gaps), ElementsAre("gaps"));
}

TEST(Trust, AFewBadReadingsAreTakenOutAndTold) {
  Record r = healthy();
  r.voltage_v[500] = 0;
  r.voltage_v[700] = 4.9;
  const Trust trust = examine(r, test::table9());
  EXPECT_TRUE(trust.faults.empty());
  EXPECT_EQ(trust.warnings.size(), 1U);
  EXPECT_TRUE(std::isnan(r.voltage_v[500]));
  EXPECT_TRUE(std::isnan(r.voltage_v[700]));
}

}  // namespace
}  // namespace bms::diagnosis
