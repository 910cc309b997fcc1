#include "workflow/identification_data.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "measurement/statistics.hpp"

namespace bms::workflow {

namespace {

/// Of single odd voltages: readings that went wrong on their way. A cell under a constant current cannot leave its
/// voltage for one row and come back.
struct OddReadings {
  double quiet = 0.01;  ///< change of the current, as a share of the largest: noise of an ammeter, 1 % of R0 at most
  double least_v =
      0.005;           ///< from the voltages before and after: less does not move a fit, which has thousands of rows
  double times = 12;   ///< and of the usual change, without equal readings: 11 sigma of white noise, 12 digits of a
                       ///< coarse converter, whose noise is the last one or two
  double most = 0.01;  ///< share of the rows: errors that are as frequent are the instrument's noise
};
constexpr OddReadings of_odd_readings{};
constexpr std::size_t least_samples = 10;  ///< in the window; as in a recording

std::optional<double> number(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

/// The SOC whose OCV is nearest to the voltage; initial value of an estimate.
double soc_at(const model::OcvTable<double>& ocv, double voltage_v) {
  double best = 0.5, nearest = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k + 1 < ocv.soc.size; ++k) {
    const double soc = std::clamp((voltage_v - ocv.b0_v[k]) / ocv.b1_v[k], ocv.soc[k], ocv.soc[k + 1]);
    const double distance = std::abs(ocv.b0_v[k] + ocv.b1_v[k] * soc - voltage_v);
    if (distance >= nearest) continue;
    nearest = distance;
    best = soc;
  }
  return best;
}

/// SOC of each row by coulomb counting; a missing current moves no charge.
std::vector<double> counted_soc(const measurement::Recording& r, double start, double capacity_ah) {
  std::vector<double> soc(1, start);
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const double current_a = std::isfinite(r.current_a[k]) ? r.current_a[k] : 0;
    soc.push_back(soc.back() + current_a * (r.time_s[k] - r.time_s[k - 1]) / (3'600 * capacity_ah));
  }
  return soc;
}

}  // namespace

IdentificationData identification_data(const measurement::Recording& recording, const DataOptions& options) {
  const std::size_t rows = recording.rows();
  const bool estimate = options.initial.estimate || (!options.initial.value && recording.soc_ref.empty());
  // SOC of each row: the reference if there is one, else by coulomb counting
  const double start = options.initial.value.value_or(
      recording.soc_ref.empty() ? soc_at(options.cell.ocv, recording.voltage_v[0]) : recording.soc_ref[0]);
  measurement::Column soc = recording.soc_ref;
  if (soc.empty() || options.initial.value) soc = counted_soc(recording, start, options.cell.capacity_ah);
  IdentificationData d;
  const auto within = [&](double at) { return at <= options.window.high && at >= options.window.low; };
  identification::Data& data = d.record.data;
  data.capacity_ah = options.cell.capacity_ah;
  std::size_t first = rows, last = 0, used = 0;
  for (std::size_t k = 0; k < rows; ++k) {
    if (!within(soc[k])) continue;
    first = std::min(first, k);
    last = k;
    ++used;
    d.soc_min = std::min(d.soc_min, soc[k]);
    d.soc_max = std::max(d.soc_max, soc[k]);
  }
  if (used < least_samples) {
    throw files::BadInput(recording.path, 1,
                          fmt::format("{} samples in the window of {:g} to {:g}, expected at least {}", used,
                                      options.window.high, options.window.low, least_samples));
  }
  const std::size_t from = estimate ? first : 0;
  const std::size_t count = last + 1 - from;
  data.time_s = recording.time_s.part(from, count);
  data.current_a = recording.current_a.part(from, count);
  data.voltage_v = recording.voltage_v.part(from, count);
  d.temperature_c = recording.temperature_c.part(from, count);
  for (std::size_t k = 0; k < count; ++k) {
    if (!within(soc[from + k])) data.voltage_v.edit()[k] = std::numeric_limits<double>::quiet_NaN();
  }
  d.record.initial_soc = std::clamp(soc[from], 0.0, 1.0);
  d.record.estimate_initial_soc = estimate;
  const double rested_a = 0.01 * options.cell.capacity_ah;  // C/100
  d.record.estimate_initial_v_rc = from > 0 || !(std::abs(recording.current_a[from]) < rested_a);
  return d;
}

void leave_out(const LeftOutTime& time, measurement::Recording& r) {
  if (time.to_s < time.from_s) return;
  std::vector<double>& voltage_v = r.voltage_v.edit();
  for (std::size_t k = 0; k < r.rows(); ++k) {
    if (r.time_s[k] >= time.from_s && r.time_s[k] <= time.to_s) voltage_v[k] = std::numeric_limits<double>::quiet_NaN();
  }
}

void leave_out_odd_readings(measurement::Recording& r) {
  const OddReadings& odd = of_odd_readings;
  double most_a = 0;
  for (const double a : r.current_a) most_a = std::max(most_a, std::isfinite(a) ? std::abs(a) : 0);
  const auto& v = r.voltage_v;
  const auto is_constant = [&](std::size_t k) {
    const double before_a = r.current_a[k] - r.current_a[k - 1], after_a = r.current_a[k + 1] - r.current_a[k];
    return std::abs(before_a) <= odd.quiet * most_a && std::abs(after_a) <= odd.quiet * most_a;  // false for NaN
  };
  std::vector<double> changes;
  for (std::size_t k = 1; k + 1 < r.rows(); ++k) {
    if (is_constant(k) && v[k] != v[k - 1]) changes.push_back(std::abs(v[k] - v[k - 1]));
  }
  const double usual_v = changes.empty() ? 0 : measurement::median(changes);
  const double least_v = std::max(odd.least_v, odd.times * usual_v);
  std::vector<std::size_t> found;
  for (std::size_t k = 1; k + 1 < r.rows(); ++k) {
    const double from_before = v[k] - v[k - 1], from_after = v[k] - v[k + 1];
    const double apart_v = std::min(std::abs(from_before), std::abs(from_after));
    const bool same_side = from_before * from_after > 0, agree = std::abs(v[k + 1] - v[k - 1]) < apart_v / 2;
    if (is_constant(k) && same_side && agree && apart_v > least_v) found.push_back(k);
  }
  if (found.empty() || static_cast<double>(found.size()) > odd.most * static_cast<double>(r.rows())) return;
  std::vector<double>& voltage_v = r.voltage_v.edit();
  for (const std::size_t k : found) voltage_v[k] = std::numeric_limits<double>::quiet_NaN();
  r.warnings.push_back({"odd_readings", fmt::format("single voltages that differ from those before and after them "
                                                    "under the same current, left out: {}, the first at {:g} s",
                                                    found.size(), r.time_s[found.front()])});
}

InitialSoc initial_soc_of(const std::string& text) {
  if (text.empty()) return {};
  if (text == "estimate") return {std::nullopt, true};
  const auto value = number(text);
  if (!value || *value < 0 || *value > 1)
    throw files::BadInput("--initial-soc", 1,
                          "'" + text + "' is not acceptable, expected a number from 0 to 1 or 'estimate'");
  return {value, false};
}

SocWindow window_of(const std::string& option, const std::string& text) {
  if (text.empty()) return {};
  const std::size_t colon = text.find(':');
  const auto high = number(std::string_view(text).substr(0, colon));
  const auto low = colon == std::string::npos ? std::nullopt : number(std::string_view(text).substr(colon + 1));
  if (!high || !low || !(*high > *low))
    throw files::BadInput(option, 1, "'" + text + "' is not acceptable, expected HI:LO as in 0.8:0.5");
  return {*high, *low};
}

identification::CircuitBounds circuit_bounds(double capacity_ah) {
  constexpr double table_3_capacity_ah = 6;
  const double times = table_3_capacity_ah / capacity_ah;
  identification::CircuitBounds b;
  b.r0_min_ohm = std::max(1e-5, b.r0_min_ohm * times);
  b.r0_max_ohm = std::min(0.5, b.r0_max_ohm * times);
  b.r1_min_ohm = std::max(1e-5, b.r1_min_ohm * times);
  b.r1_max_ohm = std::min(0.5, b.r1_max_ohm * times);
  b.c1_min_f = std::max(100.0, b.c1_min_f / times);
  b.c1_max_f = std::clamp(b.c1_max_f / times, 1'000.0, model::accepted::capacitance_f.high);
  return b;
}

}  // namespace bms::workflow
