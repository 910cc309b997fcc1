// The upper half of two stacked chips is read up to 20 ms after the lower one. What this does to the state of charge of
// the pack and of its cells: a load whose current steps by 280 A at any time, also while the chips are read, and next
// to it the same readings with an upper half of the lower one's time.
//
// Both have the age of the current against the voltage, which every chip has. It makes the innovations here, but must
// not decide between states of charge (tests/estimator/aged_current_test.cpp).
#include "hal/bq76952/stack.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "estimator/pack_estimator.hpp"
#include "estimator/soc_estimator.hpp"
#include "plant/random.hpp"
#include "plant/truth_cell.hpp"
#include "tests/cell_of_capacity.hpp"
#include "tests/cells.hpp"
#include "tests/hal/stacked_board.hpp"

namespace bms {
namespace {

constexpr double capacity_ah = 200, step_a = 280, noise_v = 0.001, cells_in_parallel = capacity_ah / 6;
constexpr std::size_t cells = StackedBoard::cells, below = StackedBoard::cells_below;

/// Cells that are all alike, and a load that steps at random times.
class Load {
 public:
  explicit Load(double soc) : cell_({.step_s = 0.001}, {.soc = soc, .temperature_c = 25}) {}

  void advance_to(std::uint64_t time_us) {
    while (time_us_ < time_us) {
      if (time_us_ >= next_us_) {
        const double sign = random_.uniform() < 0.3 ? 1 : -1;
        current_a_ = current_a_ != 0 ? 0 : sign * step_a;
        next_us_ = time_us_ + static_cast<std::uint64_t>(1e6 * (0.3 + 3 * random_.uniform()));
        ++steps;
      }
      const std::uint64_t until_us = std::min({time_us, next_us_, time_us_ + 1'000});
      cell_.run(current_a_ / cells_in_parallel, 25, 1e-6 * static_cast<double>(until_us - time_us_));
      time_us_ = until_us;
    }
  }
  /// For as long as both exist.
  void act_on(StackedBoard& board) {
    board.follow = [this, &board] {
      advance_to(board.time_us);
      board.cell_v.fill(cell_.voltage_v());
      board.current_a = current_a_;
    };
  }
  double soc() const { return cell_.soc(); }

  int steps = 0;

 private:
  plant::Cell cell_;
  plant::Random random_{5};
  std::uint64_t time_us_ = 0, next_us_ = 5'000'000;
  double current_a_ = 0;
};

/// The estimators of an image, and how they do.
struct Judge {
  model::Cell<float, model::max_intervals> cell =
      tests::prepared<float>(tests::of_capacity(tests::table9, capacity_ah));
  estimator::SocEstimator<float> mean;
  estimator::PackCells<float, cells> each;
  double innovation2 = 0, error2 = 0, worst_sigmas = 0, soc = 0, sigma = 0, voltage_v = 0;
  std::array<double, cells> cell_soc{}, cell_sigma{};

  void update(const measurement::PackSample<cells>& sample, double true_soc, bool counts) {
    const auto input = estimator::mean_cell(sample, cell.plausible);
    const auto estimate = mean.step(cell, input);
    each.update(cell, sample, estimate);
    voltage_v = 1e-6 * input.voltage_uv;
    soc = static_cast<double>(estimate.soc);
    sigma = static_cast<double>(estimate.soc_sigma);
    for (std::size_t k = 0; k < cells; ++k) {
      cell_soc[k] = static_cast<double>(each[k].soc());
      cell_sigma[k] = static_cast<double>(each[k].soc_sigma());
    }
    if (!counts) return;
    const double innovation_v = voltage_v - static_cast<double>(estimate.voltage_predicted_v);
    innovation2 += innovation_v * innovation_v;
    error2 += (soc - true_soc) * (soc - true_soc);
    worst_sigmas = std::max(worst_sigmas, std::abs(soc - true_soc) / sigma);
  }
};

/// Ten minutes from a SOC on.
void drive(double soc) {
  StackedBoard board;
  Load load(soc);
  load.act_on(board);
  hal::bq76952::Stack stack;
  stack.start();
  hal::bq76952::Stack::Inputs inputs;
  measurement::PackSample<cells> sample;
  Judge apart, together;
  plant::Random random(17);
  constexpr int begins = 100, samples = 6'000;
  int seen = 0;
  double moved2 = 0, soc2 = 0, worst_soc = 0, worst_cell = 0, sigma_ratio = 0;
  for (int k = 0; k < samples; ++k) {
    for (const std::uint64_t due_us = 100'000ULL * static_cast<std::uint64_t>(k + 1); board.time_us < due_us;)
      board.advance(std::min<std::uint64_t>(1'000, due_us - board.time_us));
    inputs.time_us = board.time_us;
    stack.read(inputs, {}, sample);
    if (k < begins) continue;
    ASSERT_NE(sample.pack_uv, measurement::no_reading) << k;
    seen += std::abs(sample.cell_uv[0] - sample.cell_uv[below]) > 20'000 ? 1 : 0;
    measurement::PackSample<cells> reference = sample;
    std::copy_n(sample.cell_uv.begin(), cells - below, reference.cell_uv.begin() + below);
    for (std::size_t cell = 0; cell < cells; ++cell) {
      const auto noise_uv = static_cast<std::int32_t>(1e6 * noise_v * random.normal());
      sample.cell_uv[cell] += noise_uv;
      reference.cell_uv[cell] += noise_uv;
    }
    const bool counts = k > samples / 4;
    apart.update(sample, load.soc(), counts);
    together.update(reference, load.soc(), counts);
    if (!counts) continue;
    const double moved_v = apart.voltage_v - together.voltage_v, moved_soc = apart.soc - together.soc;
    moved2 += moved_v * moved_v;
    soc2 += moved_soc * moved_soc;
    worst_soc = std::max(worst_soc, std::abs(moved_soc) / together.sigma);
    sigma_ratio = std::max(sigma_ratio, std::abs(apart.sigma / together.sigma - 1));
    for (std::size_t cell = 0; cell < cells; ++cell)
      worst_cell =
          std::max(worst_cell, std::abs(apart.cell_soc[cell] - together.cell_soc[cell]) / together.cell_sigma[cell]);
  }
  const double n = samples - samples / 4 - 1, share = std::sqrt(moved2 / together.innovation2);
  std::printf(
      "from %.0f %%: %d steps, %d samples with the halves 20 mV apart; skew of the mean cell: %.2f mV RMS; "
      "innovation %.2f mV RMS with it, %.2f mV without (share of the skew %.3f); SOC error %.3f %% RMS with, %.3f %% "
      "without, %.2f and %.2f sigma at most; SOC moved by %.4f %% RMS, %.3f sigma at most; a cell by %.3f sigma\n",
      100 * soc, load.steps, seen, 1e3 * std::sqrt(moved2 / n), 1e3 * std::sqrt(apart.innovation2 / n),
      1e3 * std::sqrt(together.innovation2 / n), share, 100 * std::sqrt(apart.error2 / n),
      100 * std::sqrt(together.error2 / n), apart.worst_sigmas, together.worst_sigmas, 100 * std::sqrt(soc2 / n),
      worst_soc, worst_cell);
  EXPECT_GT(seen, 20) << "the load steps while the chips are read";
  EXPECT_LT(share, 0.15) << "of the innovations";
  EXPECT_LT(worst_soc, 0.1);
  EXPECT_LT(worst_cell, 0.5);
  EXPECT_LT(sigma_ratio, 0.1);
  EXPECT_LT(together.worst_sigmas, 3) << "the age of the current alone";
}

TEST(HalvesApart, MoveTheEstimatesByASmallPartOfTheirSigma) {
  for (const double soc : {0.95, 0.55}) {
    SCOPED_TRACE(soc);
    drive(soc);
    if (HasFatalFailure()) return;
  }
}

}  // namespace
}  // namespace bms
