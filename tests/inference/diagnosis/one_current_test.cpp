// A load of one current: what cannot be distinguished there must be named together.
#include "diagnosis/one_current.hpp"

#include <algorithm>

#include <gtest/gtest.h>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/next_experiment.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

constexpr double capacity_ah = 6;

/// A rest, a discharge at one current, a rest.
std::vector<double> discharge(double current_a, std::size_t seconds) {
  std::vector<double> profile(120, 0.0);
  profile.insert(profile.end(), seconds, current_a);
  profile.insert(profile.end(), 300, 0.0);
  return profile;
}

TEST(OneCurrent, ADischargeHasItAndADriveOrASquareWaveHasNot) {
  EXPECT_TRUE(has_one_current(std::vector{test::recorded(discharge(-6, 3'000), 0.95, 1)}, capacity_ah));
  PreparedRecording with_offset = test::recorded(discharge(-6, 3'000), 0.95, 1);
  for (double& a : with_offset.current_a.edit()) a += 0.8;
  EXPECT_TRUE(has_one_current(std::vector{with_offset}, capacity_ah)) << "an offset at rest is not a second load";
  for (double& a : with_offset.current_a.edit()) a += 0.9;
  EXPECT_TRUE(has_one_current(std::vector{with_offset}, capacity_ah)) << "1.7 A at rest, -4.3 A under load";
  for (double& a : with_offset.current_a.edit()) a += 1.2;
  EXPECT_FALSE(has_one_current(std::vector{with_offset}, capacity_ah)) << "2.9 A at rest: more than an offset can be";
  EXPECT_FALSE(has_one_current(std::vector{test::recorded(test::drive(1, 2), 0.8, 2)}, capacity_ah));
  std::vector<double> square;
  for (int k = 0; k < 40; ++k) square.insert(square.end(), 60, k % 2 == 0 ? -6 : 0);
  EXPECT_FALSE(has_one_current(std::vector{test::recorded(square, 0.95, 3)}, capacity_ah))
      << "its edges show the resistance";
  std::vector<double> both_ways = discharge(-6, 1'000);
  both_ways.insert(both_ways.end(), 1'000, 6.0);
  EXPECT_FALSE(has_one_current(std::vector{test::recorded(both_ways, 0.9, 4)}, capacity_ah));
  std::vector<double> a_third = discharge(-6, 1'000);
  a_third.insert(a_third.end(), 300, 2.4);
  EXPECT_FALSE(has_one_current(std::vector{test::recorded(a_third, 0.9, 4)}, capacity_ah))
      << "it rests at 0, so 2.4 A are a load";
}

TEST(OneCurrent, AnErrorOfTheCurrentIsNotNamedAsAnotherCauseAlone) {
  for (const double share : {0.75, 1.3}) {  // the sensor ends at less, or reads too much
    PreparedRecording r = test::recorded(discharge(-6, 2'600), 0.97, 5);
    for (double& a : r.current_a.edit()) a *= share;
    const Diagnosis d = diagnose(test::table9(), {}, {r}, {});
    EXPECT_NE(d.verdict, Verdict::cause) << name_of(d.verdict) << share;
    EXPECT_NE(d.verdict, Verdict::no_mismatch);
    for (const Finding& f : d.findings) {
      const auto is_or_may_be = [&](std::size_t m) {
        return f.setting.index == m ||
               std::find(f.equivalent_to.begin(), f.equivalent_to.end(), m) != f.equivalent_to.end();
      };
      const bool scales = is_or_may_be(model::mechanism_index_of<model::CapacityChange>) ||
                          is_or_may_be(model::mechanism_index_of<model::ResistanceGrowth>);
      EXPECT_TRUE(!scales || d.findings.size() > 1 ||
                  (is_or_may_be(model::mechanism_index_of<model::CurrentGain>) &&
                   is_or_may_be(model::mechanism_index_of<model::CurrentClipping>)))
          << model::catalogue[f.setting.index].id;
      EXPECT_LT(f.probability, 0.5) << model::catalogue[f.setting.index].id;
    }
    if (!names(d.verdict)) continue;
    const auto next = next_experiment(test::table9(), d, false);
    ASSERT_TRUE(next) << "an answer that leaves several causes must say what would decide";
    EXPECT_GE(next->separates.size(), 3U) << next->profile;
  }
}

TEST(OneCurrent, AResistanceIsNotNamedWithWhatMovesTheKnee) {
  PreparedRecording r = test::recorded(discharge(-6, 2'600), 0.97, 6);
  for (std::size_t k = 0; k < r.size(); ++k) r.voltage_v.edit()[k] += 0.05 * r.current_a[k];
  const Diagnosis d = diagnose(test::table9(), {}, {r}, {});
  ASSERT_FALSE(d.findings.empty()) << name_of(d.verdict);
  const Finding& f = d.findings.front();
  EXPECT_TRUE(f.setting.index == model::mechanism_index_of<model::ResistanceGrowth> ||
              f.setting.index == model::mechanism_index_of<model::PolarisationGrowth>)
      << model::catalogue[f.setting.index].id;
  for (const std::size_t m : f.equivalent_to) {
    EXPECT_NE(m, model::mechanism_index_of<model::CapacityChange>);
    EXPECT_NE(m, model::mechanism_index_of<model::CurrentGain>);
  }
}

}  // namespace
}  // namespace bms::diagnosis
