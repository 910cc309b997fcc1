#include "replay/replay.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "files/recording.hpp"
#include "replay/stepper.hpp"

namespace bms::replay {
namespace {

using ::testing::HasSubstr;

ReplayResult replayed(const std::optional<SocPrior>& prior, ScalarKind scalar = ScalarKind::float32) {
  ReplayResult result;
  result.cell = files::read_cell("table9");
  result.target = "host";
  result.scalar = scalar;
  result.recording = files::read_recording(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv");
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
  const auto track = [](const std::vector<estimator::EstimateWords>& words) {
    Track of_words;
    of_words.rows = Estimates(words, ScalarKind::float32);
    return of_words;
  };
  const std::vector<estimator::EstimateWords> words(100, {1, 2, 3, 4, 5});
  const Track a = track(words);
  EXPECT_FALSE(first_difference(a, track(words), ScalarKind::float32).has_value());
  auto others = words;
  others[41][1] ^= 1;
  others[70][0] ^= 1;
  const auto d = first_difference(a, track(others), ScalarKind::float32);
  ASSERT_TRUE(d.has_value());
  EXPECT_EQ(d->sample, 41U);
  EXPECT_EQ(d->field, "soc_sigma");
  others = words;
  others.pop_back();
  EXPECT_EQ(first_difference(a, track(others), ScalarKind::float32)->field, "number of estimates");
}

/// The estimator itself, sample by sample.
TEST(Replay, RowsAreTheNumbersOfTheEstimator) {
  const auto r = replayed(SocPrior{0.9});
  const auto stepper = make_stepper(r.cell, starting_point(SocPrior{0.9}));
  const auto samples = measurement::samples(r.recording);
  ASSERT_GT(samples.size(), 10'000U) << "more than one block";
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const EstimateRow e = stepper->step(samples[k]), row = r.track.rows[k];
    ASSERT_EQ(row.soc, e.soc) << k;
    ASSERT_EQ(row.soc_sigma, e.soc_sigma) << k;
    ASSERT_EQ(row.v_rc_v, e.v_rc_v) << k;
    ASSERT_EQ(row.voltage_predicted_v, e.voltage_predicted_v) << k;
    ASSERT_EQ(row.flags, e.flags) << k;
    ASSERT_EQ(r.track.rows.flags(k), e.flags) << k;
  }
}

TEST(Replay, RowsOfFixedPointHave27BitsAfterThePoint) {
  const auto r = replayed(SocPrior{0.9}, ScalarKind::fixed);
  for (std::size_t k = 0; k < r.track.rows.size(); k += 997) {
    const auto word = [&](std::size_t w) {
      return static_cast<std::int32_t>(r.track.rows.words()[k][w]) / 134217728.0;
    };
    EXPECT_EQ(r.track.rows[k].soc, word(0));
    EXPECT_EQ(r.track.rows[k].voltage_predicted_v, word(3));
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
  files::Sha256 hash;
  std::size_t pieces = 0;
  write_trace(r, [&](std::string_view piece) {
    hash.add(piece);
    ++pieces;
  });
  EXPECT_GT(pieces, 1U);
  EXPECT_EQ(hash.hex(), files::sha256(csv));
}

}  // namespace
}  // namespace bms::replay
