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
