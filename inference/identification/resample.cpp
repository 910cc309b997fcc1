#include "identification/resample.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "identification/prefilter.hpp"
#include "measurement/statistics.hpp"

namespace bms::identification {

namespace {

constexpr double longest_bridge_steps = 5;
constexpr double most_samples = 1e7;

bool is_even(const Data& data) {
  try {
    even_step_s(data.time_s);
    return true;
  } catch (const std::invalid_argument&) {
    return false;
  }
}

double median_step_s(const Data& data) {
  if (data.size() < 2) throw std::invalid_argument("fewer than two samples: no sampling time");
  std::vector<double> steps_s;
  for (std::size_t k = 1; k < data.size(); ++k) steps_s.push_back(data.time_s[k] - data.time_s[k - 1]);
  if (!std::all_of(steps_s.begin(), steps_s.end(), [](double s) { return s > 0 && std::isfinite(s); }))
    throw std::invalid_argument("time does not rise from sample to sample");
  return measurement::median(steps_s);
}

/// Charge since the first sample [A s] at every sample.
std::vector<double> charge_of(const Data& data) {
  std::vector<double> charge_as(data.size(), 0);
  for (std::size_t k = 1; k < data.size(); ++k) {
    const double current_a = std::isfinite(data.current_a[k]) ? data.current_a[k] : 0;
    charge_as[k] = charge_as[k - 1] + current_a * (data.time_s[k] - data.time_s[k - 1]);
  }
  return charge_as;
}

}  // namespace

EvenData evenly_sampled(const Data& data) {
  EvenData out;
  out.step_s = median_step_s(data);
  if (is_even(data)) {
    out.data = data;
    return out;
  }
  const double span_s = data.time_s.back() - data.time_s.front();
  if (span_s / out.step_s > most_samples)
    throw std::invalid_argument(
        "the median step is too short for the length of the recording, so it cannot be "
        "resampled");
  out.resampled = true;
  out.data.capacity_ah = data.capacity_ah;
  const std::vector<double> charge_as = charge_of(data);
  const auto count = static_cast<std::size_t>(span_s / out.step_s) + 1;
  std::vector<double>&time_s = out.data.time_s.edit(), &current_a = out.data.current_a.edit(),
  &voltage_v = out.data.voltage_v.edit();
  double before_as = 0;
  std::size_t above = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double t = data.time_s.front() + static_cast<double>(k) * out.step_s;
    while (above + 1 < data.size() && data.time_s[above] < t) ++above;
    const std::size_t below = above > 0 ? above - 1 : 0;
    const double wide_s = data.time_s[above] - data.time_s[below];
    const double part = wide_s > 0 ? std::clamp((t - data.time_s[below]) / wide_s, 0.0, 1.0) : 0;
    const double at_as = charge_as[below] + part * (charge_as[above] - charge_as[below]);
    const bool on_sample = part == 0 || part == 1;
    const bool gap = wide_s > longest_bridge_steps * out.step_s && !on_sample;
    const double v = on_sample ? data.voltage_v[part == 1 ? above : below]
                               : data.voltage_v[below] + part * (data.voltage_v[above] - data.voltage_v[below]);
    if (gap) ++out.gap_samples;
    time_s.push_back(t);
    current_a.push_back(k == 0 ? data.current_a.front() : (at_as - before_as) / out.step_s);
    voltage_v.push_back(gap ? std::numeric_limits<double>::quiet_NaN() : v);
    before_as = at_as;
  }
  return out;
}

}  // namespace bms::identification
