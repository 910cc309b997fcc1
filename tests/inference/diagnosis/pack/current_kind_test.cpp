// What the current of a row is, and how wrong a count of single readings is. Loads and cells are formulas of this file.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "diagnosis/pack/channels.hpp"
#include "diagnosis/pack/current_kind.hpp"
#include "diagnosis/pack/pack_recording.hpp"
#include "diagnosis/pack/track.hpp"
#include "tests/cells.hpp"

namespace {

namespace dp = bms::diagnosis::pack;

constexpr double capacity_ah = 100, hours = 4;

/// Switched between random currents, on average every `mean_s`; a sample each second.
std::vector<double> switched(double mean_s, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<double> a(static_cast<std::size_t>(3600 * hours));
  double now = 0;
  for (double& value : a) {
    if (uniform(random) < 1 / mean_s) now = 80 * (uniform(random) - 0.7);
    value = now;
  }
  return a;
}

/// Four cells of 0.6 mOhm and an RC element of 0.4 mOhm, 40 s; rows of `row` seconds.
dp::PackRecording pack_of(const std::vector<double>& a, std::size_t row, bool readings, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 0.0005);
  dp::PackRecording pack;
  pack.cell_v.resize(4);
  double rc_v = 0, sum_a = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    rc_v += -std::expm1(-1 / 40.0) * (0.0004 * a[k] - rc_v);
    sum_a += a[k];
    if ((k + 1) % row != 0) continue;
    pack.time_s.push_back(static_cast<double>(k + 1));
    pack.current_a.push_back(readings ? a[k] : sum_a / static_cast<double>(row));
    for (auto& v : pack.cell_v) v.push_back(3.3 + 0.0006 * a[k] + rc_v + noise(random));
    sum_a = 0;
  }
  return pack;
}

TEST(CurrentKind, SingleReadingsAndMeansAreDistinguishedUnderFastAndSlowLoads) {
  for (const std::size_t row : {5U, 10U, 30U}) {
    for (const double mean_s : {3.0, 20.0, 120.0}) {
      for (const bool readings : {true, false}) {
        dp::PackRecording pack = pack_of(switched(mean_s, 7), row, readings, 8);
        dp::find_current_kind(pack, capacity_ah);
        EXPECT_EQ(pack.single_readings, readings) << "rows of " << row << " s, a step each " << mean_s << " s";
        EXPECT_EQ(pack.count_walk > 0, readings);
      }
    }
  }
}

TEST(CurrentKind, TheErrorOfACountIsAsLargeAsStated) {
  for (const std::size_t row : {5U, 30U}) {
    for (const double mean_s : {3.0, 120.0}) {
      double squares = 0, stated = 0;
      constexpr unsigned seeds = 60;
      for (unsigned seed = 1; seed <= seeds; ++seed) {
        const std::vector<double> a = switched(mean_s, seed);
        dp::PackRecording pack = pack_of(a, row, true, seed);
        dp::find_current_kind(pack, capacity_ah);
        double counted_as = 0, true_as = 0;
        for (std::size_t k = 1; k < pack.rows(); ++k)
          counted_as += dp::mean_current_a(pack, k) * static_cast<double>(row);
        for (std::size_t k = row; k < pack.rows() * row; ++k) true_as += a[k];
        squares += std::pow((counted_as - true_as) / 3600 / capacity_ah, 2) / seeds;
        stated += pack.count_walk * std::sqrt(hours) / seeds;
      }
      EXPECT_GT(stated, 0.65 * std::sqrt(squares)) << row << " " << mean_s;
      EXPECT_LT(stated, 1.6 * std::sqrt(squares)) << row << " " << mean_s;
    }
  }
}

/// A pump whose period is nearly two rows: the rows repeat, and so does every lag behind the current.
TEST(CurrentKind, NoChannelIsLateUnderALoadWithAPeriod) {
  std::vector<double> a(static_cast<std::size_t>(3600 * hours));
  for (std::size_t k = 0; k < a.size(); ++k) a[k] = std::fmod(static_cast<double>(k), 66.4) < 30 ? -60 : -2;
  for (const bool readings : {true, false}) {
    dp::PackRecording pack = pack_of(a, 30, readings, 3);
    pack.soc.assign(pack.rows(), 0.5);
    const dp::Track track = dp::track_of(bms::tests::table9, pack);
    const dp::Channels channels = dp::check_channels(track, pack);
    for (const dp::ChannelState& state : channels.cells) EXPECT_EQ(state.lag_s, 0) << readings;
    EXPECT_TRUE(channels.late(30).empty());
  }
}

/// Charge that the rows count, and of this file's load in the same time [Ah].
std::pair<double, double> counted_and_true_ah(const dp::PackRecording& pack, const std::vector<double>& a) {
  double counted_as = 0, true_as = 0;
  for (std::size_t k = 1; k < pack.rows(); ++k)
    counted_as += dp::mean_current_a(pack, k) * (pack.time_s[k] - pack.time_s[k - 1]);
  for (auto k = static_cast<std::size_t>(pack.time_s.front()); k < static_cast<std::size_t>(pack.time_s.back()); ++k)
    true_as += a[k];
  return {counted_as / 3600, true_as / 3600};
}

/// Loads whose means look like readings: smooth over rows, and steps between rows.
std::vector<double> smooth(double period_s) {
  std::vector<double> a(static_cast<std::size_t>(3600 * hours));
  for (std::size_t k = 0; k < a.size(); ++k)
    a[k] = -20 - 40 * std::sin(2 * std::numbers::pi * static_cast<double>(k) / period_s);
  return a;
}

std::vector<double> stepping_with_rows(std::size_t row) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-60, 20);
  std::vector<double> a(static_cast<std::size_t>(3600 * hours));
  for (std::size_t k = 0; k < a.size(); ++k) a[k] = k % (3 * row) == 0 ? uniform(random) : a[k - 1];
  return a;
}

TEST(CurrentKind, MeansThatLookLikeReadingsAreCountedAsWell) {
  constexpr std::size_t row = 10;
  for (const std::vector<double>& a : {smooth(300), smooth(60), stepping_with_rows(row)}) {
    dp::PackRecording pack = pack_of(a, row, false, 4);
    dp::find_current_kind(pack, capacity_ah);
    EXPECT_TRUE(pack.single_readings);  // as the header says; else this load tests nothing
    const auto [counted_ah, true_ah] = counted_and_true_ah(pack, a);
    EXPECT_LT(true_ah, -40);
    EXPECT_NEAR(counted_ah, true_ah, 80.0 * row / 2 / 3600);  // half a row of the first and the last current
  }
}

/// The log ends at -40 A and goes on at rest after 8 minutes.
TEST(CurrentKind, TwoReadingsSayNothingOfAGapBetweenThem) {
  std::vector<double> a = switched(60, 9);
  std::fill(a.begin() + 7'000, a.begin() + 7'200, -40.0);
  std::fill(a.begin() + 7'200, a.end(), 0.0);
  dp::PackRecording pack = pack_of(a, 10, true, 4);
  const auto end_of = [](auto& column) {
    column.erase(column.begin() + 720, column.begin() + 767);  // the rows until 7680 s
  };
  end_of(pack.time_s);
  end_of(pack.current_a);
  for (auto& v : pack.cell_v) end_of(v);
  dp::find_current_kind(pack, capacity_ah);
  ASSERT_TRUE(pack.single_readings);
  EXPECT_EQ(pack.time_s[720] - pack.time_s[719], 480);
  EXPECT_EQ(pack.current_a[719], -40);
  EXPECT_EQ(dp::mean_current_a(pack, 720), 0);
  EXPECT_EQ(dp::mean_current_a(pack, 719), -40);
  EXPECT_NE(dp::mean_current_a(pack, 300), 0);
}

/// Cells 20 mV apart, one of them read `late` rows after the others.
dp::PackRecording unequal_cells(const std::vector<double>& a, std::size_t row, std::size_t cells, std::size_t late_cell,
                                std::size_t late) {
  const dp::PackRecording four = pack_of(a, row, false, 3);
  std::mt19937 random(12);
  std::normal_distribution<double> noise(0, 0.0005);
  dp::PackRecording pack = four;
  pack.soc.assign(pack.rows(), 0.5);
  pack.cell_v.assign(cells, {});
  for (std::size_t c = 0; c < cells; ++c) {
    for (std::size_t k = 0; k < pack.rows(); ++k) {
      const std::size_t from = c == late_cell ? std::max(k, late) - late : k;
      pack.cell_v[c].push_back(four.cell_v[0][from] + 0.02 * static_cast<double>(c) + noise(random));
    }
  }
  return pack;
}

std::vector<std::size_t> late_of(dp::PackRecording pack, double row_s) {
  const dp::Track track = dp::track_of(bms::tests::table9, pack);
  return dp::check_channels(track, pack).late(row_s);
}

TEST(LateChannels, OneOfFewUnequalCellsIsFoundWhereverItsVoltageLies) {
  for (const std::size_t cells : {3U, 4U, 5U}) {
    for (const std::size_t late_cell : {cells / 2, cells - 1}) {
      for (const std::size_t late_s : {6U, 10U}) {
        const dp::PackRecording pack = unequal_cells(switched(20, 6), 1, cells, late_cell, late_s);
        EXPECT_EQ(late_of(pack, 1), std::vector<std::size_t>{late_cell}) << cells << " cells, " << late_s << " s";
      }
    }
    EXPECT_TRUE(late_of(unequal_cells(switched(20, 6), 1, cells, 0, 0), 1).empty()) << cells << " cells";
  }
}

TEST(LateChannels, NoneOfFewUnequalCellsUnderALoadWithAPeriod) {
  std::vector<double> a(static_cast<std::size_t>(3600 * hours));
  for (std::size_t k = 0; k < a.size(); ++k) a[k] = std::fmod(static_cast<double>(k), 66.4) < 30 ? -60 : -2;
  for (const std::size_t cells : {3U, 5U}) {
    for (const std::size_t row : {1U, 30U})
      EXPECT_TRUE(late_of(unequal_cells(a, row, cells, 0, 0), static_cast<double>(row)).empty()) << cells << " " << row;
  }
}

}  // namespace
