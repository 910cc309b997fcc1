// The estimator on real recordings that its cell files were not identified from, except for one window: limits of its
// error, and bit equality on the emulated board.
#include <algorithm>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "files/recording.hpp"
#include "images/emulator.hpp"
#include "tests/figures/soc_trials.hpp"

namespace bms {
namespace {

const std::filesystem::path data = BMS_DATA_DIR;

bool there() {
  return std::filesystem::exists(data / "a123_26650") && std::filesystem::exists(data / "a123_esctoolbox");
}

/// Largest RMS error of the state of charge that is accepted for a recording.
double largest_rmse(const std::string& name, bool balanced) {
  if (!balanced) return name.starts_with("dyn") ? 0.02 : 0.01;
  if (name == "dyn50_P25") return 0.010;
  return name == "dyn45_P05" ? 0.015 : 0.020;
}

/// A slow charge or discharge of each shared temperature. In the cold the resistances of the drives are twice those of
/// so small a current, and each half hour shows the same error again.
TEST(SocTrials, SlowRunsAreInsideTwoSigma) {
  if (!there()) GTEST_SKIP() << "the real recordings are not there: " << data;
  std::size_t runs = 0;
  for (const char* set : {"a123_26650", "a123_esctoolbox"}) {
    const files::CellFile cell = files::read_cell(std::string(set) + "_extended");
    for (const auto& entry : std::filesystem::directory_iterator(data / set)) {
      if (!entry.path().stem().string().starts_with("ocv_") || entry.path().extension() != ".csv") continue;
      SCOPED_TRACE(entry.path());
      ++runs;
      replay::ReplayResult r;
      r.cell = cell;
      r.recording = files::read_recording(entry.path().string());
      r.track = replay::run_on_host(r.cell, measurement::samples(r.recording), replay::starting_point({}), r.scalar);
      replay::evaluate(r);
      EXPECT_GE(*r.soc.within_2_sigma, 0.9);
      EXPECT_LT(*r.soc.rmse, 0.06);
    }
  }
  EXPECT_EQ(runs, 22U);
}

TEST(SocTrials, StartedRightOrWrongWithSensorsOffOrOn) {
  if (!there()) GTEST_SKIP() << "the real recordings are not there: " << data;
  double inside = 0, samples_seen = 0;
  std::size_t trials = 0;
  std::vector<double> sigmas, of_cuts;
  each_soc_trial(data, [&](const SocTrial& t) {
    replay::ReplayResult r;
    r.cell = t.cell;
    r.recording = t.recording;
    r.track = replay::run_on_host(t.cell, measurement::samples(t.recording), replay::starting_point(t.prior), r.scalar);
    replay::evaluate(r);
    SCOPED_TRACE(t.name + ", " + t.trouble);
    ++trials;
    const auto rows = static_cast<double>(r.track.rows.size());
    inside += *r.soc.within_2_sigma * rows;
    samples_seen += rows;
    const bool balanced = t.cell.name == "a123_esctoolbox_extended";
    if (t.trouble.starts_with("cut")) {
      if (!balanced) {
        EXPECT_GE(*r.soc.within_2_sigma, 0.7);
        of_cuts.push_back(*r.soc.within_2_sigma);
      }
    } else if (t.trouble.starts_with("current +") || t.trouble.starts_with("current -")) {
      EXPECT_LT(*r.soc.rmse, 0.02);
    } else if (t.trouble.starts_with("voltage")) {
      EXPECT_LT(*r.soc.rmse, 0.02);
    } else {
      const double most = largest_rmse(t.name, balanced);
      const bool wrong = t.trouble.starts_with("initial SOC 30 %");
      EXPECT_LT(wrong && balanced ? *r.soc.rmse_after_30min : *r.soc.rmse,
                wrong ? most + (most > 0.01 ? 0.005 : 0.002) : most);
      if (!t.name.starts_with("dyn")) {
        EXPECT_LT(*r.soc.max_error_after_30min, 0.017);
      }
    }
    for (const replay::EstimateRow& e : r.track.rows) sigmas.push_back(e.soc_sigma);
    if (t.trouble == "initial SOC correct" && t.name.ends_with("_A002") && t.name.starts_with("dyn")) {
      EXPECT_NEAR(*r.soc.current_offset_a, 0.008, 2 * *r.soc.current_offset_sigma_a)
          << "7 to 9 mA are read while nothing flows";
    }
  });
  EXPECT_GE(std::accumulate(of_cuts.begin(), of_cuts.end(), 0.0), 0.9 * static_cast<double>(of_cuts.size()))
      << "wrong starts in the middle of the plateau";
  EXPECT_EQ(trials, 90U);
  EXPECT_GT(inside / samples_seen, 0.95);
  const auto middle = sigmas.begin() + static_cast<std::ptrdiff_t>(sigmas.size() / 2);
  std::nth_element(sigmas.begin(), middle, sigmas.end());
  EXPECT_LT(*middle, 0.02) << "a band that is always wide is useless";
}

/// Every seventh trial, because the emulator takes a second for each: all recordings, different troubles.
TEST(SocTrials, AreBitEqualOnTheBoard) {
  if (!there()) GTEST_SKIP() << "the real recordings are not there: " << data;
  const images::EmulatedBoard& board = images::emulated_boards().front();
  std::size_t trial = 0;
  each_soc_trial(data, [&](const SocTrial& t) {
    if (trial++ % 7 != 0) return;
    const auto all = measurement::samples(t.recording);
    const auto start = replay::starting_point(t.prior);
    const auto difference = replay::first_difference(replay::run_on_host(t.cell, all, start, board.scalar),
                                                     images::run_on_board(board, t.cell, all, start), board.scalar);
    EXPECT_FALSE(difference) << t.name << ", " << t.trouble << ": " << (difference ? difference->field : "");
  });
}

}  // namespace
}  // namespace bms
