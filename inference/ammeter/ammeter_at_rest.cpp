#include "ammeter/ammeter_at_rest.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "measurement/statistics.hpp"

namespace bms::ammeter {

namespace {

constexpr double rest_c = 0.1;           ///< a larger reading is a load, in capacities per hour
constexpr double constant_c = 0.005;     ///< readings of a rest are that close to their mean
constexpr double rest_alone_c = 5e-4;    ///< the same in a log of rest alone, where no load shows what is small
constexpr double most_rest_c = 0.01;     ///< a larger constant reading is a slow charge or discharge
constexpr double rest_step_share = 0.3;  ///< of the range of its parts, as their standard deviation at least
constexpr double shortest_log_s = 1'800;
constexpr double noise_sigmas = 4;  ///< or that close in standard deviations of the cell file's noise
constexpr double shortest_rest_s = 120;
constexpr double longest_part_s = 600;  ///< a longer rest counts as several, which show the drift of the sensor
constexpr std::size_t fewest_rows = 5, fewest_rests = 3, fewest_open_readings = 30;

/// Standard deviation of one value; 0 of a single one.
double scatter_of(const std::vector<double>& values) {
  const double mean = measurement::mean(values);
  double squares = 0;
  for (const double v : values) squares += (v - mean) * (v - mean);
  return values.size() < 2 ? 0 : std::sqrt(squares / static_cast<double>(values.size() - 1));
}

/// A log without any load, as one rest: parts of ten minutes, or of five rows.
SensorFinding reading_of_rest_alone(const measurement::Recording& r, const files::CellFile& cell) {
  SensorFinding found;
  const double band_a =
      std::max(rest_alone_c * cell.parameters.capacity_ah, noise_sigmas * cell.parameters.noise.current_a);
  std::vector<double> parts, readings;
  bool all_zero = true;
  for (std::size_t k = 0, first = 0; k < r.rows(); ++k) {
    if (std::isfinite(r.current_a[k])) readings.push_back(r.current_a[k]);
    all_zero = all_zero && !(std::abs(r.current_a[k]) > 0);
    if (k + 1 < r.rows() && (readings.size() < fewest_rows || r.time_s[k] - r.time_s[first] < longest_part_s)) continue;
    if (!readings.empty()) parts.push_back(measurement::mean(readings));
    readings.clear();
    first = k + 1;
  }
  const double hours = r.duration_s() / 3'600;
  if (parts.size() < fewest_rests || hours * 3'600 < shortest_log_s) {
    found.why = "half an hour of rest in which nothing is connected would show it";
    return found;
  }
  if (all_zero) {
    found.why =
        fmt::format("during {:.1f} h of rest it reads exactly 0, which is right or written by the device", hours);
    return found;
  }
  const auto [low, high] = std::minmax_element(parts.begin(), parts.end());
  if (*high - *low > 2 * band_a) {
    found.why = fmt::format("no reading is a load, and it changes from {:.3f} to {:.3f} A: a small load is switched",
                            *low, *high);
    return found;
  }
  found.value = {measurement::mean(parts), std::max(scatter_of(parts), rest_step_share * (*high - *low))};
  found.why = fmt::format(
      "if nothing flowed during the {:.1f} h of this log: a small load that never changes looks "
      "the same",
      hours);
  return found;
}

struct Rest {
  double mean_a = 0, duration_s = 0;
  bool all_zero = true;
};

/// Stretches of the recording whose readings stay near their mean.
std::vector<Rest> rests_of(const measurement::Recording& r, double small_a, double band_a) {
  std::vector<Rest> rests;
  for (std::size_t first = 0; first < r.rows();) {
    double sum_a = 0;
    bool all_zero = true;
    std::size_t k = first;
    for (; k < r.rows(); ++k) {
      const double a = r.current_a[k];
      if (!(std::abs(a) < small_a)) break;  // or missing
      if (r.time_s[k] - r.time_s[first] > longest_part_s) break;
      if (k > first && std::abs(a - sum_a / static_cast<double>(k - first)) > band_a) break;
      sum_a += a;
      all_zero = all_zero && a == 0;
    }
    const double duration_s = k > first ? r.time_s[k - 1] - r.time_s[first] : 0;
    if (k >= first + fewest_rows && duration_s >= shortest_rest_s)
      rests.push_back({sum_a / static_cast<double>(k - first), duration_s, all_zero});
    first = std::max(k, first + 1);
  }
  return rests;
}

}  // namespace

SensorFinding reading_at_rest(const measurement::Recording& r, const files::CellFile& cell) {
  SensorFinding found;
  const double capacity_ah = cell.parameters.capacity_ah;
  const double band_a = std::max(constant_c * capacity_ah, noise_sigmas * cell.parameters.noise.current_a);
  if (std::none_of(r.current_a.begin(), r.current_a.end(),
                   [&](double a) { return std::abs(a) >= rest_c * capacity_ah; })) {
    const bool rest_alone = std::none_of(r.current_a.begin(), r.current_a.end(),
                                         [&](double a) { return std::abs(a) >= most_rest_c * capacity_ah; });
    if (rest_alone) return reading_of_rest_alone(r, cell);
    found.why = "no reading is a load, so a small constant current looks like an offset";
    return found;
  }
  const std::vector<Rest> rests = rests_of(r, rest_c * capacity_ah, band_a);
  if (rests.size() < fewest_rests) {
    found.why = "half an hour of rest in which nothing is connected would show it";
    return found;
  }
  double minutes = 0;
  for (const Rest& rest : rests) minutes += rest.duration_s / 60;
  if (std::all_of(rests.begin(), rests.end(), [](const Rest& rest) { return rest.all_zero; })) {
    found.why = fmt::format("during {:.0f} minutes of rest it reads exactly 0, which is right or written by the device",
                            minutes);
    return found;
  }
  std::vector<double> means;
  for (const Rest& rest : rests) means.push_back(rest.mean_a);
  std::sort(means.begin(), means.end());
  if (means.back() - means.front() > 2 * band_a) {
    found.why = fmt::format("its reading at rest differs, {:.3f} to {:.3f} A: a load is connected at some rests",
                            means.front(), means.back());
    return found;
  }
  const double drift_a = scatter_of(means);  // of the sensor between rests: it does not average out
  found.value = {measurement::mean(means), std::max(drift_a, cell.parameters.noise.current_a)};
  found.why = fmt::format("if no current flows during the {:.0f} minutes of rest in the log", minutes);
  return found;
}

SensorFinding reading_without_current(const measurement::Recording& r) {
  SensorFinding found;
  std::vector<double> readings, minutes;
  for (std::size_t k = 0; k < r.rows();) {
    double sum_a = 0;
    std::size_t count = 0;
    const double from_s = r.time_s[k];
    for (; k < r.rows() && r.time_s[k] - from_s < 60; ++k) {
      if (!std::isfinite(r.current_a[k])) continue;
      sum_a += r.current_a[k];
      ++count;
      readings.push_back(r.current_a[k]);
    }
    if (count > 0) minutes.push_back(sum_a / static_cast<double>(count));
  }
  if (readings.size() < fewest_open_readings) {
    found.why = fmt::format("fewer than {} readings with open contactors", fewest_open_readings);
  } else if (std::all_of(readings.begin(), readings.end(), [](double a) { return a == 0; })) {
    found.why = "with open contactors it reads exactly 0, which is right or written by the device";
  } else {
    // what drifts between minutes does not average out
    found.value = {
        measurement::mean(readings),
        std::max(scatter_of(minutes), scatter_of(readings) / std::sqrt(static_cast<double>(readings.size())))};
  }
  return found;
}

}  // namespace bms::ammeter
