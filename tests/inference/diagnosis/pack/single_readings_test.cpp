// Packs whose log has single readings of the current, in slow rows: what the current did between them is unknown. Loads
// and cells are simulated in fine steps by this file.
#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/pack/channels.hpp"
#include "diagnosis/pack/current_kind.hpp"
#include "diagnosis/pack/diagnose_pack.hpp"
#include "diagnosis/pack/sampling_times.hpp"
#include "diagnosis/pack/shared_current.hpp"
#include "plant/random.hpp"
#include "tests/cells.hpp"

namespace bms {
namespace {

namespace dp = diagnosis::pack;

constexpr double fine_s = 0.1;
constexpr std::size_t cells = 6;

struct Log {
  double rows_s = 30, hours = 12;
  double span_s = 0;  ///< from the first to the last channel
  double start_soc = 0.9;
  unsigned seed = 1;
};

using Load = std::function<double(double time_s)>;  ///< [A]; rising times

/// Another current after a random time of that mean.
Load random_steps(double mean_s, double level_a, double spread_a, unsigned seed) {
  plant::Random random(seed);
  double until_s = 0, now_a = 0;
  return [=](double time_s) mutable {
    while (time_s >= until_s) {
      now_a = level_a + spread_a * random.normal();
      until_s += -mean_s * std::log(1 - random.uniform());
    }
    return now_a;
  };
}

struct Simulated {
  dp::PackRecording pack;
  std::vector<double> soc;  ///< true
};

/// Equal cells of the paper's. pack.soc: what a count of the readings gives.
Simulated simulate(const Log& log, Load load) {
  const auto cell = tests::prepared<double>();
  plant::Random random(1'000 + log.seed);
  Simulated s;
  s.pack.cell_v.resize(cells);
  const auto steps = static_cast<std::size_t>(std::lround(3'600 * log.hours / fine_s)),
             row = static_cast<std::size_t>(std::lround(log.rows_s / fine_s));
  std::vector<double> fine_v;
  double soc = log.start_soc, rc_v = 0;
  std::uint8_t interval = 0;
  for (std::size_t k = 0; k < steps; ++k) {
    const double now_a = load(fine_s * static_cast<double>(k));
    const auto at = model::look_up(cell, soc, interval);
    soc += now_a * fine_s / (3'600 * tests::table9.capacity_ah);
    rc_v += -std::expm1(-fine_s / (at.r1_ohm * at.c1_f)) * (at.r1_ohm * now_a - rc_v);
    fine_v.push_back(at.ocv_v + at.r0_ohm * now_a + rc_v);
    if ((k + 1) % row != 0) continue;
    s.pack.time_s.push_back(fine_s * static_cast<double>(k + 1));
    s.pack.current_a.push_back(now_a);
    s.soc.push_back(soc);
    for (std::size_t c = 0; c < cells; ++c) {
      const double late_s = log.span_s * static_cast<double>(c) / static_cast<double>(cells - 1);
      const std::size_t then = k - static_cast<std::size_t>(std::lround(late_s / fine_s));
      s.pack.cell_v[c].push_back(fine_v[then] + 0.0007 * random.normal());
    }
  }
  dp::find_current_kind(s.pack, tests::table9.capacity_ah);
  double counted = log.start_soc;
  for (std::size_t k = 0; k < s.pack.rows(); ++k) {
    counted += dp::mean_current_a(s.pack, k) * log.rows_s / (3'600 * tests::table9.capacity_ah);
    s.pack.soc.push_back(counted);
  }
  return s;
}

dp::Track track_of(const dp::PackRecording& pack) {
  dp::Track track = dp::track_of(tests::table9, pack, std::vector<double>(pack.rows(), 1.0));
  dp::set_neighbours(track, pack, {0, 1, 2}, false);
  return track;
}

/// The steps of this load stand alone. With n of them in each row n times as much would be missed in the same time.
TEST(SingleReadings, TheTimeBetweenChannelsIsAtMostThatWithOneStepInARow) {
  constexpr double span_s = 0.9;
  const dp::PackRecording pack = simulate({.rows_s = 5, .span_s = span_s}, random_steps(60, -0.3, 2, 6)).pack;
  std::vector<std::size_t> all;
  for (std::size_t c = 0; c < cells; ++c) all.push_back(c);
  const std::optional<dp::Estimated> one_step = dp::sampling_span(track_of(pack), pack, all);
  ASSERT_TRUE(one_step);
  EXPECT_LT(std::abs(one_step->value - span_s), 2 * one_step->sigma) << one_step->value;
  for (const double steps : {1.0, 2.0, 5.0, 20.0}) {
    const dp::Estimated span = dp::span_of_readings({steps * one_step->value, steps * one_step->sigma});
    EXPECT_LT(std::abs(span.value - span_s), 2 * span.sigma) << steps << ": " << span.value << " +- " << span.sigma;
  }
}

/// The count of readings walks by some percent. None of it is an offset, a gain or a capacity, and the state of charge
/// is as uncertain as stated.
TEST(SingleReadings, TheWalkOfACountIsNoFaultOfTheSensorAndHasItsSigma) {
  constexpr unsigned logs = 6;
  double squares = 0;
  std::size_t named_without = 0;
  for (unsigned seed = 1; seed <= logs; ++seed) {
    const Simulated s = simulate({.hours = 20, .seed = seed}, random_steps(8, -0.2, 2, 100 + seed));
    ASSERT_TRUE(s.pack.single_readings);
    const dp::SharedState shared = dp::shared_state_of(track_of(s.pack), s.pack);
    ASSERT_EQ(shared.not_tested, "");
    EXPECT_FALSE(shared.finding) << seed;
    dp::PackRecording exact = s.pack;
    exact.count_walk = 0;
    named_without += dp::shared_state_of(track_of(exact), exact).finding ? 1 : 0;
    ASSERT_EQ(shared.soc_sigma.size(), s.soc.size());
    for (std::size_t k = 0; k < s.soc.size(); k += 10)
      squares +=
          std::pow((shared.soc[k] - s.soc[k]) / shared.soc_sigma[k], 2) * 10 / static_cast<double>(logs * s.soc.size());
  }
  EXPECT_GT(named_without, 0) << "a count without a walk is as good: this load tests nothing";
  EXPECT_GT(std::sqrt(squares), 0.4);
  EXPECT_LT(std::sqrt(squares), 1.4);
}

/// Five rows later this load is nearly alike, so that channels that are read within a row seem to be five rows late.
TEST(SingleReadings, ALoadWithAPeriodOfSomeRowsMakesNoChannelLate) {
  constexpr double period_s = 9.9;
  dp::PackRecording pack = simulate({.rows_s = 2, .hours = 3, .span_s = 0.5}, [](double time_s) {
                             return time_s > 300 && std::fmod(time_s, period_s) < 0.4 * period_s ? -3.0 : -0.1;
                           }).pack;
  dp::PackRecording cleaned = pack;
  const dp::Channels channels = dp::check_channels(track_of(pack), cleaned);
  for (const dp::ChannelState& c : channels.cells) EXPECT_EQ(c.lag_s, 0);
  for (const dp::PackFinding& f : dp::diagnose_pack(tests::table9, pack, {}).findings)
    EXPECT_NE(f.cause, dp::Cause::late) << *f.cell << ": " << f.value << " +- " << f.sigma;
}

/// In a pack of three the usual lag is that of the cell in the middle: two that seem late by a period make it early.
TEST(SingleReadings, InAPackOfThreeALoadWithAPeriodMakesNoChannelLateOrEarly) {
  for (const double period_s : {8.3, 9.9, 14.3, 17.9, 26.3}) {
    for (const double span_s : {0.3, 0.6, 0.9}) {
      dp::PackRecording pack = simulate({.rows_s = 1, .hours = 2, .span_s = span_s}, [&](double time_s) {
                                 return time_s > 300 && std::fmod(time_s, period_s) < 0.4 * period_s ? -3.0 : -0.1;
                               }).pack;
      pack.cell_v = {pack.cell_v[0], pack.cell_v[cells / 2], pack.cell_v[cells - 1]};
      for (const dp::PackFinding& f : dp::diagnose_pack(tests::table9, pack, {}).findings)
        EXPECT_NE(f.cause, dp::Cause::late) << period_s << ", " << span_s << ", cell " << *f.cell << ": " << f.value;
    }
  }
}

/// The other way round: a lag that is there stays, whatever the fit without it says.
TEST(SingleReadings, AChannelThatIsThreeRowsLateIsNamed) {
  constexpr std::size_t late = 1, rows = 3;
  dp::PackRecording pack = simulate({.rows_s = 2, .hours = 3}, random_steps(15, -1.5, 1.5, 8)).pack;
  std::vector<double>& v = pack.cell_v[late];
  std::shift_right(v.begin(), v.end(), rows);
  bool found = false;
  for (const dp::PackFinding& f : dp::diagnose_pack(tests::table9, pack, {}).findings) {
    EXPECT_TRUE(f.cause == dp::Cause::late && f.cell == late) << "another cell or cause";
    EXPECT_NEAR(f.value, 2.0 * rows, 1);
    found = true;
  }
  EXPECT_TRUE(found);
}

}  // namespace
}  // namespace bms
