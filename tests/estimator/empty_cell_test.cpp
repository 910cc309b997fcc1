// An empty cell is empty whatever was counted: the first discharge of a cell with less capacity than its file, at every
// interval of the rows.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "estimator/soc_estimator.hpp"
#include "plant/random.hpp"
#include "plant/truth_cell.hpp"
#include "tests/cells.hpp"
#include "tests/starting_point.hpp"

namespace bms::estimator {
namespace {

struct Moment {
  double current_a, voltage_v, soc;
};

constexpr int per_s = 10;
constexpr double below_v = 3;

/// From full at C/2 and with rests to 2.6 V, then twenty minutes of small loads between 2.6 and 2.9 V.
/// left: capacity over that of the file. Every 100 ms.
std::vector<Moment> first_discharge(double left) {
  plant::CellParameters parameters{.capacity_ah = 6 * left};
  plant::Cell cell(parameters, {.soc = 1, .temperature_c = 25});
  plant::Random random(11);
  std::vector<Moment> log;
  bool empty = false, loaded = false;
  for (int k = 0, ends = 4 * 3'600 * per_s; k < ends; ++k) {
    const bool rests = k % (900 * per_s) < 120 * per_s;
    if (cell.voltage_v() < 2.6) {
      if (!empty) ends = k + 1'200 * per_s;
      empty = true;
    }
    loaded = cell.voltage_v() > (loaded ? 2.6 : 2.9);
    double load_a = rests ? 0 : -3;
    if (empty) load_a = loaded ? -1.5 : 0;
    cell.run(load_a, 25, 1.0 / per_s);
    log.push_back({load_a + 0.005 * random.normal(), cell.voltage_v() + 0.001 * random.normal(), cell.soc()});
  }
  return log;
}

struct Found {
  double error_before = 0, sigma_before = 0;  ///< the largest above below_v, and what sigma said
  double error = 0;                           ///< the largest from a quarter of an hour below it on
  double honest_after_min = 0;                ///< from that moment within 5 % or two sigma
};

/// row: in moments. last: the rows have their last current instead of their mean.
Found replay(const std::vector<Moment>& log, std::size_t row, bool last) {
  const auto cell = tests::prepared<float>();
  SocEstimator<float> estimator(starting_at(1, 0.02));
  Found found;
  std::size_t below = 0;
  for (std::size_t k = row; k <= log.size(); k += row) {
    double sum_a = 0;
    for (std::size_t j = k - row; j < k; ++j) sum_a += log[j].current_a;
    const Moment& now = log[k - 1];
    const double current_a = last ? now.current_a : sum_a / static_cast<double>(row);
    const auto e = estimator.step(cell, {k * (1'000'000 / per_s), static_cast<std::int32_t>(1e6 * current_a),
                                         static_cast<std::int32_t>(1e6 * now.voltage_v), 2'500});
    const double error = std::abs(static_cast<double>(e.soc) - now.soc), sigma = static_cast<double>(e.soc_sigma);
    if (below == 0 && now.voltage_v < below_v) below = k;
    if (below == 0 && error > found.error_before) {
      found.error_before = error;
      found.sigma_before = sigma;
    }
    if (below == 0) continue;
    const double minutes = static_cast<double>(k - below) / (60 * per_s);
    if (error > 0.05 && error > 2 * sigma) found.honest_after_min = minutes;
    if (minutes >= 15) found.error = std::max(found.error, error);
  }
  EXPECT_GT(below, 0U);
  return found;
}

TEST(EmptyCell, OfLessCapacityThanItsFileIsEmptyAtEveryInterval) {
  std::printf(
      "capacity, row, current: largest error above 3.0 V, its sigma; honest after; largest error from 15 min on\n");
  for (const double left : {0.9, 0.8, 0.7}) {
    const std::vector<Moment> log = first_discharge(left);
    for (const std::size_t row : {1U, 10U, 50U, 100U, 300U, 600U}) {
      for (const bool last : {false, true}) {
        const Found found = replay(log, row, last);
        std::printf("%.0f %%, %g s, %s: %.1f %%, %.1f %%; %.1f min; %.1f %%\n", 100 * left,
                    static_cast<double>(row) / per_s, last ? "last" : "mean", 100 * found.error_before,
                    100 * found.sigma_before, found.honest_after_min, 100 * found.error);
        EXPECT_LE(found.honest_after_min, 15) << left << ", rows of " << row << (last ? ", last" : "");
      }
    }
  }
}

}  // namespace
}  // namespace bms::estimator
