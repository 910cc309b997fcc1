#include "proof/direct_measurements.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "identification/goodness_of_fit.hpp"
#include "measurement/statistics.hpp"

namespace bms::proof {

namespace {

constexpr double soc_window = 0.02;       ///< around a state of charge
constexpr double slow_rest_a = 0.01;      ///< a slow run rests below
constexpr double edge_a = 1;              ///< smallest current step
constexpr double edge_s = 1.5;            ///< longest time of a current step
constexpr double rest_a = 0.02;           ///< a rest is below
constexpr double idle_a = 0.03;           ///< an idle channel reads less
constexpr double sigma_per_mad = 1.4826;  ///< of a normal distribution: sigma over median absolute deviation
constexpr double median_efficiency =
    1.2533;  ///< of a normal distribution: standard error of the median over the mean's

}  // namespace

Range read_range(files::TomlTable& table, const std::string& key) {
  const std::vector<double> range = table.numbers(key);
  if (range.size() != 2 || !(range[0] < range[1])) table.reject(key, "two numbers that ascend");
  return {range[0], range[1]};
}

double rms_error_v(const workflow::RecordingComparison& c, const std::vector<double>& simulated_v, Range range) {
  identification::ErrorFigure error;
  for (std::size_t k = 0; k < c.record.size(); ++k) {
    if (c.recording.soc_ref[k] >= range.from && c.recording.soc_ref[k] <= range.to)
      error.add(c.record.voltage_v[k] - simulated_v[k]);
  }
  return error.rms();
}

double slow_voltage_v(const measurement::Recording& r, double soc) {
  double largest_a = 0, sum = 0;
  for (const double i : r.current_a) largest_a = std::max(largest_a, std::abs(i));
  std::size_t count = 0;
  for (std::size_t k = 0; k < r.rows(); ++k) {
    if (!(std::abs(r.current_a[k]) > 0.5 * largest_a && std::abs(r.soc_ref[k] - soc) < soc_window)) continue;
    sum += r.voltage_v[k];
    ++count;
  }
  return count > 0 ? sum / static_cast<double>(count) : std::numeric_limits<double>::quiet_NaN();
}

double slow_current_a(const measurement::Recording& r) {
  double sum = 0;
  std::size_t count = 0;
  for (const double i : r.current_a) {
    if (!(std::abs(i) > slow_rest_a)) continue;
    sum += std::abs(i);
    ++count;
  }
  return count > 0 ? sum / static_cast<double>(count) : 0;
}

Value edge_resistance_ohm(const measurement::Recording& r) {
  std::vector<double> ratios;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const double di = r.current_a[k] - r.current_a[k - 1];
    if (r.time_s[k] - r.time_s[k - 1] < edge_s && std::abs(di) >= edge_a)
      ratios.push_back((r.voltage_v[k] - r.voltage_v[k - 1]) / di);
  }
  const double middle = measurement::upper_median(ratios);
  std::vector<double> deviations;
  for (const double x : ratios) deviations.push_back(std::abs(x - middle));
  if (ratios.empty()) return {middle, 0};
  return {middle, median_efficiency * sigma_per_mad * measurement::upper_median(deviations) /
                      std::sqrt(static_cast<double>(ratios.size()))};
}

std::vector<measurement::Rows> rests(const measurement::Recording& r, double at_least_s) {
  const auto resting = [&](std::size_t k) { return std::abs(r.current_a[k]) < rest_a; };
  std::vector<measurement::Rows> list = measurement::consecutive_rows(r.rows(), resting);
  std::erase_if(
      list, [&](const measurement::Rows& rest) { return r.time_s[rest.end - 1] - r.time_s[rest.begin] < at_least_s; });
  return list;
}

Value idle_current_a(const measurement::Recording& r) {
  double sum = 0, squares = 0;
  std::size_t count = 0;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    if (r.current_a[k] == 0 || !(std::abs(r.current_a[k]) < idle_a)) continue;
    sum += r.current_a[k];
    squares += r.current_a[k] * r.current_a[k];
    ++count;
  }
  if (count == 0) return {};
  const double n = static_cast<double>(count), mean = sum / n;
  return {mean, std::sqrt(std::max(0.0, squares / n - mean * mean) / n)};
}

}  // namespace bms::proof
