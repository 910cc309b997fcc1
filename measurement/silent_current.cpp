#include "measurement/silent_current.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "measurement/statistics.hpp"

namespace bms::measurement {

namespace {

constexpr std::size_t fewest_rows = 10, fewest_steps = 5, fewest_silent_steps = 4;
constexpr double small_step = 0.02, large_step = 0.15;  ///< of the largest current
constexpr double sigmas = 5;                            ///< of a step of the voltage
constexpr double mad_to_sigma = 1.4826;
constexpr double least_sigma_v = 1e-5;
constexpr std::size_t fewest_cells = 5;  ///< from which on the channels that move most and least do not count

/// Step of the voltage before each row; NaN: unknown. Of a pack the mean over its cells.
std::vector<double> voltage_steps(const Recording& r) {
  std::vector<double> steps(r.rows(), std::nan("")), of_cells;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    if (r.cell_voltage_v.empty()) {
      if (!r.voltage_v.empty()) steps[k] = r.voltage_v[k] - r.voltage_v[k - 1];
      continue;
    }
    of_cells.clear();
    for (const Column& v : r.cell_voltage_v) {
      if (std::isfinite(v[k] - v[k - 1])) of_cells.push_back(v[k] - v[k - 1]);
    }
    if (of_cells.empty()) continue;
    std::sort(of_cells.begin(), of_cells.end());
    const std::size_t cut = of_cells.size() >= fewest_cells ? 1 : 0;
    double sum = 0;
    for (std::size_t c = cut; c + cut < of_cells.size(); ++c) sum += of_cells[c];
    steps[k] = sum / static_cast<double>(of_cells.size() - 2 * cut);
  }
  return steps;
}

/// What the log's other steps of the current show.
struct Response {
  double ohm = 0, sigma_v = 0;
};

Response response_of(const Recording& r, const std::vector<double>& steps_v, double largest_a) {
  std::vector<double> ratios, quiet;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const double di = r.current_a[k] - r.current_a[k - 1];
    if (!std::isfinite(di + steps_v[k])) continue;
    const bool silent = r.current_a[k] == 0 || r.current_a[k - 1] == 0;
    if (std::abs(di) > large_step * largest_a) ratios.push_back(steps_v[k] / di);
    if (!silent && std::abs(di) < small_step * largest_a) quiet.push_back(std::abs(steps_v[k]));
  }
  if (ratios.size() < fewest_steps || quiet.size() < fewest_rows) return {};
  // most steps of a coarse voltage may be 0: then the largest in twenty say how it is read
  const double usual_v = mad_to_sigma * median(quiet);
  return {median(ratios), std::max(least_sigma_v, usual_v > 0 ? usual_v : quantile(quiet, 0.95) / 1.96)};
}

}  // namespace

std::vector<SilentCurrent> silent_currents(const Recording& r) {
  std::vector<SilentCurrent> found;
  if (!r.current_ref_a.empty()) return found;  // its voltage may be that of a reference source
  double largest_a = 0;
  for (const double a : r.current_a) largest_a = std::isfinite(a) ? std::max(largest_a, std::abs(a)) : largest_a;
  const std::vector<Rows> zeros = consecutive_rows(r.rows(), [&](std::size_t k) { return r.current_a[k] == 0; });
  if (largest_a == 0 || std::none_of(zeros.begin(), zeros.end(), [](Rows z) { return z.size() >= fewest_rows; }))
    return found;
  const std::vector<double> steps_v = voltage_steps(r);
  const Response response = response_of(r, steps_v, largest_a);
  if (response.ohm <= 0) return found;
  const double least_v = std::max(sigmas * response.sigma_v, response.ohm * small_step * largest_a);
  for (const Rows& z : zeros) {
    if (z.size() < fewest_rows) continue;
    std::vector<double> sizes_a;
    // the first two rows and the last may have been under load for a part of their time
    std::size_t up = 0;
    for (std::size_t k = z.begin + 2; k + 1 < z.end; ++k) {
      if (!(std::abs(steps_v[k]) > least_v)) continue;
      sizes_a.push_back(std::abs(steps_v[k]) / response.ohm);
      up += steps_v[k] > 0 ? 1 : 0;
    }
    // a load is switched on and off; a relaxation goes one way
    if (sizes_a.size() < fewest_silent_steps || 2 * std::min(up, sizes_a.size() - up) < fewest_silent_steps) continue;
    found.push_back({.rows = z,
                     .from_s = r.time_s[z.begin],
                     .to_s = r.time_s[z.end - 1],
                     .steps = sizes_a.size(),
                     .step_a = median(sizes_a)});
  }
  return found;
}

std::string silent_current_text(const std::vector<SilentCurrent>& found, double first_s) {
  if (found.empty()) return {};
  constexpr std::size_t most_named = 3;
  std::string times;
  std::size_t steps = 0;
  for (std::size_t k = 0; k < found.size(); ++k) {
    steps += found[k].steps;
    if (k < most_named)
      times +=
          fmt::format("{}{:.0f} to {:.0f} s", k == 0 ? "" : ", ", found[k].from_s - first_s, found[k].to_s - first_s);
  }
  if (found.size() > most_named) times += fmt::format(" and {} more times", found.size() - most_named);
  return fmt::format(
      "the current reads exactly 0 from {} while the voltage has {} steps as of loads of about {:.2g} A: "
      "the sensor is not read, or the load bypasses it; the charge of that time is not counted",
      times, steps, found.front().step_a);
}

}  // namespace bms::measurement
