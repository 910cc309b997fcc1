#include "identification/prefilter.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "measurement/spans.hpp"
#include "measurement/statistics.hpp"

namespace bms::identification {

namespace {

constexpr std::size_t padding = 9;  // three times the number of coefficients, as in scipy.signal.filtfilt

void require_finite(std::span<const double> values) {
  if (!std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); })) {
    throw std::invalid_argument("a value to be filtered is not a finite number");
  }
}

/// Direct form II transposed. The two states start as those of a constant input values[0].
void run(const SecondOrderFilter& filter, std::vector<double>& values) {
  const auto& [b, a] = filter;
  // at gain 1, output = input = values[0]
  double late = (b[2] - a[2]) * values[0], next = (1 - b[0]) * values[0];
  for (double& v : values) {
    const double in = v;
    v = b[0] * in + next;
    next = b[1] * in - a[1] * v + late;
    late = b[2] * in - a[2] * v;
  }
}

/// |i| below the threshold, by the median of five samples.
std::vector<bool> quiet(std::span<const double> current_a, double below_a) {
  std::vector<bool> is_quiet(current_a.size());
  for (std::size_t k = 0; k < current_a.size(); ++k) {
    const std::size_t from = k < 2 ? 0 : k - 2, to = std::min(k + 3, current_a.size());
    std::vector<double> around;
    for (std::size_t j = from; j < to; ++j) around.push_back(std::abs(current_a[j]));
    is_quiet[k] = measurement::upper_median(around) < below_a;
  }
  return is_quiet;
}

}  // namespace

double even_step_s(std::span<const double> time_s) {
  if (time_s.size() < 2) throw std::invalid_argument("fewer than two samples: no sampling time");
  const std::vector<double> steps_s = measurement::time_steps(time_s);
  if (!std::all_of(steps_s.begin(), steps_s.end(), [](double s) { return s > 0 && std::isfinite(s); }))
    throw std::invalid_argument("time does not rise from sample to sample");
  const double step_s = measurement::upper_median(steps_s);
  for (const double s : steps_s) {
    if (std::abs(s - step_s) > largest_jitter * step_s)
      throw std::invalid_argument(
          "the sampling is uneven: a step differs by more than 1 % from the median step; resample first");
  }
  return step_s;
}

SecondOrderFilter butterworth_low_pass(double cutoff_hz, double sample_rate_hz) {
  if (!(cutoff_hz > 0 && cutoff_hz < sample_rate_hz / 2))
    throw std::invalid_argument("the cutoff of the low-pass must lie between 0 and half the sampling rate");
  // 1 / (s^2 + sqrt(2) s + 1) with s = (1 - z^-1) / (warped (1 + z^-1))
  const double warped = std::tan(std::numbers::pi * cutoff_hz / sample_rate_hz);
  const double squared = warped * warped, norm = 1 + std::numbers::sqrt2 * warped + squared;
  const double b0 = squared / norm;
  return {{b0, 2 * b0, b0}, {1, 2 * (squared - 1) / norm, (1 - std::numbers::sqrt2 * warped + squared) / norm}};
}

std::vector<double> filter_causal(const SecondOrderFilter& filter, std::span<const double> values) {
  require_finite(values);
  std::vector<double> filtered(values.begin(), values.end());
  if (!filtered.empty()) run(filter, filtered);
  return filtered;
}

std::vector<double> filter_zero_phase(const SecondOrderFilter& filter, std::span<const double> values) {
  if (values.size() <= padding) throw std::invalid_argument("a zero-phase filter needs at least 10 values");
  require_finite(values);
  const std::size_t n = values.size();
  std::vector<double> padded;
  for (std::size_t k = padding; k > 0; --k) padded.push_back(2 * values[0] - values[k]);
  padded.insert(padded.end(), values.begin(), values.end());
  for (std::size_t k = 1; k <= padding; ++k) padded.push_back(2 * values[n - 1] - values[n - 1 - k]);
  for (int pass = 0; pass < 2; ++pass) {
    run(filter, padded);
    std::reverse(padded.begin(), padded.end());
  }
  const auto begin = padded.begin() + static_cast<std::ptrdiff_t>(padding);
  return {begin, begin + static_cast<std::ptrdiff_t>(n)};
}

Offset offset_at_rest(const Data& data, const RestCriterion& criterion) {
  if (!(data.capacity_ah > 0)) throw std::invalid_argument("the capacity is missing, which defines what a rest is");
  const std::vector<bool> is_quiet = quiet(data.current_a, criterion.current_c_rate * data.capacity_ah);
  Offset offset;
  double sum = 0, squares = 0;
  const auto quiet_at = [&](std::size_t k) { return is_quiet[k]; };
  for (const auto& [begin, end] : measurement::consecutive_rows(data.size(), quiet_at)) {
    if (data.time_s[end - 1] - data.time_s[begin] < criterion.duration_s) continue;
    // the median counts one or two samples of a load as quiet, so two at each end are left out
    for (std::size_t k = begin + 2; k + 2 < end; ++k) {
      sum += data.current_a[k];
      squares += data.current_a[k] * data.current_a[k];
      ++offset.samples;
    }
  }
  if (offset.samples == 0) return offset;
  const double n = static_cast<double>(offset.samples);
  offset.current_a = sum / n;
  offset.current_std_a = std::sqrt(std::max(0.0, squares / n - offset.current_a * offset.current_a) / n);
  return offset;
}

Prefiltered prefilter(const Data& data, const Prefilter& settings) {
  const SecondOrderFilter filter = butterworth_low_pass(settings.cutoff_hz, 1 / even_step_s(data.time_s));
  Prefiltered out{data, {}};
  if (settings.remove_offset) {
    out.offset = offset_at_rest(data, settings.rest);
    for (double& i : out.data.current_a.edit()) i -= out.offset.current_a;
  }
  if (settings.phase == Phase::zero) {
    out.data.current_a = filter_zero_phase(filter, out.data.current_a);
  } else {
    out.data.current_a = filter_causal(filter, out.data.current_a);
    out.data.voltage_v = filter_causal(filter, out.data.voltage_v);
  }
  return out;
}

}  // namespace bms::identification
