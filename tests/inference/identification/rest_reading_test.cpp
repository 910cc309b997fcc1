#include "identification/rest_reading.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

namespace bms::identification {
namespace {

/// A cell with one RC element, in closed form for stretches of constant current.
struct Cell {
  double r0_ohm = 0.0126, r1_ohm = 0.0192, tau_s = 60, ocv_v = 3.2, slope_v = 0.3, capacity_ah = 6;
};

struct Stretch {
  double current_a, duration_s;
};

struct Sampling {
  double step_s = 1, noise_v = 0.001, noise_a = 0,
         shift_s = 0;  ///< shift_s: of the current's steps against the samples
  unsigned seed = 1;
};

/// Current: mean over the interval that ends with the sample; voltage at the sample, before a step at the same instant.
Data recording(const Cell& cell, const std::vector<Stretch>& stretches, const Sampling& sampling = {}) {
  std::mt19937 random(sampling.seed);
  std::normal_distribution<double> noise(0, 1);
  Data data;
  data.capacity_ah = cell.capacity_ah;
  double all_s = 0;
  for (const Stretch& s : stretches) all_s += s.duration_s;
  std::size_t now = 0;
  double left_s = stretches[0].duration_s + sampling.shift_s, v_rc = 0, charge_c = 0;
  for (double t = 0; t < all_s - 1e-9; t += sampling.step_s) {
    double before_c = charge_c, rest_of_step_s = t == 0 ? 0 : sampling.step_s;
    while (rest_of_step_s > 1e-9) {
      if (left_s < 1e-9 && now + 1 < stretches.size()) left_s += stretches[++now].duration_s;
      const double part_s = std::min(rest_of_step_s, left_s), i = stretches[now].current_a,
                   p = std::exp(-part_s / cell.tau_s);
      v_rc = p * v_rc + (1 - p) * cell.r1_ohm * i;
      charge_c += part_s * i;
      left_s -= part_s;
      rest_of_step_s -= part_s;
    }
    const double mean_a = t == 0 ? 0 : (charge_c - before_c) / sampling.step_s, i = stretches[now].current_a;
    data.time_s.edit().push_back(t);
    data.current_a.edit().push_back(mean_a + sampling.noise_a * noise(random));
    data.voltage_v.edit().push_back(cell.ocv_v + cell.slope_v * charge_c / cell.capacity_ah / 3'600 + v_rc +
                                    (t == 0 ? 0 : cell.r0_ohm * i) + sampling.noise_v * noise(random));
  }
  return data;
}

/// A tenth of the charge at 1C and ten minutes of rest, as in the paper's OCV test.
std::vector<Stretch> ocv_test(double current_a, int times = 3) {
  std::vector<Stretch> all{{0, 60}};
  for (int k = 0; k < times; ++k) all.insert(all.end(), {{current_a, 360}, {0, 600}});
  return all;
}

struct Relative {
  double r0, r1, tau;
};

void expect_cell(const RestReadings& readings, const Cell& cell, const Relative& tolerance, const std::string& what) {
  EXPECT_EQ(readings.reason, "") << what;
  EXPECT_NEAR(readings.r0_ohm / cell.r0_ohm, 1, tolerance.r0) << what;
  EXPECT_NEAR(readings.r1_ohm / cell.r1_ohm, 1, tolerance.r1) << what;
  EXPECT_NEAR(readings.tau_s / cell.tau_s, 1, tolerance.tau) << what;
  EXPECT_NEAR(readings.c1_f / (cell.tau_s / cell.r1_ohm), 1, tolerance.r1 + tolerance.tau) << what;
}

TEST(RestReading, FindsTheCellAt1HzAnd10HzWith1mVOfNoiseInBothCurrentDirections) {
  for (const double step_s : {1.0, 0.1}) {
    for (const double current_a : {-6.0, 6.0, -3.0}) {
      for (unsigned seed = 1; seed <= 8; ++seed) {
        const RestReadings r = read_rests(recording({}, ocv_test(current_a), {.step_s = step_s, .seed = seed}));
        ASSERT_EQ(r.rests.size(), 3U);
        EXPECT_EQ(r.r0_from, 3U);
        EXPECT_EQ(r.rc_from, 3U);
        expect_cell(r, {}, {0.03, 0.1, 0.15},
                    std::to_string(step_s) + " s, " + std::to_string(current_a) + " A, seed " + std::to_string(seed));
      }
    }
  }
}

TEST(RestReading, WithoutNoiseIsRightToAPerThousandOfR0AndBetter) {
  // The straight line under 5 s of load does not bend as the voltage does: (5/60)^2 / 12 of R1's 115 mV, where that has
  // not settled.
  for (const Cell& cell : {Cell{}, Cell{.r0_ohm = 0.03, .r1_ohm = 0.005, .tau_s = 12},
                           Cell{.r0_ohm = 0.002, .r1_ohm = 0.03, .tau_s = 150}}) {
    expect_cell(read_rests(recording(cell, ocv_test(-6), {.noise_v = 0})), cell, {5e-3, 1e-3, 1e-3},
                std::to_string(cell.tau_s));
  }
}

// 1 min load, 30 s rest: (c - b) / dI sees a fraction of R1; the felt current of the history makes it whole.
TEST(RestReading, ReadsR1WholeFromShortLoadsAndShortRestsWherePointsDoNot) {
  std::vector<Stretch> pulses{{0, 60}};
  for (int k = 0; k < 10; ++k) pulses.insert(pulses.end(), {{-6, 60}, {0, 40}});
  const Cell cell{.tau_s = 40};
  const RestReadings r = read_rests(recording(cell, pulses, {.noise_v = 0.0002}));
  ASSERT_EQ(r.rests.size(), 10U);
  expect_cell(r, cell, {0.03, 0.1, 0.15}, "pulses");
  for (const RestReading& rest : r.rests) {
    EXPECT_LT(rest.points.r1_ohm, 0.7 * cell.r1_ohm);
    EXPECT_NEAR(rest.relaxed_fraction, 1 - std::exp(-1.0), 0.08);
  }
}

// At 1 Hz and tau = 20 s the first sample has relaxed by 5 % of 115 mV: 5.6 mV of 76 mV, counted as R0 by the points.
TEST(RestReading, CarriesTheFirstSampleBackToTheStep) {
  const Cell cell{.tau_s = 20};
  const RestReadings r = read_rests(recording(cell, ocv_test(-6), {.noise_v = 0}));
  ASSERT_EQ(r.rests.size(), 3U);
  const double relaxed = cell.r1_ohm * (1 - std::exp(-1 / cell.tau_s));
  EXPECT_NEAR(r.rests[0].r0_ohm, cell.r0_ohm, 0.005 * cell.r0_ohm);
  EXPECT_GT(r.rests[0].points.r0_ohm, cell.r0_ohm + relaxed * 0.9);
}

TEST(RestReading, PointsAreAppendixAOnASmoothCurve) {
  const Cell cell{.slope_v = 0};
  const RestReadings r = read_rests(recording(cell, {{0, 60}, {-6, 1'200}, {0, 1'200}}, {.step_s = 0.1, .noise_v = 0}));
  ASSERT_EQ(r.rests.size(), 1U);
  const PointReading& p = r.rests[0].points;
  const double v_rc = 6 * cell.r1_ohm;  // settled
  EXPECT_NEAR(p.a_v, cell.ocv_v - v_rc - 6 * cell.r0_ohm, 1e-6);
  EXPECT_NEAR(p.b_v, cell.ocv_v - v_rc * std::exp(-0.1 / cell.tau_s), 1e-6);  // the first sample after the step
  EXPECT_NEAR(p.c_v, cell.ocv_v, 1e-6);
  EXPECT_NEAR(p.d_v, p.b_v + 0.633 * (p.c_v - p.b_v), 1e-12);
  EXPECT_NEAR(p.time_constant_s, cell.tau_s, 0.01 * cell.tau_s);
  EXPECT_NEAR(p.r0_ohm, (p.b_v - p.a_v) / 6, 1e-12);
  EXPECT_NEAR(p.r1_ohm, (p.c_v - p.b_v) / 6, 1e-12);
  EXPECT_NEAR(p.c1_f, p.time_constant_s / p.r1_ohm, 1e-9);
  EXPECT_NEAR(r.rests[0].time_s, 1'260, 1e-9);
  EXPECT_NEAR(r.rests[0].load_a, -6, 1e-9);
}

// The printed equations on samples of 1 s: R0 is too large by the first second of the relaxation, R1 too small by it.
TEST(RestReading, PointsUseTheSamplesNextToTheStep) {
  const Cell cell{.tau_s = 12, .slope_v = 0};
  for (const double rest_s : {600.0, 3'600.0}) {
    const RestReadings r = read_rests(recording(cell, {{0, 60}, {-6, 360}, {0, rest_s}}, {.step_s = 1, .noise_v = 0}));
    ASSERT_EQ(r.rests.size(), 1U);
    const double first_second = cell.r1_ohm * (1 - std::exp(-1 / cell.tau_s));
    EXPECT_NEAR(r.rests[0].points.r0_ohm, cell.r0_ohm + first_second, 1e-6) << rest_s;
    EXPECT_NEAR(r.rests[0].points.r1_ohm, cell.r1_ohm - first_second, 1e-6) << rest_s;
  }
}

TEST(RestReading, TakesTheStepsInstantWithinASampleFromItsMeanCurrent) {
  for (const double shift_s : {0.2, 0.5, 0.9, 0.95}) {
    const Cell cell{.tau_s = 20};
    const RestReadings r = read_rests(recording(cell, ocv_test(-6), {.noise_v = 0, .shift_s = shift_s}));
    ASSERT_EQ(r.rests.size(), 3U) << shift_s;
    EXPECT_NEAR(r.rests[0].time_s, 420 + shift_s, 1e-6);
    expect_cell(r, cell, {5e-3, 2e-3, 1e-3}, std::to_string(shift_s));
  }
}

TEST(RestReading, StandardDeviationsAreWhatRepetitionScatters) {
  double r0_squares = 0, r1_squares = 0, tau_squares = 0, c1_squares = 0;
  RestReading r;
  const Cell cell;
  constexpr int trials = 200;
  for (unsigned seed = 1; seed <= trials; ++seed) {
    r = read_rests(recording(cell, ocv_test(-6, 1), {.seed = seed})).rests.at(0);
    r0_squares += std::pow((r.r0_ohm - cell.r0_ohm) / r.r0_std_ohm, 2);
    r1_squares += std::pow((r.r1_ohm - cell.r1_ohm) / r.r1_std_ohm, 2);
    tau_squares += std::pow((r.tau_s - cell.tau_s) / r.tau_std_s, 2);
    c1_squares += std::pow((r.c1_f - cell.tau_s / cell.r1_ohm) / r.c1_std_f, 2);
  }
  // chi square: sqrt(1 / 400) = 0.05, three of them
  for (const double squares : {r0_squares, r1_squares, tau_squares, c1_squares})
    EXPECT_NEAR(std::sqrt(squares / trials), 1, 0.15);
  EXPECT_NEAR(r.residual_v, 0.001, 1e-4);
}

TEST(RestReading, PassesOverSpikesHolesAndUnevenSamples) {
  Data data = recording({}, ocv_test(-6));
  for (std::size_t k = 7; k < data.size(); k += 50) data.voltage_v.edit()[k] += 0.5;
  for (std::size_t k = 9; k < data.size(); k += 30) data.voltage_v.edit()[k] = std::nan("");
  Data thinned;
  thinned.capacity_ah = data.capacity_ah;
  for (std::size_t k = 0; k < data.size(); ++k) {
    const bool resting_long = k % 960 > 500 && k % 3 != 0;  // every third sample of the end of a rest
    if (resting_long) continue;
    thinned.time_s.edit().push_back(data.time_s[k]);
    thinned.current_a.edit().push_back(data.current_a[k]);
    thinned.voltage_v.edit().push_back(data.voltage_v[k]);
  }
  expect_cell(read_rests(thinned), {}, {0.03, 0.1, 0.15}, "spikes");
}

TEST(RestReading, IsNotBiasedByCurrentNoiseOrASmallCurrentAtRest) {
  expect_cell(read_rests(recording({}, ocv_test(-6), {.noise_a = 0.02})), {}, {0.03, 0.1, 0.15}, "noise");
  std::vector<Stretch> trickle = ocv_test(-6);
  for (Stretch& s : trickle) {
    if (s.current_a == 0) s.current_a = -0.05;
  }
  expect_cell(read_rests(recording({}, trickle)), {}, {0.03, 0.1, 0.15}, "trickle");
}

// One bad rest of five does not move the median; one rest too short for tau does not count for it.
TEST(RestReading, CombinesTheUsableRestsByTheirMedian) {
  Data data = recording({}, ocv_test(-6, 5));
  for (std::size_t k = 430; k < 1'000; ++k) data.voltage_v.edit()[k] += 0.05 * std::sin(static_cast<double>(k) / 20);
  expect_cell(read_rests(data), {}, {0.03, 0.1, 0.15}, "one of five");

  std::vector<Stretch> mixed = ocv_test(-6, 2);
  mixed.insert(mixed.end(), {{-6, 60}, {0, 32}});
  const RestReadings r = read_rests(recording({.tau_s = 200}, mixed));
  ASSERT_EQ(r.rests.size(), 3U);
  EXPECT_EQ(r.r0_from, 3U);
  EXPECT_EQ(r.rc_from, 2U);
  EXPECT_FALSE(r.rests[2].rc_usable);
}

TEST(RestReading, GivesTheReasonIfThereIsNothingToRead) {
  const auto reason = [](const std::vector<Stretch>& s) {
    const RestReadings r = read_rests(recording({}, s));
    EXPECT_TRUE(r.rests.empty());
    EXPECT_TRUE(std::isnan(r.r0_ohm) && std::isnan(r.r1_ohm) && std::isnan(r.c1_f) && std::isnan(r.tau_s));
    return r.reason;
  };
  EXPECT_THAT(reason({{0, 600}}), testing::HasSubstr("never reaches"));
  EXPECT_THAT(reason({{-0.3, 600}, {0, 600}}), testing::HasSubstr("never reaches"));  // C/20
  EXPECT_THAT(reason({{-6, 600}, {0, 20}, {-6, 300}}), testing::HasSubstr("long enough"));
  EXPECT_THAT(reason({{0, 100}, {-6, 600}}), testing::HasSubstr("long enough"));
  const RestReadings nothing = read_rests({{}, {}, {}, 6});
  EXPECT_TRUE(nothing.rests.empty());
  EXPECT_FALSE(nothing.reason.empty());

  Data blind = recording({}, ocv_test(-6));
  for (double& v : blind.voltage_v.edit()) v = std::nan("");
  EXPECT_THAT(read_rests(blind).reason, testing::HasSubstr("too few measured"));
  Data reversed = recording({}, ocv_test(-6));
  for (double& i : reversed.current_a.edit()) i = -i;
  EXPECT_THAT(read_rests(reversed).reason, testing::HasSubstr("sign"));
  const RestReadings brief = read_rests(recording({.tau_s = 500}, {{-6, 600}, {0, 35}}));
  EXPECT_THAT(brief.reason, testing::HasSubstr("time constant"));
  EXPECT_NEAR(brief.r0_ohm, 0.0126, 0.001);
}

TEST(RestReading, RejectsInvalidColumns) {
  const Data good = recording({}, ocv_test(-6, 1));
  Data bad = good;
  bad.capacity_ah = 0;
  EXPECT_THROW(read_rests(bad), std::invalid_argument);
  bad = good;
  bad.voltage_v.edit().pop_back();
  EXPECT_THROW(read_rests(bad), std::invalid_argument);
  bad = good;
  bad.time_s.edit()[5] = bad.time_s[4];
  EXPECT_THROW(read_rests(bad), std::invalid_argument);
  bad = good;
  bad.current_a.edit()[5] = std::nan("");
  EXPECT_THROW(read_rests(bad), std::invalid_argument);
}

}  // namespace
}  // namespace bms::identification
