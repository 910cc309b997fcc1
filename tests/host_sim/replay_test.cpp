#include "host_sim/replay.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "files/recording.hpp"

namespace bms::host_sim {
namespace {

using ::testing::HasSubstr;

ReplayResult replayed(const std::optional<SocPrior>& prior, ScalarKind scalar = ScalarKind::float32) {
  ReplayResult result;
  result.cell = files::read_cell("table9");
  result.target = "host";
  result.scalar = scalar;
  result.recording = files::read_recording(BMS_SOURCE_DIR "/recordings/forklift_shift.csv");
  result.track = run_on_host(result.cell, measurement::samples(result.recording), starting_point(prior), scalar);
  evaluate(result);
  return result;
}

// The accuracy that the estimator must reach. estimator/README.md has the measured values.
TEST(ReplayOfTheShift, WithARightStartTheErrorIsBelow1Percent) {
  const auto r = replayed(SocPrior{0.98});
  EXPECT_LT(*r.soc.rmse, 0.01);
  EXPECT_GT(*r.soc.within_2_sigma, 0.9);
}

TEST(ReplayOfTheShift, WithoutAStartTheErrorIsBelow1Percent) { EXPECT_LT(*replayed(std::nullopt).soc.rmse, 0.01); }

TEST(ReplayOfTheShift, WithAStart20PercentWrongTheErrorIsBelow1Point5PercentAfter30MinutesForAnyGivenSigma) {
  for (const double sigma : {0.02, 0.2, 0.3}) {
    const auto r = replayed(SocPrior{0.78, sigma});
    EXPECT_LT(*r.soc.rmse_after_30min, 0.015) << "sigma " << sigma;
  }
}

TEST(ReplayOfTheShift, FixedPointIsWithin1PercentOfDouble) {
  const auto fixed = replayed(SocPrior{0.98}, ScalarKind::fixed),
             float64 = replayed(SocPrior{0.98}, ScalarKind::float64);
  double largest = 0;
  for (std::size_t k = 0; k < fixed.track.rows.size(); ++k)
    largest = std::max(largest, std::abs(fixed.track.rows[k].soc - float64.track.rows[k].soc));
  EXPECT_LT(largest, 0.01);
  RecordProperty("largest_soc_difference", std::to_string(largest));
}

TEST(Replay, ADifferenceOfOneBitIsFoundAndNamed) {
  Track a;
  a.words.assign(100, {1, 2, 3, 4, 5});
  Track b = a;
  EXPECT_FALSE(first_difference(a, b, ScalarKind::float32).has_value());
  b.words[41][1] ^= 1;
  b.words[70][0] ^= 1;
  const auto d = first_difference(a, b, ScalarKind::float32);
  ASSERT_TRUE(d.has_value());
  EXPECT_EQ(d->sample, 41U);
  EXPECT_EQ(d->field, "soc_sigma");
  b.words = a.words;
  b.words.pop_back();
  EXPECT_EQ(first_difference(a, b, ScalarKind::float32)->field, "number of estimates");
}

TEST(Replay, WordsOfABoardAreTheNumbersOfTheHost) {
  for (const ScalarKind scalar : {ScalarKind::float32, ScalarKind::fixed}) {
    const auto r = replayed(SocPrior{0.9}, scalar);
    const auto rows = rows_of(r.track.words, scalar);
    for (std::size_t k = 0; k < rows.size(); k += 997) {
      EXPECT_EQ(rows[k].soc, r.track.rows[k].soc);
      EXPECT_EQ(rows[k].soc_sigma, r.track.rows[k].soc_sigma);
      EXPECT_EQ(rows[k].v_rc_v, r.track.rows[k].v_rc_v);
      EXPECT_EQ(rows[k].voltage_predicted_v, r.track.rows[k].voltage_predicted_v);
    }
  }
}

TEST(Replay, SocFiguresAreNullWithoutAReference) {
  ReplayResult r = replayed(std::nullopt);
  r.recording.soc_ref = {};
  r.soc = {};
  r.open_loop_v.clear();
  evaluate(r);
  EXPECT_FALSE(r.soc.rmse.has_value());
}

TEST(Replay, TraceHasARowForEverySampleAndTheDocumentedColumns) {
  const auto r = replayed(std::nullopt);
  const std::string csv = trace_csv(r);
  EXPECT_TRUE(csv.starts_with("time_s,soc,soc_sigma,v_rc_v,voltage_predicted_v,voltage_measured_v,flags\n"));
  EXPECT_EQ(static_cast<std::size_t>(std::count(csv.begin(), csv.end(), '\n')), r.recording.rows() + 1);
  EXPECT_EQ(csv, trace_csv(replayed(std::nullopt)));
}

}  // namespace
}  // namespace bms::host_sim
