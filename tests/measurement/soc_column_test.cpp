// The SOC column of logs that a generator of their own makes: 40 with a planted fault of six kinds, 20 sound ones. The
// generator shares nothing with the model: its cell is a formula, and its BMS counts in steps of its own.
#include "measurement/soc_column.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <string>

#include <fmt/format.h>

namespace bms::measurement {
namespace {

struct Planted {
  SocFault fault = SocFault::jump;
  double time_s = 0, size = 0;
};

/// A voltage of an iron phosphate cell by a formula: steep at both ends and flat between them.
double rest_voltage(double soc) {
  return 3.25 + 0.08 * soc + 0.06 * std::tanh((soc - 0.95) * 30) - 0.5 * std::exp(-soc * 25);
}
double table_soc(double voltage) {
  double low = 0, high = 1;
  for (int k = 0; k < 40; ++k) (rest_voltage((low + high) / 2) < voltage ? low : high) = (low + high) / 2;
  return low;
}

struct Log {
  Recording recording;
  Planted planted;
};

Recording recording_of(std::vector<double> time_s, std::vector<double> current_a, std::vector<double> voltage_v,
                       std::vector<double> soc, std::string name) {
  Recording r;
  r.time_s = std::move(time_s);
  r.current_a = std::move(current_a);
  r.voltage_v = std::move(voltage_v);
  r.soc_ref = std::move(soc);
  r.path = std::move(name);
  return r;
}

/// Duty of hours: blocks of charge, discharge and rest, with ripple. The column has steps of 0.01 to 1 %.
Log make_log(unsigned seed, const SocFault* fault) {
  std::mt19937 random(seed);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * std::uniform_real_distribution<double>(0, 1)(random);
  };
  const auto normal = [&] { return std::normal_distribution<double>()(random); };
  const double capacity_ah = uniform(50, 300), period_s = std::vector<double>{1, 2, 5, 10, 30}[random() % 5];
  const double step = std::vector<double>{1e-4, 1e-3, 5e-3, 1e-2}[random() % 4], hours = uniform(3, 9);
  const double resistance_v = uniform(0.02, 0.06);  // at one capacity an hour
  double soc = uniform(0.4, 0.7), count = soc, rate = 0, block_s = 0;
  Log log;
  const auto rows = static_cast<std::size_t>(hours * 3'600 / period_s);
  const double at_s = uniform(0.25, 0.7) * hours * 3'600;
  if (fault != nullptr) log.planted = {*fault, at_s, 0};
  const double sign = random() % 2 == 0 ? 1 : -1, jump = sign * uniform(0.04, 0.25),
               ratio = 1 + sign * uniform(0.15, 0.35);
  const double drift_per_s = sign * uniform(0.06, 0.15) / (hours * 3'600 - at_s), held_s = uniform(2'400, 4'800);
  double stuck = -1;
  std::vector<double> t, a, v, s;
  for (std::size_t k = 0; k < rows; ++k) {
    const double time_s = static_cast<double>(k) * period_s;
    if (time_s >= block_s) {
      const std::vector<double> rates = {-0.5, -0.3, 0.4, 0.2, 0, -0.4};
      rate = rates[random() % rates.size()];
      if (soc > 0.75) rate = -std::abs(rate) - 0.1;
      if (soc < 0.3) rate = std::abs(rate) + 0.1;
      if (fault != nullptr && *fault == SocFault::stuck && std::abs(time_s - at_s) < 900) rate = soc > 0.5 ? -0.5 : 0.5;
      block_s = time_s + uniform(600, 3'000);
    }
    const double current = capacity_ah * rate * (1 + 0.1 * normal() * (rate != 0 ? 1 : 0));
    const double move = current * period_s / 3'600 / capacity_ah;
    soc = std::clamp(soc + move, 0.0, 1.0);
    count += fault != nullptr && *fault == SocFault::capacity ? move * ratio : move;
    if (fault != nullptr && *fault == SocFault::drift && time_s > at_s) count += drift_per_s * period_s;
    const bool now = time_s >= at_s && time_s < at_s + period_s;
    count = std::clamp(count, 0.0, 1.0);
    if (fault != nullptr && *fault == SocFault::jump && now) {
      log.planted.size = std::clamp(count + jump, 0.0, 1.0) - count;
      count += log.planted.size;
    }
    if (fault != nullptr && *fault == SocFault::reset && now) count = 1;
    double shown = count;
    const double voltage = rest_voltage(soc) + resistance_v * current / capacity_ah + 3e-4 * normal();
    if (fault != nullptr && *fault == SocFault::table) shown = table_soc(voltage);
    shown = std::round(shown / step) * step;
    if (fault != nullptr && *fault == SocFault::stuck && time_s >= at_s && time_s < at_s + held_s) {
      if (stuck < 0) stuck = shown;
      shown = stuck;
    }
    t.push_back(time_s);
    a.push_back(current);
    v.push_back(voltage);
    s.push_back(shown);
  }
  if (fault != nullptr && *fault == SocFault::capacity) log.planted.size = capacity_ah / ratio;
  log.recording =
      recording_of(t, a, v, s, fmt::format("{} Ah, rows of {} s, steps of {}", capacity_ah, period_s, step));
  log.planted.time_s = fault != nullptr && (*fault == SocFault::capacity || *fault == SocFault::table) ? 0 : at_s;
  return log;
}

double capacity_of(const Log& log) { return std::stod(log.recording.path); }

/// A drift begins slowly: its time is right within a fifth of the log, another one within two rows or a minute.
bool is_right(const Log& log, const SocColumn& column) {
  const double within_s = log.planted.fault == SocFault::drift || log.planted.fault == SocFault::stuck
                              ? log.recording.duration_s() / 5
                              : std::max(60.0, 2 * (log.recording.time_s[1] - log.recording.time_s[0]));
  const double slow_s = log.planted.fault == SocFault::table ? log.recording.duration_s() / 3 : within_s;
  return std::any_of(column.events.begin(), column.events.end(), [&](const SocEvent& e) {
    return e.fault == log.planted.fault && std::abs(e.time_s - log.planted.time_s) <= slow_s;
  });
}

TEST(SocColumn, PlantedFaultsAreNamedWithTheirTimeAndSoundColumnsAreNotBlamed) {
  constexpr std::array faults = {SocFault::jump,  SocFault::reset,    SocFault::stuck,
                                 SocFault::drift, SocFault::capacity, SocFault::table};
  int right = 0, blamed = 0;
  std::string wrong;
  for (unsigned k = 0; k < 40; ++k) {
    const SocFault fault = faults[k % faults.size()];
    const Log log = make_log(1'000 + k, &fault);
    const SocColumn column = judge_soc_column(log.recording, capacity_of(log));
    const bool good = is_right(log, column);
    right += good ? 1 : 0;
    if (!good)
      wrong += fmt::format("{} at {:.0f} s ({}): {}\n", name_of(fault), log.planted.time_s, log.recording.path,
                           sentence_of(column, 0, capacity_of(log)));
  }
  for (unsigned k = 0; k < 20; ++k) {
    const Log log = make_log(2'000 + k, nullptr);
    const SocColumn column = judge_soc_column(log.recording, capacity_of(log));
    blamed += column.is_count ? 0 : 1;
    if (!column.is_count)
      wrong += "sound (" + log.recording.path + "): " + sentence_of(column, 0, capacity_of(log)) + "\n";
  }
  EXPECT_GE(right, 36) << wrong;
  EXPECT_EQ(blamed, 0) << wrong;
  RecordProperty("right", right);
}

TEST(SocColumn, SizesOfJumpsAndCapacitiesAreRight) {
  for (const SocFault fault : {SocFault::jump, SocFault::capacity}) {
    for (unsigned k = 0; k < 10; ++k) {
      const Log log = make_log(3'000 + k, &fault);
      const SocColumn column = judge_soc_column(log.recording, capacity_of(log));
      ASSERT_FALSE(column.events.empty()) << name_of(fault) << " " << k;
      const double planted = log.planted.size;
      const double within = fault == SocFault::jump ? 0.02 : 0.05 * planted;
      EXPECT_NEAR(column.events.front().size, planted, within) << name_of(fault) << ": " << log.recording.path;
    }
  }
}

/// Rows of a minute at more than the capacity an hour: each row's change is far from that of the file's capacity.
TEST(SocColumn, ACountWithAnotherCapacityInRowsOfAMinuteIsNotATable) {
  for (const double ratio : {0.7, 1.35}) {
    std::vector<double> t, a, v, s;
    double soc = 0.1, count = 0.1, rate = 1.6;
    for (int k = 0; k < 120; ++k) {  // the charger ends slowly
      if (rate > 0 && soc > 0.85) rate = std::max(0.05, 0.9 * rate);
      if (k == 60) rate = -1.2;
      if (soc < 0.15 && rate < 0) rate = -0.01;
      soc += rate / 60;
      count += ratio * rate / 60;
      t.push_back(60.0 * k);
      a.push_back(100 * rate);
      v.push_back(rest_voltage(soc) + 0.04 * rate);
      s.push_back(std::round(count * 1e4) / 1e4);
    }
    const SocColumn column = judge_soc_column(recording_of(t, a, v, s, "minutes"), 100);
    ASSERT_EQ(column.events.size(), 1U) << ratio << ": " << sentence_of(column, 0, 100);
    EXPECT_EQ(column.events.front().fault, SocFault::capacity) << sentence_of(column, 0, 100);
    EXPECT_NEAR(column.events.front().size, 100 / ratio, 2);
    EXPECT_NE(sentence_of(column, 0, 100).find(" Ah, not with 100 Ah;"), std::string::npos)
        << sentence_of(column, 0, 100);
    EXPECT_NE(sentence_of(column, 0, 100).find("or the capacity of 100 Ah is wrong"), std::string::npos);
  }
}

/// 380 min; `first` and `second` are what the column shows before and after its only change.
SocColumn one_change(double first, double second, double current_a) {
  std::vector<double> t, a, v, s;
  for (int k = 0; k < 380; ++k) {
    t.push_back(60.0 * k);
    a.push_back(current_a);
    v.push_back(rest_voltage(0.5 + current_a * k / 6'000));
    s.push_back(k < 200 ? first : second);
  }
  return judge_soc_column(recording_of(t, a, v, s, "one change"), 100);
}

TEST(SocColumn, ACoarseColumnWithASingleStepIsACountAndALeapOfAFineOneIsNot) {
  const SocColumn coarse = one_change(0.5, 0.6, 3);
  EXPECT_TRUE(coarse.is_count) << sentence_of(coarse, 0, 100);
  EXPECT_EQ(coarse.resolution, 0.1);
  const SocColumn fine = one_change(0.63, 0.83, 0.1);
  ASSERT_FALSE(fine.is_count);
  EXPECT_TRUE(std::any_of(fine.events.begin(), fine.events.end(), [](const SocEvent& e) {
    return e.fault == SocFault::jump && e.time_s == 12'000 && std::abs(e.size - 0.2) < 0.01;
  })) << sentence_of(fine, 0, 100);
}

TEST(SocColumn, AColumnThatStaysFullWhileTheChargerHoldsTheVoltageIsSound) {
  Log log = make_log(2'003, nullptr);
  std::vector<double> soc = log.recording.soc_ref.copy();
  std::vector<double> current(soc.size(), 0.05 * capacity_of(log));
  for (std::size_t k = 0; k < soc.size(); ++k) soc[k] = 1;
  log.recording.soc_ref = soc;
  log.recording.current_a = current;
  EXPECT_TRUE(judge_soc_column(log.recording, capacity_of(log)).is_count);
}

/// A logger that was off while the battery was charged, and one whose current was missing meanwhile.
TEST(SocColumn, WhatWasChargedWithoutACurrentInTheLogIsNotBlamed) {
  for (const bool missing : {false, true}) {
    Log log = make_log(2'001, nullptr);
    const std::size_t rows = log.recording.rows(), from = rows / 3, to = rows / 2;
    std::vector<double> t, a, v, s;
    for (std::size_t k = 0; k < rows; ++k) {
      if (!missing && k >= from && k < to) continue;
      t.push_back(log.recording.time_s[k]);
      a.push_back(k >= from && k < to ? std::numeric_limits<double>::quiet_NaN() : log.recording.current_a[k]);
      v.push_back(log.recording.voltage_v[k]);
      s.push_back(log.recording.soc_ref[k]);
    }
    ASSERT_GT(std::abs(log.recording.soc_ref[to] - log.recording.soc_ref[from]), 0.04) << "too little for this test";
    const SocColumn column = judge_soc_column(recording_of(t, a, v, s, "gap"), capacity_of(log));
    EXPECT_TRUE(column.is_count) << missing << ": " << sentence_of(column, 0, capacity_of(log));
  }
}

TEST(SocColumn, AColumnWithFewValuesOrNoneIsNotBlamed) {
  Recording r;
  r.time_s = {0, 1, 2};
  r.current_a = {0, 0, 0};
  r.soc_ref = {0.1, 0.9, 0.2};
  EXPECT_TRUE(judge_soc_column(r, 10).is_count);
  r.soc_ref = std::vector<double>{};
  EXPECT_TRUE(judge_soc_column(r, 10).is_count);
}

}  // namespace
}  // namespace bms::measurement
