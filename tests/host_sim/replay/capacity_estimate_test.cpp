// The capacity of a cell from a log without a full cycle: the log is simulated with another capacity, another
// resistance and noise, and the tool does not know them.
#include "replay/capacity_estimate.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <random>
#include <string>

#include "files/recording.hpp"
#include "replay/simulation.hpp"

namespace bms::replay {
namespace {

/// Load and rest by turns from `from` until `to`, at half a capacity an hour, in rows of `period_s`.
ReplayResult log_of(double capacity_ah, double from, double to, double period_s, unsigned seed,
                    std::optional<SocPrior> prior = {}) {
  files::CellFile cell = files::read_cell("a123_26650");
  auto truth = cell.parameters;
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 1e-3);
  for (std::size_t k = 0; k < truth.rc.r0_ohm.size; ++k) truth.rc.r0_ohm[k] *= 1.15;
  ReplayResult result;
  result.cell = cell;
  const double sign = to > from ? 1 : -1;
  std::vector<double> t = {0}, a = {0};
  double soc = from;
  while (sign * (to - soc) > 0) {
    const bool load = std::fmod(t.back(), 3'000) < 2'100;
    t.push_back(t.back() + period_s);
    a.push_back(load ? sign * 0.5 * capacity_ah : 0);
    soc += a.back() * period_s / 3'600 / capacity_ah;
  }
  for (int k = 0; k < 1'800 / period_s; ++k) {
    t.push_back(t.back() + period_s);
    a.push_back(0);
  }
  const auto prepared = model::prepare<double, model::max_intervals>(truth);
  std::vector<double> v;
  simulate({.cell = prepared, .capacity_ah = capacity_ah, .time_s = t, .current_a = a, .initial_soc = from},
           [&](const SimulatedRow& row) { v.push_back(row.voltage_v + noise(random)); });
  result.recording.time_s = t;
  result.recording.current_a = a;
  result.recording.voltage_v = v;
  result.prior = prior;
  if (prior) result.initial_soc = prior->soc;
  result.track = run_on_host(cell, measurement::SampleList(result.recording), starting_point(prior),
                             ScalarKind::float32, Timing::none);
  evaluate(result);
  return result;
}

TEST(CapacityEstimate, IsWithinItsSigmaWhereTheLogReachesBothKnees) {
  const double file_ah = files::read_cell("a123_26650").parameters.capacity_ah;
  int inside = 0, differing = 0, said = 0;
  constexpr int logs = 12;
  for (unsigned k = 0; k < logs; ++k) {
    const double capacity_ah = file_ah * (0.7 + 0.03 * k);
    const ReplayResult r = log_of(capacity_ah, 0.99, 0.02, k % 2 == 0 ? 2 : 10, k);
    ASSERT_TRUE(r.capacity) << k;
    inside += std::abs(r.capacity->value_ah - capacity_ah) < 2 * r.capacity->std_ah ? 1 : 0;
    if (std::abs(capacity_ah / file_ah - 1) > 0.08) {
      ++differing;
      said += capacity_differs(r) ? 1 : 0;
    }
    if (std::abs(capacity_ah / file_ah - 1) < 0.02) {
      EXPECT_FALSE(capacity_differs(r)) << k;
    }
    EXPECT_LT(r.capacity->std_ah, 0.05 * capacity_ah) << k;
  }
  EXPECT_GE(inside, logs - 1);
  EXPECT_EQ(differing, 8) << "0.70 to 0.91 of the file's capacity";
  EXPECT_EQ(said, differing);
}

TEST(CapacityEstimate, IsNotGivenWhereTheLogHasTooLittle) {
  const double file_ah = files::read_cell("a123_26650").parameters.capacity_ah;
  for (unsigned k = 0; k < 4; ++k) {
    const ReplayResult r = log_of(file_ah * (0.75 + 0.1 * k), 0.62, 0.45, 5, k);
    EXPECT_FALSE(r.capacity) << "on the plateau alone: " << r.capacity->value_ah << " Ah of "
                             << file_ah * (0.75 + 0.1 * k);
  }
}

/// Error of the state of charge, RMS. from: the true one at the start.
double soc_rmse(const ReplayResult& r, double from, double capacity_ah) {
  double soc = from, squares = 0;
  for (std::size_t k = 0; k < r.recording.rows(); ++k) {
    const double hours = k == 0 ? 0 : (r.recording.time_s[k] - r.recording.time_s[k - 1]) / 3'600;
    soc += r.recording.current_a[k] * hours / capacity_ah;
    squares += std::pow(r.track.rows[k].soc - soc, 2);
  }
  return std::sqrt(squares / static_cast<double>(r.recording.rows()));
}

bool count_again(ReplayResult& r) {
  return count_with_estimated_capacity(r, measurement::SampleList(r.recording), starting_point(r.prior));
}

TEST(CapacityEstimate, ReplacesThatOfTheFileInTheCount) {
  const double file_ah = files::read_cell("a123_26650").parameters.capacity_ah;
  for (const double share : {0.7, 0.8, 0.9}) {
    const double capacity_ah = share * file_ah;
    ReplayResult r = log_of(capacity_ah, 0.98, 0.02, 10, 1, SocPrior{0.98, 0.02});
    const double by_file = soc_rmse(r, 0.98, capacity_ah), open_loop_v = *r.voltage.open_loop_rmse_v;
    EXPECT_GT(by_file, 0.02) << share;
    ASSERT_TRUE(count_again(r)) << share;
    EXPECT_LT(soc_rmse(r, 0.98, capacity_ah), 0.5 * by_file) << share;
    EXPECT_LT(soc_rmse(r, 0.98, capacity_ah), 0.015) << share;
    EXPECT_LT(*r.voltage.open_loop_rmse_v, open_loop_v) << share;
    EXPECT_EQ(r.counted_capacity_ah, r.capacity->value_ah);
    EXPECT_NE(r.reasons.back().find("not the 2.58 Ah of its file; its charge is counted with that"), std::string::npos)
        << r.reasons.back();
    for (const std::string& reason : r.reasons) EXPECT_EQ(reason.find("contradict"), std::string::npos) << reason;
  }
}

/// A recording of a real cell from full until nearly empty, with a cell file that states this share of its capacity.
ReplayResult real_log(const std::string& name, double share) {
  ReplayResult r;
  r.recording = files::read_recording(BMS_SOURCE_DIR "/evidence/recordings/a123_26650/" + name + ".csv.gz");
  r.cell = files::read_cell("a123_26650_extended");
  r.cell.parameters.capacity_ah *= share;
  r.prior = SocPrior{r.recording.soc_ref.front(), 0.02};
  r.initial_soc = r.prior->soc;
  r.track = run_on_host(r.cell, measurement::SampleList(r.recording), starting_point(r.prior), ScalarKind::float32,
                        Timing::none);
  evaluate(r);
  return r;
}

/// The charge of the recording over the change of its reference.
double reference_ah(const measurement::Recording& r) {
  double charge_ah = 0;
  for (std::size_t k = 1; k < r.rows(); ++k) charge_ah += r.current_a[k] * (r.time_s[k] - r.time_s[k - 1]) / 3'600;
  return charge_ah / (r.soc_ref.back() - r.soc_ref.front());
}

TEST(CapacityEstimate, OfARealCellIsFoundWhateverItsFileStates) {
  for (const double share : {0.8, 1.0, 1.25}) {
    ReplayResult r = real_log("dyn20_P25_A002", share);
    ASSERT_TRUE(r.capacity) << share;
    EXPECT_LT(std::abs(r.capacity->value_ah - reference_ah(r.recording)), 2 * r.capacity->std_ah) << share;
    const double rmse = *r.soc.rmse;
    EXPECT_EQ(count_again(r), share != 1.0) << share;
    if (share == 1.0) continue;
    EXPECT_GT(rmse, 0.1);
    EXPECT_LT(*r.soc.rmse, 0.025) << share;
    EXPECT_GT(*r.soc.within_2_sigma, 0.95) << share;
  }
}

/// It ends above the knee, so there is less to find: the errors of neighbouring voltages are one error.
TEST(CapacityEstimate, ALogThatEndsEarlyDoesNotContradictARightFile) {
  const ReplayResult r = real_log("udds_P25_A002", 1);
  ASSERT_TRUE(r.capacity);
  EXPECT_LT(std::abs(r.capacity->value_ah - reference_ah(r.recording)), 2 * r.capacity->std_ah);
  EXPECT_FALSE(capacity_differs(r));
}

TEST(CapacityEstimate, DoesNotReplaceThatOfTheFileWithoutNeed) {
  const double file_ah = files::read_cell("a123_26650").parameters.capacity_ah;
  ReplayResult sound = log_of(0.98 * file_ah, 0.98, 0.02, 10, 1, SocPrior{0.98, 0.02});
  ASSERT_TRUE(sound.capacity);
  EXPECT_FALSE(count_again(sound)) << "within the hysteresis";
  EXPECT_FALSE(sound.counted_capacity_ah);
  // an estimate that the count with it does not confirm
  ReplayResult wrong = log_of(0.98 * file_ah, 0.98, 0.02, 10, 1, SocPrior{0.98, 0.02});
  const double final_soc = wrong.soc.final;
  wrong.capacity = CapacityEstimate{0.6 * file_ah, 0.01 * file_ah};
  EXPECT_FALSE(count_again(wrong));
  EXPECT_FALSE(wrong.counted_capacity_ah);
  EXPECT_EQ(wrong.track.rows.back().soc, final_soc) << "of the first run";
}

TEST(CapacityEstimate, TheCauseOfAContradictionIsSaid) {
  const double file_ah = files::read_cell("a123_26650").parameters.capacity_ah;
  const ReplayResult r = log_of(0.7 * file_ah, 0.98, 0.02, 2, 1, SocPrior{0.98, 0.02});
  ASSERT_EQ(r.reasons.size(), 2U);
  EXPECT_NE(r.reasons.front().find("contradict the counted charge"), std::string::npos) << r.reasons.front();
  EXPECT_NE(r.reasons.front().find("likely cause: the capacity of the cell file"), std::string::npos);
  double stated_ah = 0;
  ASSERT_EQ(std::sscanf(r.reasons.back().c_str(), "The cell holds %lf Ah", &stated_ah), 1) << r.reasons.back();
  EXPECT_NEAR(stated_ah, 0.7 * file_ah, 2 * r.capacity->std_ah);
  const ReplayResult sound = log_of(file_ah, 0.98, 0.02, 2, 1, SocPrior{0.98, 0.02});
  EXPECT_TRUE(std::none_of(sound.reasons.begin(), sound.reasons.end(), [](const std::string& reason) {
    return reason.find("The cell holds") != std::string::npos;
  }));
}

}  // namespace
}  // namespace bms::replay
