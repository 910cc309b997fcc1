// What the current of a row is, and how wrong a count of single readings is. Loads and cells are formulas of this file.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
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

}  // namespace
