#include "diagnosis/recording_check.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace bms::diagnosis {

namespace {

constexpr double no_reading = std::numeric_limits<double>::quiet_NaN();

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double covered_s(const std::vector<model::Span>& spans) {
  double sum = 0;
  for (const model::Span& s : spans) sum += s.end_s - s.start_s;
  return sum;
}

/// Stretches where a reading does not change although the cell is loaded and unloaded, or its noise should show.
std::vector<model::Span> stuck_voltage(const PreparedRecording& r, double c_rate_a) {
  std::vector<model::Span> spans;
  // a converter whose last digit flickers does not stand still for long: how long, its other readings tell
  std::vector<std::size_t> runs;
  for (std::size_t k = 1, length = 1; k < r.size(); ++k) {
    length = r.voltage_v[k] == r.voltage_v[k - 1] ? length + 1 : (runs.push_back(length), 1);
  }
  std::sort(runs.begin(), runs.end());
  const std::size_t usual = runs.size() > 200 ? runs[runs.size() * 99 / 100] : r.size();
  std::size_t from = 0;
  for (std::size_t k = 1; k <= r.size(); ++k) {
    if (k < r.size() && r.voltage_v[k] == r.voltage_v[from]) continue;
    double low = 1e9, high = -1e9;
    for (std::size_t j = from; j < k; ++j) {
      if (!std::isfinite(r.current_a[j])) continue;
      low = std::min(low, r.current_a[j]);
      high = std::max(high, r.current_a[j]);
    }
    // at constant current on a flat curve a good reading stands still too
    if ((k - from >= 8 && high - low > 0.25 * c_rate_a) ||
        (k - from >= 60 && k - from > 12 * usual && high - low > 0.02 * c_rate_a))
      spans.push_back({r.time_s[from], r.time_s[k - 1]});
    from = k;
  }
  return spans;
}

}  // namespace

RecordingCheck check_recording(PreparedRecording& r, const model::CellParameters<>& cell) {
  RecordingCheck trust;
  const double c_rate_a = cell.capacity_ah;
  const auto fault = [&](const char* id, std::string text, std::vector<model::Span> spans = {}) {
    trust.faults.push_back({id, std::move(text), std::move(spans)});
  };

  // units
  std::vector<double> sizes_a, volts, steps_s;
  for (std::size_t k = 0; k < r.size(); ++k) {
    if (std::isfinite(r.current_a[k])) sizes_a.push_back(std::abs(r.current_a[k]));
    if (std::isfinite(r.voltage_v[k])) volts.push_back(r.voltage_v[k]);
    if (k > 0) steps_s.push_back(r.time_s[k] - r.time_s[k - 1]);
  }
  const double largest_a = sizes_a.empty() ? 0 : *std::max_element(sizes_a.begin(), sizes_a.end());
  const double usual_v = median(volts), usual_step_s = median(steps_s);
  if (usual_v > 100) {
    fault("voltage_in_mv", fmt::format("The voltage reads {:.0f}: millivolts where volts are expected.", usual_v));
    return trust;
  }
  const double limit_a = std::max(cell.limits.charge_current_max_a, cell.limits.discharge_current_max_a);
  if (largest_a > 60 * std::max(limit_a, c_rate_a)) {
    fault(
        "current_in_ma",
        fmt::format("The current reaches {:.0f} A, {:.0f} times the capacity: milliamperes where amperes are expected.",
                    largest_a, largest_a / c_rate_a));
    return trust;
  }

  // readings that no cell gives
  const double low_v = cell.limits.voltage_min_v - 0.8, high_v = cell.limits.voltage_max_v + 0.8;
  std::vector<model::Span> dropouts;
  std::size_t dropped = 0;
  for (std::size_t k = 0; k < r.size(); ++k) {
    if (!std::isfinite(r.voltage_v[k]) || (r.voltage_v[k] >= low_v && r.voltage_v[k] <= high_v)) continue;
    const bool goes_on = k > 0 && !dropouts.empty() && dropouts.back().end_s == r.time_s[k - 1];
    if (goes_on)
      dropouts.back().end_s = r.time_s[k];
    else
      dropouts.push_back({r.time_s[k], r.time_s[k]});
    r.voltage_v[k] = no_reading;
    ++dropped;
  }
  if (dropped > std::max<std::size_t>(20, r.size() / 500))
    fault("dropouts", fmt::format("The voltage drops out in {} of {} samples.", dropped, r.size()), dropouts);
  else if (dropped > 0)
    trust.warnings.push_back(
        fmt::format("{} voltage readings outside {:g} to {:g} V are not used", dropped, low_v, high_v));

  // single spikes: far from both neighbours, which agree, while the current does not move
  std::size_t spikes = 0;
  for (std::size_t k = 1; k + 1 < r.size(); ++k) {
    const double before = r.voltage_v[k - 1], after = r.voltage_v[k + 1], here = r.voltage_v[k];
    const bool quiet = std::abs(r.current_a[k] - r.current_a[k - 1]) < 0.05 * c_rate_a &&
                       std::abs(r.current_a[k + 1] - r.current_a[k]) < 0.05 * c_rate_a;
    if (quiet && std::abs(after - before) < 0.01 && std::abs(here - (before + after) / 2) > 0.25) {
      r.voltage_v[k] = no_reading;
      ++spikes;
    }
  }
  if (spikes > std::max<std::size_t>(20, r.size() / 500))
    fault("dropouts", fmt::format("The voltage has {} spikes that no current explains.", spikes));
  else if (spikes > 0)
    trust.warnings.push_back(fmt::format("{} single spikes of the voltage are not used", spikes));

  // a channel that has stopped
  const auto stuck = stuck_voltage(r, c_rate_a);
  if (covered_s(stuck) > std::max(45.0, 0.004 * r.duration_s())) {
    fault("stuck_voltage",
          fmt::format("The voltage does not move for {:.0f} s in all while the current does.", covered_s(stuck)),
          stuck);
  } else if (!stuck.empty()) {
    std::size_t taken = 0;
    for (std::size_t k = 0; k < r.size(); ++k) {
      for (const model::Span& s : stuck) {
        if (r.time_s[k] > s.start_s && r.time_s[k] <= s.end_s) r.voltage_v[k] = no_reading, ++taken;
      }
    }
    trust.warnings.push_back(fmt::format("{} voltage readings that do not move with the current are not used", taken));
  }

  // clock: gaps under load lose charge that nobody counted
  std::vector<model::Span> gaps;
  double lost_soc = 0;
  for (std::size_t k = 1; k < r.size(); ++k) {
    const double dt_s = r.time_s[k] - r.time_s[k - 1];
    if (dt_s <= 10 * usual_step_s || dt_s < 5) continue;
    const double load_a = std::max(std::isfinite(r.current_a[k]) ? std::abs(r.current_a[k]) : 0,
                                   std::isfinite(r.current_a[k - 1]) ? std::abs(r.current_a[k - 1]) : 0);
    if (load_a < 0.05 * c_rate_a) continue;
    gaps.push_back({r.time_s[k - 1], r.time_s[k]});
    lost_soc += load_a * dt_s / (3'600 * c_rate_a);
  }
  if (lost_soc > 0.02 || gaps.size() >= 3) {
    fault("gaps",
          fmt::format(
              "The recording stops {} times under load, {:.0f} s in all: up to {:.1f} % of the charge is not known.",
              gaps.size(), covered_s(gaps), 100 * lost_soc),
          gaps);
  } else if (!gaps.empty()) {
    trust.warnings.push_back(fmt::format("{} gaps under load", gaps.size()));
  }

  // sign: at edges of the current the voltage must follow
  double together = 0, current2 = 0, voltage2 = 0;
  std::size_t edges = 0, against = 0;
  for (std::size_t k = 1; k < r.size(); ++k) {
    const double di = r.current_a[k] - r.current_a[k - 1], dv = r.voltage_v[k] - r.voltage_v[k - 1];
    if (!std::isfinite(di) || !std::isfinite(dv) || std::abs(di) < 0.15 * c_rate_a) continue;
    together += di * dv;
    current2 += di * di;
    voltage2 += dv * dv;
    ++edges;
    against += di * dv < 0 ? 1 : 0;
  }
  if (edges >= 2 && together < -0.5 * std::sqrt(current2 * voltage2) && against > edges * 7 / 10) {
    fault("current_inverted",
          "The voltage falls where the current rises: the current's sign is inverted, expected > 0 while charging.");
  }
  return trust;
}

}  // namespace bms::diagnosis
