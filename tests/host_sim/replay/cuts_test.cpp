#include "replay/cuts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "measurement/normal_distribution.hpp"

namespace bms::replay {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Cuts, AKneeIsWhereTheSlopeOfTheOcvChangesByFarMoreThanTwo) {
  model::CellParameters<> p;
  for (const double soc : {0.0, 0.4, 0.6, 0.8, 1.0}) p.ocv.soc.push_back(soc);
  double v = 3;  // slopes 1, 0.1, 0.2 and 1 V per unit of SOC
  for (const auto& [from, width, slope] :
       {std::array{0.0, 0.4, 1.0}, std::array{0.4, 0.2, 0.1}, std::array{0.6, 0.2, 0.2}, std::array{0.8, 0.2, 1.0}}) {
    p.ocv.b0_v.push_back(v - slope * from);
    p.ocv.b1_v.push_back(slope);
    v += slope * width;
  }
  EXPECT_THAT(ocv_knees(p), ElementsAre(0.4, 0.8));
}

TEST(Cuts, OfTheShiftRunFromEachCutToTheEndWithEachStart) {
  const auto recording = files::read_recording(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv");
  const CutResult result = run_cuts(files::read_cell("table9"), recording, 4);
  ASSERT_EQ(result.starts.size(), cut_starts.size());
  for (const CutFigures& f : result.starts) {
    SCOPED_TRACE(f.start.title);
    ASSERT_EQ(f.runs.size(), 4U);
    EXPECT_EQ(f.runs[0].rows, recording.rows());
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_NEAR(f.runs[k].from_s, static_cast<double>(k) * (recording.duration_s() - 1'800) / 4, 2);
      EXPECT_NEAR(f.runs[k].from_s + f.runs[k].duration_s, recording.duration_s(), 2);
      EXPECT_LE(f.runs[k].inside[0], f.runs[k].inside[1]);
      EXPECT_LE(f.runs[k].inside[1], f.runs[k].inside[2]);
    }
  }
  EXPECT_LT(result.starts[0].worst_rmse[0], 0.03) << "started right";
  EXPECT_EQ(result.starts[0].inside[2], 1);
  EXPECT_GT(result.starts[1].median_ratio, result.starts[0].median_ratio) << "drawn";
  EXPECT_GT(result.starts[4].runs[1].rmse[0], 0) << "started 20 % wrong";
}

TEST(Cuts, AreCountedIfTheyAreOutsideOfTwoSigmaForTooLong) {
  const auto recording = files::read_recording(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv");
  const CutResult result = run_cuts(files::read_cell("table9"), recording, 3);
  for (const CutFigures& f : result.starts) {
    for (std::size_t i = 0; i < cut_inside_limits.size(); ++i) {
      const auto below = std::count_if(f.runs.begin(), f.runs.end(),
                                       [&](const CutRun& run) { return run.inside[1] < cut_inside_limits[i]; });
      EXPECT_EQ(f.cuts_below[i], static_cast<std::size_t>(below)) << f.start.title;
    }
  }
  EXPECT_THAT(cut_rows(result), HasSubstr(" | 0, 0 of 3 | ")) << "started right";
}

TEST(Cuts, OfTwoRecordingsCountOnceEachInTheSummary) {
  CutResult one;
  CutFigures f;
  f.runs.resize(2);
  f.runs[0].inside = {0.5, 0.6, 0.7};
  f.runs[1].inside = {0.8, 1, 1};
  f.runs[0].median_ratio = 2;
  f.runs[1].median_ratio = 0.5;
  one.starts.assign(cut_starts.size(), f);
  CutResult other = one;
  for (CutFigures& starts : other.starts) starts.runs.resize(1);
  EXPECT_THAT(cut_summary({one, other}), HasSubstr("| unknown | 3 | 0.00, 0.00, 0.00 | 60, 73, 80 | 2, 2 | 2.00 |"));
}

/// Errors drawn from a normal distribution, in quantiles.
Calibration of_normal_errors(double sigma, double stated, double bias) {
  Calibration c;
  constexpr int draws = 1'000;
  for (int k = 0; k < draws; ++k) c.add(bias + sigma * measurement::normal_quantile((k + 0.5) / draws), stated);
  return c;
}

TEST(CutCalibration, HasAQuarterInEachQuarterIfSigmaIsHonest) {
  const Calibration honest = of_normal_errors(0.02, 0.02, 0), wide = of_normal_errors(0.01, 0.02, 0),
                    small = of_normal_errors(0.04, 0.02, 0), high = of_normal_errors(0.02, 0.02, 0.02);
  for (const double quarter : honest.quarters) EXPECT_NEAR(quarter, 250, 1);
  EXPECT_NEAR(honest.within_2_sigma, 954, 1);
  EXPECT_NEAR(wide.quarters[0], 89, 1) << "beyond 0.674 of a sigma that is twice the error's";
  EXPECT_NEAR(wide.quarters[1], 411, 1);
  EXPECT_NEAR(small.quarters[3], 368, 1);
  EXPECT_NEAR(small.within_2_sigma, 683, 1);
  EXPECT_NEAR(high.quarters[0], 628, 1) << "the truth lies below what is stated";
  EXPECT_NEAR(high.quarters[3], 47, 1);
}

TEST(CutCalibration, GroupsEachEstimateByTimeTemperatureAndCurrent) {
  auto recording = files::read_recording(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv");
  const CutResult result = run_cuts(files::read_cell("table9"), recording, 2);
  for (const CutFigures& f : result.starts) {
    const double rows = static_cast<double>(f.runs[0].rows + f.runs[1].rows);
    std::size_t first = 0;
    for (const std::size_t groups :
         {calibration_from_min.size(), calibration_from_c.size(), calibration_from_c_rate.size()}) {
      double sum = 0;
      for (std::size_t k = first; k < first + groups; ++k) sum += f.calibration[k].count();
      EXPECT_EQ(sum, rows) << f.start.title << ", groups from " << first;
      first += groups;
    }
    EXPECT_EQ(f.calibration[0].count(), 2 * 600) << "ten minutes of two cuts at 1 Hz";
    EXPECT_EQ(f.calibration[calibration_from_min.size() + 0].count(), 0) << "below 0 degrees C";
  }
  // each recording counts once, however long it is
  CutResult other = result;
  const std::size_t drawn = 1;
  ASSERT_STREQ(other.starts[drawn].start.id, "drawn");
  other.starts[drawn].calibration[0] = {{4, 0, 0, 0}, 0};
  CutResult longer = result;
  longer.starts[drawn].calibration[0] = {{0, 1'000, 0, 1'000}, 2'000};
  const std::vector<CutResult> both{other, longer};
  EXPECT_THAT(calibration_table(both), HasSubstr("| below 10 min since the start | 50, 25, 0, 25 | 50 |"));
}

TEST(Cuts, NeedAReference) {
  auto recording = files::read_recording(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv");
  recording.soc_ref = {};
  try {
    run_cuts(files::read_cell("table9"), recording, 2);
    FAIL();
  } catch (const files::BadInput& e) {
    EXPECT_THAT(e.what(), HasSubstr("soc_ref"));
  }
}

}  // namespace
}  // namespace bms::replay
