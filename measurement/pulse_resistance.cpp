#include "measurement/pulse_resistance.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "measurement/spans.hpp"

namespace bms::measurement {

namespace {

constexpr double rest_c_rate = 0.02, least_c_rate = 0.1, least_rest_s = 10, same_current = 0.03;
constexpr double times_s[] = {1, 10, 30};
constexpr double longest_end_s = 120;  ///< the end of a longer pulse says more about the open-circuit voltage
constexpr double near_time = 0.02;     ///< relative: a pulse of 30 s may end after 29.5 s

/// State of charge by row.
std::vector<double> soc_of(const Recording& r, double capacity_ah, const KnownSoc& known) {
  if (!r.soc_ref.empty()) return r.soc_ref.copy();
  std::vector<double> charge_ah;
  double sum_ah = 0, last_a = 0, at_known_ah = 0;
  for (std::size_t k = 0; k < r.rows(); ++k) {
    if (std::isfinite(r.current_a[k])) last_a = r.current_a[k];
    if (k > 0) sum_ah += last_a * (r.time_s[k] - r.time_s[k - 1]) / 3'600;
    charge_ah.push_back(sum_ah);
    if (r.time_s[k] <= known.time_s) at_known_ah = sum_ah;
  }
  for (double& q : charge_ah) q = known.soc + (q - at_known_ah) / capacity_ah;
  return charge_ah;
}

/// When the pulse began whose first row is `first` and whose first row with the whole current is `level`.
double begin_of(const Recording& r, std::size_t first, std::size_t level) {
  const double interval_s = r.time_s[first] - r.time_s[first - 1];
  // a logger that writes a row when something changes may have a long interval before it
  const double next_s = first + 1 < r.rows() ? r.time_s[first + 1] - r.time_s[first] : interval_s;
  const double share = level > first ? std::clamp(r.current_a[first] / r.current_a[level], 0.0, 1.0) : 1;
  const double within_s = interval_s > 2 * next_s && next_s > 0 ? next_s : interval_s;
  return r.time_s[first] - share * within_s;
}

/// Voltage at a time inside the pulse by linear interpolation; nothing where its rows do not reach.
std::optional<PulseReading> reading_at(const Recording& r, const Rows& rows, double begin_s, double after_s) {
  std::optional<PulseReading> before;
  for (std::size_t k = rows.begin; k < rows.end; ++k) {
    if (!std::isfinite(r.voltage_v[k])) continue;
    const PulseReading here{r.time_s[k] - begin_s, r.voltage_v[k], 0};
    if (here.after_s < after_s * (1 - 1e-9)) {
      before = here;
      continue;
    }
    if (here.after_s <= after_s * (1 + near_time)) return here;
    if (!before) return std::nullopt;
    const double part = (after_s - before->after_s) / (here.after_s - before->after_s);
    return PulseReading{after_s, before->voltage_v + part * (here.voltage_v - before->voltage_v), 0};
  }
  if (before && before->after_s >= after_s * (1 - near_time)) return before;
  return std::nullopt;
}

/// Rows with the whole current of the pulse that begins in row `first`.
Rows level_rows(const Recording& r, std::size_t first) {
  std::size_t level = first;
  const bool part = first + 1 < r.rows() && r.current_a[first] * r.current_a[first + 1] > 0 &&
                    std::abs(r.current_a[first]) < (1 - same_current) * std::abs(r.current_a[first + 1]);
  if (part) ++level;
  std::size_t end = level;
  while (end < r.rows() &&
         std::abs(r.current_a[end] - r.current_a[level]) <= same_current * std::abs(r.current_a[level]))
    ++end;
  return {level, end};
}

/// The pulse after the rest [rest.begin, rest.end), if there is one.
std::optional<Pulse> pulse_after(const Recording& r, const Rows& rest, double least_a) {
  const std::size_t first = rest.end;
  if (first >= r.rows() || r.time_s[first - 1] - r.time_s[rest.begin] < least_rest_s) return std::nullopt;
  const Rows rows = level_rows(r, first);
  if (rows.size() == 0 || !(std::abs(r.current_a[rows.begin]) >= least_a)) return std::nullopt;
  if (!std::isfinite(r.voltage_v[first - 1]) || !std::isfinite(r.voltage_v[rows.end - 1])) return std::nullopt;
  Pulse p;
  p.begin_s = begin_of(r, first, rows.begin);
  p.duration_s = r.time_s[rows.end - 1] - p.begin_s;
  for (std::size_t k = rows.begin; k < rows.end; ++k) p.current_a += r.current_a[k] / static_cast<double>(rows.size());
  p.start_voltage_v = r.voltage_v[first - 1];
  p.end_voltage_v = r.voltage_v[rows.end - 1];
  for (const double after_s : times_s) {
    if (const auto reading = reading_at(r, rows, p.begin_s, after_s)) p.at.push_back(*reading);
  }
  const bool has_end = !p.at.empty() && p.duration_s <= p.at.back().after_s * (1 + near_time);
  if (!has_end && p.duration_s > 0 && p.duration_s <= longest_end_s) p.at.push_back({p.duration_s, p.end_voltage_v, 0});
  const double step_a = p.current_a - r.current_a[first - 1];
  for (PulseReading& reading : p.at) reading.resistance_ohm = (reading.voltage_v - p.start_voltage_v) / step_a;
  return p;
}

}  // namespace

const PulseReading* Pulse::after(double seconds) const {
  for (const PulseReading& reading : at) {
    if (std::abs(reading.after_s - seconds) <= near_time * seconds) return &reading;
  }
  return nullptr;
}

std::vector<Pulse> pulses_of(const Recording& r, double capacity_ah, const KnownSoc& known) {
  std::vector<Pulse> found;
  if (r.voltage_v.empty()) return found;
  const std::vector<double> soc = soc_of(r, capacity_ah, known);
  const double rest_a = rest_c_rate * capacity_ah, least_a = least_c_rate * capacity_ah;
  for (const Rows& rest :
       consecutive_rows(r.rows(), [&](std::size_t k) { return std::abs(r.current_a[k]) <= rest_a; })) {
    std::optional<Pulse> pulse = pulse_after(r, rest, least_a);
    if (!pulse || pulse->at.empty()) continue;
    const std::size_t before = rest.end - 1;
    pulse->soc = soc[before];
    pulse->temperature_c = r.temperature_c.empty() ? std::numeric_limits<double>::quiet_NaN() : r.temperature_c[before];
    found.push_back(std::move(*pulse));
  }
  return found;
}

}  // namespace bms::measurement
