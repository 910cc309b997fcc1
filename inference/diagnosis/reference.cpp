#include "diagnosis/reference.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::References& reference_limits = thresholds.references;

struct StillStretch {
  std::size_t first = 0, last = 0;
};

/// Consecutive rows with a reference that moves by `still` at most.
std::vector<StillStretch> stretches(std::span<const double> time_s, std::span<const double> reference, double still) {
  std::vector<StillStretch> all;
  bool inside = false;
  for (std::size_t k = 0; k < reference.size(); ++k) {
    if (!std::isfinite(reference[k])) {
      inside = false;
      continue;
    }
    const bool goes_on = inside && std::abs(reference[k] - reference[all.back().first]) <= still &&
                         time_s[k] - time_s[all.back().first] <= reference_limits.check_at_most_s;
    if (goes_on)
      all.back().last = k;
    else
      all.push_back({k, k});
    inside = true;
  }
  return all;
}

/// An instrument and its reference.
struct Channel {
  Check::Channel kind;
  std::span<const double> read;
  std::span<const double> reference;
  double still;
};

void add_checks(PreparedRecording& r, const Channel& channel, const model::CellParameters<>& cell) {
  for (const StillStretch& s : stretches(r.time_s, channel.reference, channel.still)) {
    const double from_s = r.time_s[s.first] + reference_limits.filter_share * (r.time_s[s.last] - r.time_s[s.first]);
    Check c;
    c.channel = channel.kind;
    double n = 0;
    for (std::size_t k = s.first; k <= s.last; ++k) {
      if (r.time_s[k] < from_s || !std::isfinite(channel.read[k])) continue;
      c.time_s += r.time_s[k];
      c.read += channel.read[k];
      c.reference += channel.reference[k];
      if (std::isfinite(r.current_a[k])) c.current_a += r.current_a[k];
      ++n;
    }
    if (n < 1) continue;
    for (double* mean : {&c.time_s, &c.current_a, &c.read, &c.reference}) *mean /= n;
    set_deviation(c, n, cell);
    r.checks.push_back(c);
  }
}

}  // namespace

void set_deviation(Check& check, double readings, const model::CellParameters<>& cell) {
  const bool voltage = check.channel == Check::Channel::voltage;
  const double noise = voltage ? cell.noise.voltage_v : cell.noise.current_a,
               own = voltage ? reference_limits.meter_v : reference_limits.meter_c * cell.capacity_ah;
  check.steady = std::hypot(noise / std::sqrt(readings), own);
  check.unsteady = reference_limits.unsteady_share * std::abs(check.read - check.reference);
}

void average_references(PreparedRecording& r, std::span<const double> current_ref_a,
                        std::span<const double> voltage_ref_v, const model::CellParameters<>& cell) {
  const auto covers = [&](std::span<const double> reference) {
    const auto readings = std::count_if(reference.begin(), reference.end(), [](double x) { return std::isfinite(x); });
    return static_cast<double>(readings) > reference_limits.covers * static_cast<double>(r.size());
  };
  if (covers(current_ref_a)) r.current_ref_a = std::vector<double>(current_ref_a.begin(), current_ref_a.end());
  if (covers(voltage_ref_v)) r.voltage_ref_v = std::vector<double>(voltage_ref_v.begin(), voltage_ref_v.end());
  add_checks(r, {Check::Channel::current, r.current_a, current_ref_a, reference_limits.still_c * cell.capacity_ah},
             cell);
  add_checks(r, {Check::Channel::voltage, r.voltage_v, voltage_ref_v, reference_limits.still_v}, cell);
  if (current_ref_a.empty() || voltage_ref_v.empty()) return;
  for (std::size_t k = 0; k < r.size(); ++k) {
    if (current_ref_a[k] == 0 && std::isfinite(voltage_ref_v[k]))
      r.voltage_v.edit()[k] = std::numeric_limits<double>::quiet_NaN();
  }
}

}  // namespace bms::diagnosis
