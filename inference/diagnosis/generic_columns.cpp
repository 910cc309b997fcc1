#include "diagnosis/generic_columns.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>

#include "diagnosis/charge_count.hpp"
#include "diagnosis/numerics.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::ResidualTest& column_limits = thresholds.residual;
constexpr Eigen::Index soc_knots = column_limits.soc_knots, fine_knots = column_limits.soc_fine_knots,
                       voltage_knots = column_limits.voltage_knots, soc_current_knots = column_limits.soc_current_knots,
                       time_knots = column_limits.time_knots, time_current_knots = column_limits.time_current_knots,
                       memory_sizes = column_limits.memory_s.size(), leap_sizes = column_limits.leaps_v.size();
/// Columns that all records share, and those of each record.
constexpr Eigen::Index shared_columns = 2 * soc_knots + fine_knots + voltage_knots + memory_sizes + soc_current_knots +
                                        1 + leap_sizes,
                       columns_per_record = time_knots + time_current_knots;

struct ValueRange {
  double low, high;
};

/// Smallest and largest value.
ValueRange range_of(const std::vector<double>& values) {
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return {*low, *high};
}

/// One row of the columns, filled from left to right.
class RowWriter {
 public:
  explicit RowWriter(Eigen::Ref<Columns> row) : row_(row) {}

  void value(double v) { row_(0, at_++) = v; }
  /// Weights of x at the knots of an even grid over a range, times a value.
  void hat(Eigen::Index knots, ValueRange range, double x, double value) {
    const auto last = static_cast<double>(knots - 1);
    const double at = std::clamp((x - range.low) / std::max(range.high - range.low, numerics.grid.width_least) * last,
                                 0.0, last - numerics.grid.last_knot);
    const auto k = static_cast<Eigen::Index>(at);
    row_(0, at_ + k) += value * (1 - (at - static_cast<double>(k)));
    row_(0, at_ + k + 1) += value * (at - static_cast<double>(k));
    at_ += knots;
  }
  void skip(Eigen::Index columns) { at_ += columns; }

 private:
  Eigen::Ref<Columns> row_;
  Eigen::Index at_ = 0;
};

/// What a row of a recording remembers of those before it.
class Memory {
 public:
  explicit Memory(double first_v) { leap_v_.fill(first_v); }

  /// load: current over the largest current.
  void step(double duration_s, double load, double moved_soc, double voltage_v) {
    const auto follow = [](double& x, double share, double target) { x += share * (target - x); };
    follow(heading_, 1 - std::exp(-std::abs(moved_soc) / column_limits.heading_soc), moved_soc > 0 ? 1 : -1);
    follow(heat_, 1 - std::exp(-duration_s / column_limits.heat_s), load * load);
    for (std::size_t t = 0; t < load_.size(); ++t)
      follow(load_[t], 1 - std::exp(-duration_s / column_limits.memory_s[t]), load);
    for (std::size_t l = 0; l < leap_v_.size(); ++l) {
      if (std::abs(voltage_v - leap_v_[l]) >= column_limits.leaps_v[l]) leap_v_[l] = voltage_v;
    }
  }
  double heading() const { return heading_; }                               ///< -1 discharged .. 1 charged last
  double heat() const { return heat_; }                                     ///< of the load, 0..1
  const std::array<double, memory_sizes>& load() const { return load_; }    ///< by time constant
  const std::array<double, leap_sizes>& leap_v() const { return leap_v_; }  ///< reading that follows in leaps

 private:
  double heading_ = 0, heat_ = 0;
  std::array<double, memory_sizes> load_{};
  std::array<double, leap_sizes> leap_v_{};
};

double largest_current_a(const std::vector<PreparedRecording>& records) {
  double largest_a = numerics.grid.current_least_a;
  for (const PreparedRecording& r : records) {
    for (const double a : r.current_a) {
      if (std::isfinite(a)) largest_a = std::max(largest_a, std::abs(a));
    }
  }
  return largest_a;
}

std::vector<ColumnFamily> families_of(std::size_t records) {
  std::vector<ColumnFamily> families;
  Eigen::Index at = 0;
  const auto family = [&](const char* depends_on, Eigen::Index count) {
    families.push_back({depends_on, at, count});
    at += count;
  };
  family("the state of charge and the direction", 2 * soc_knots);
  family("the state of charge", fine_knots);
  family("the voltage itself", voltage_knots);
  family("the load before", memory_sizes);
  family("the load at a state of charge", soc_current_knots);
  family("the heat of the load", 1);
  family("how far the voltage has moved: a reading that follows in leaps", leap_sizes);
  for (std::size_t n = 0; n < records; ++n) {
    family("the time", time_knots);
    family("the load at a time", time_current_knots);
  }
  return families;
}

/// Cosine and sine of a frequency at ascending times. While the steps are equal each is turned from the last one.
class Wave {
 public:
  explicit Wave(double frequency_hz) : turn_per_s_(2 * std::numbers::pi * frequency_hz) {}

  void at(double time_s) {
    const double step_s = time_s - last_s_;
    last_s_ = time_s;
    if (step_s != step_s_ || turned_ == numerics.grid.most_turns) {
      cosine_ = std::cos(turn_per_s_ * time_s);
      sine_ = std::sin(turn_per_s_ * time_s);
      turned_ = 0;
      if (step_s == step_s_) return;
      step_s_ = step_s;
      step_cosine_ = std::cos(turn_per_s_ * step_s);
      step_sine_ = std::sin(turn_per_s_ * step_s);
      return;
    }
    const double before = cosine_;
    cosine_ = before * step_cosine_ - sine_ * step_sine_;
    sine_ = sine_ * step_cosine_ + before * step_sine_;
    ++turned_;
  }
  double cosine() const { return cosine_; }
  double sine() const { return sine_; }

 private:
  double turn_per_s_, last_s_ = std::nan(""), step_s_ = std::nan("");
  double cosine_ = 1, sine_ = 0, step_cosine_ = 1, step_sine_ = 0;
  std::size_t turned_ = 0;
};

/// Power of a channel at a frequency.
double power_at(std::span<const double> time_s, const std::vector<double>& value, double frequency_hz) {
  Wave wave(frequency_hz);
  double re = 0, im = 0;
  for (std::size_t k = 0; k < value.size(); ++k) {
    wave.at(time_s[k]);
    if (!std::isfinite(value[k])) continue;
    re += value[k] * wave.cosine();
    im += value[k] * wave.sine();
  }
  return re * re + im * im;
}

}  // namespace

GenericColumns generic_columns(const LikelihoodModel& likelihood, const HypothesisFit& fit) {
  const std::vector<PreparedRecording>& records = likelihood.records();
  GenericColumns generic{
      families_of(records.size()),
      Columns::Zero(static_cast<Eigen::Index>(likelihood.samples()),
                    shared_columns + columns_per_record * static_cast<Eigen::Index>(records.size()))};
  const double largest_a = largest_current_a(records), free_v = column_limits.free_v,
               fine_v = column_limits.fine_share * free_v;
  Eigen::Index first_row = 0;
  for (std::size_t n = 0; n < records.size(); ++n) {
    const PreparedRecording& r = records[n];
    std::vector<double> soc;
    const std::vector<double> volts = likelihood.voltage(fit.hypothesis, fit.calibration, n, &soc);
    const ValueRange soc_range = range_of(soc), voltage_range = range_of(volts),
                     time{r.time_s.front(), r.time_s.back()};
    Memory memory(volts.front());
    for_each_row(r, likelihood.cell().capacity_ah, [&](const CountedRow& counted) {
      const std::size_t k = counted.k;
      const double load = counted.current_a / largest_a;
      memory.step(counted.duration_s, load, counted.moved_soc, volts[k]);
      RowWriter row(generic.columns.middleRows(first_row + static_cast<Eigen::Index>(k), 1));
      row.hat(soc_knots, soc_range, soc[k], free_v);
      row.hat(soc_knots, soc_range, soc[k], free_v * memory.heading());
      row.hat(fine_knots, soc_range, soc[k], fine_v);
      row.hat(voltage_knots, voltage_range, volts[k], fine_v);
      for (const double remembered : memory.load()) row.value(free_v * remembered);
      row.hat(soc_current_knots, soc_range, soc[k], free_v * load);
      row.value(free_v * memory.heat());
      for (const double leap_v : memory.leap_v()) row.value(leap_v - volts[k]);
      row.skip(static_cast<Eigen::Index>(n) * columns_per_record);
      row.hat(time_knots, time, r.time_s[k], free_v);
      row.hat(time_current_knots, time, r.time_s[k], free_v * load);
    });
    first_row += static_cast<Eigen::Index>(r.size());
  }
  return generic;
}

std::vector<double> strange_frequencies(const PreparedRecording& r) {
  const double lowest_hz = column_limits.periods / r.duration_s(),
               highest_hz = std::min(column_limits.highest_hz,
                                     column_limits.highest_per_row / (r.duration_s() / static_cast<double>(r.size())));
  if (!(highest_hz > 2 * lowest_hz)) return {};
  std::vector<double> load = r.current_a.copy();
  double mean = 0;
  for (const double a : load) mean += std::isfinite(a) ? a / static_cast<double>(load.size()) : 0;
  for (double& a : load) a -= mean;
  // half a line's width apart at the low end, wider where that would be thousands
  std::vector<double> hz, power;
  for (double f = lowest_hz; f < highest_hz && hz.size() < column_limits.frequencies;
       f += std::max(column_limits.line_spacing / r.duration_s(), f / column_limits.frequency_resolution))
    hz.push_back(f);
  for (const double f : hz) power.push_back(power_at(r.time_s, load, f));
  std::vector<double> strange;
  for (std::size_t k = 0; k < hz.size(); ++k) {
    constexpr std::size_t around = column_limits.frequency_neighbours;
    const auto from = power.begin() + static_cast<std::ptrdiff_t>(k - std::min(k, around)),
               to = power.begin() + static_cast<std::ptrdiff_t>(std::min(hz.size(), k + around + 1));
    if (power[k] <= column_limits.load_power_times * measurement::upper_median(std::vector<double>(from, to)))
      strange.push_back(hz[k]);
  }
  return strange;
}

Columns sine_columns(const LikelihoodModel& likelihood, std::span<const double> frequencies_hz) {
  const measurement::Column& time_s = likelihood.records().front().time_s;
  Columns waves = Columns::Zero(static_cast<Eigen::Index>(likelihood.samples()),
                                2 * static_cast<Eigen::Index>(frequencies_hz.size()));
  Eigen::Index at = 0;
  for (const double frequency_hz : frequencies_hz) {
    Wave wave(frequency_hz);
    for (std::size_t k = 0; k < time_s.size(); ++k) {
      wave.at(time_s[k]);
      waves(static_cast<Eigen::Index>(k), at) = wave.cosine();
      waves(static_cast<Eigen::Index>(k), at + 1) = wave.sine();
    }
    at += 2;
  }
  return waves;
}

}  // namespace bms::diagnosis
