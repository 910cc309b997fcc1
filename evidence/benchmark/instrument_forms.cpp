#include "benchmark/instrument_forms.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace bms::benchmark {

namespace {

using truth::Series;

double largest_of(const std::vector<double>& values) {
  double largest = 0;
  for (const double x : values) largest = std::max(largest, std::abs(x));
  return largest;
}

/// The current is read some rows late; between two rows it is their mean.
void late(Series& s, double rows, double) {
  const std::vector<double> at = s.current_a;
  const auto whole = static_cast<std::size_t>(rows);
  const double part = rows - std::floor(rows);
  for (std::size_t k = 0; k < at.size(); ++k) {
    const double newer = at[k >= whole ? k - whole : 0], older = at[k >= whole + 1 ? k - whole - 1 : 0];
    s.current_a[k] = (1 - part) * newer + part * older;
  }
}

void hold(std::vector<double>& channel, double rows) {
  const auto period = static_cast<std::size_t>(rows);
  for (std::size_t k = 0; k < channel.size(); ++k) channel[k] = channel[k - k % period];
}
void held_current(Series& s, double rows, double) { hold(s.current_a, rows); }
void held_voltage(Series& s, double rows, double) { hold(s.voltage_v, rows); }

void dead_band(Series& s, double size_c, double capacity_ah) {
  for (double& i : s.current_a) i = std::abs(i) < size_c * capacity_ah ? 0 : i;
}

void hard_clip(Series& s, double share, double) {
  const double end_a = share * largest_of(s.current_a);
  for (double& i : s.current_a) i = std::clamp(i, -end_a, end_a);
}

/// The reading bends from half of its end on, and nears it without reaching it.
void soft_clip(Series& s, double share, double) {
  const double end_a = share * largest_of(s.current_a);
  for (double& i : s.current_a) {
    const double over_a = std::abs(i) - end_a / 2;
    if (over_a > 0) i = std::copysign(end_a / 2 + end_a / 2 * std::tanh(over_a / (end_a / 2)), i);
  }
}

void coarse_current(Series& s, double step_c, double capacity_ah) {
  const double step_a = step_c * capacity_ah;
  for (double& i : s.current_a) i = step_a * std::round(i / step_a);
}

void coarse_voltage(Series& s, double step_v, double) {
  for (double& v : s.voltage_v) v = step_v * std::round(v / step_v);
}

/// An error that swings and decays on both sides of zero, as of a Hall sensor's core.
void zero_ripple(Series& s, double size_c, double capacity_ah) {
  const double size_a = size_c * capacity_ah;
  for (double& i : s.current_a) {
    const double x = i / (5 * size_a);
    i += size_a * std::cos(2 * std::numbers::pi * x) * std::exp(-x * x);
  }
}

void gain_of_charge(Series& s, double gain, double) {
  for (double& i : s.current_a) i *= i > 0 ? 1 + gain : 1;
}

}  // namespace

std::span<const InstrumentForm> instrument_forms() {
  static const std::vector<InstrumentForm> forms = {
      {"current late by part of a row or more", "rows", {0.4, 1, 2.6}, late, {"channel_skew"}},
      {"current held", "rows", {3, 8}, held_current, {"channel_skew"}},
      {"voltage held", "rows", {3, 8}, held_voltage, {"channel_skew"}},
      {"dead band around zero", "of 1C", {0.05, 0.15}, dead_band, {"current_offset"}},
      {"hard clipping", "of the largest current", {0.8, 0.6}, hard_clip, {"current_clipping"}},
      {"soft clipping", "of the largest current", {1.0, 0.7}, soft_clip, {"current_clipping"}},
      {"coarse steps of the current", "of 1C", {0.05, 0.2}, coarse_current, {}},
      {"coarse steps of the voltage", "V", {0.005, 0.02}, coarse_voltage, {}},
      {"ripple around zero", "of 1C", {0.03, 0.1}, zero_ripple, {"current_offset"}},
      {"gain of charge alone", "of the current", {0.03, 0.08}, gain_of_charge, {"coulombic_loss", "current_gain"}},
  };
  return forms;
}

}  // namespace bms::benchmark
