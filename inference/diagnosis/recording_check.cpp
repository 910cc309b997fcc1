// One check per fault of a recording, in the order in which they are made: what an earlier one removes, the later ones
// do not see.
#include "diagnosis/recording_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <fmt/format.h>

#include "diagnosis/noise.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/spans.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis {

namespace {

constexpr double no_reading = std::numeric_limits<double>::quiet_NaN();
constexpr const Thresholds::RecordingFaults& fault_limits = thresholds.recording;

using Record = PreparedRecording;
using Cell = model::CellParameters<>;

double total_s(const std::vector<model::Span>& spans) {
  double sum = 0;
  for (const model::Span& s : spans) sum += s.end_s - s.start_s;
  return sum;
}

std::size_t readings_at_most(const Record& r) {
  return std::max<std::size_t>(fault_limits.few_readings, r.size() / fault_limits.rows_per_reading);
}

/// Returns true if the units are wrong: the other checks would then say nothing.
bool check_units(Record& r, const Cell& cell, RecordingCheck& found) {
  std::vector<double> volts;
  double largest_a = 0;
  for (std::size_t k = 0; k < r.size(); ++k) {
    if (std::isfinite(r.current_a[k])) largest_a = std::max(largest_a, std::abs(r.current_a[k]));
    if (std::isfinite(r.voltage_v[k])) volts.push_back(r.voltage_v[k]);
  }
  const double usual_v = measurement::upper_median(volts);
  const double limit_a = std::max(cell.limits.charge_current_max_a, cell.limits.discharge_current_max_a);
  if (usual_v > fault_limits.volts_at_most) {
    found.faults.push_back(
        {"voltage_in_mv",
         fmt::format("The voltage reads {:.0f}, which is in millivolts. Convert it to volts.", usual_v),
         {}});
  } else if (largest_a > fault_limits.amperes_times_limit * std::max(limit_a, cell.capacity_ah)) {
    found.faults.push_back(
        {"current_in_ma",
         fmt::format("The current reaches {:.0f} A, {:.0f} times the capacity per hour, so it is in milliamperes. "
                     "Convert it to amperes.",
                     largest_a, largest_a / cell.capacity_ah),
         {}});
  }
  return !found.faults.empty();
}

/// Returns true if the voltage leaves the limits together with a step of the current, or without a jump: that of a
/// dropout jumps while the current does not. Such a drop is 4 A through a lead of 0.48 ohm. rows: beyond the limits,
/// from `from` to before `end`.
bool is_voltage_drop(const Record& r, const Cell& cell, std::size_t from, std::size_t end) {
  const auto goes_along = [&](std::size_t k) {
    return std::abs(r.voltage_v[k] - r.voltage_v[k - 1]) < fault_limits.spike_v ||
           std::abs(r.current_a[k] - r.current_a[k - 1]) > fault_limits.edge_c * cell.capacity_ah;
  };
  for (std::size_t k = from; k < end; ++k) {
    if (!(r.voltage_v[k] > 0) || !(std::abs(r.current_a[k]) > fault_limits.edge_c * cell.capacity_ah)) return false;
  }
  return from > 0 && goes_along(from) && (end == r.size() || goes_along(end));
}

/// Readings that no cell gives.
void check_dropouts(Record& r, const Cell& cell, RecordingCheck& found) {
  const double low_v = cell.limits.voltage_min_v - fault_limits.outside_limits_v,
               high_v = cell.limits.voltage_max_v + fault_limits.outside_limits_v;
  const auto outside = [&](std::size_t k) {
    return std::isfinite(r.voltage_v[k]) && (r.voltage_v[k] < low_v || r.voltage_v[k] > high_v);
  };
  std::vector<measurement::Rows> runs;
  for (const measurement::Rows& run : measurement::consecutive_rows(r.size(), outside)) {
    if (!is_voltage_drop(r, cell, run.begin, run.end)) runs.push_back(run);
  }
  std::vector<model::Span> spans;
  std::size_t dropped = 0;
  for (const measurement::Rows& run : runs) {
    spans.push_back({r.time_s[run.begin], r.time_s[run.end - 1]});
    for (std::size_t k = run.begin; k < run.end; ++k) r.voltage_v.edit()[k] = no_reading;
    dropped += run.size();
  }
  if (dropped > readings_at_most(r)) {
    found.faults.push_back(
        {"dropouts",
         fmt::format("The voltage drops out in {} of {} samples. Check the sense wires and the logger.", dropped,
                     r.size()),
         spans});
  } else if (dropped > 0) {
    found.warnings.push_back(
        fmt::format("{} voltage readings outside {:g} to {:g} V are not used", dropped, low_v, high_v));
  }
}

/// Single readings far from both neighbours, which agree, while the current does not move.
void check_spikes(Record& r, const Cell& cell, RecordingCheck& found) {
  const double still_a = fault_limits.spike_current_step_c * cell.capacity_ah;
  std::size_t spikes = 0;
  for (std::size_t k = 1; k + 1 < r.size(); ++k) {
    const double before = r.voltage_v[k - 1], after = r.voltage_v[k + 1], here = r.voltage_v[k];
    const bool still = std::abs(r.current_a[k] - r.current_a[k - 1]) < still_a &&
                       std::abs(r.current_a[k + 1] - r.current_a[k]) < still_a;
    if (still && std::abs(after - before) < fault_limits.spike_neighbours_v &&
        std::abs(here - (before + after) / 2) > fault_limits.spike_v) {
      r.voltage_v.edit()[k] = no_reading;
      ++spikes;
    }
  }
  if (spikes > readings_at_most(r)) {
    found.faults.push_back({"dropouts",
                            fmt::format("The voltage has {} spikes that no current explains. Check the sense wires and "
                                        "the logger.",
                                        spikes),
                            {}});
  } else if (spikes > 0) {
    found.warnings.push_back(fmt::format("{} single spikes of the voltage are not used", spikes));
  }
}

/// The currents of some rows, missing readings left out.
struct CurrentRange {
  double low_a = std::numeric_limits<double>::infinity(), high_a = -std::numeric_limits<double>::infinity();
  bool falls = true;  ///< from one part of the stretch to the next, on average: a reading's noise does not count

  CurrentRange(const Record& r, std::size_t from, std::size_t end) {
    for (std::size_t k = from; k < end; ++k) {
      const double a = r.current_a[k];
      if (!std::isfinite(a)) continue;
      low_a = std::min(low_a, a);
      high_a = std::max(high_a, a);
    }
    double before_a = std::numeric_limits<double>::infinity();
    for (std::size_t q = 0; q < fault_limits.charge_parts; ++q) {
      const std::size_t first = from + q * (end - from) / fault_limits.charge_parts,
                        last = from + (q + 1) * (end - from) / fault_limits.charge_parts;
      double sum_a = 0;
      for (std::size_t k = first; k < last; ++k) sum_a += std::isfinite(r.current_a[k]) ? r.current_a[k] : 0;
      const double mean_a = sum_a / static_cast<double>(std::max<std::size_t>(last - first, 1));
      falls = falls && mean_a < before_a;
      before_a = mean_a;
    }
  }
  double swing_a() const { return high_a - low_a; }
};

/// Charging at constant voltage: the charger lets the current fall and holds the voltage.
bool is_constant_voltage_charge(const CurrentRange& current, double c_rate_a) {
  return current.low_a > -fault_limits.charge_zero_c * c_rate_a && current.high_a > fault_limits.charge_c * c_rate_a &&
         current.falls;
}

/// Largest change of the current [A] that may leave the voltage's last digit as it is.
double invisible_swing_a(const Record& r, const Cell& cell) {
  double r0_ohm = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < cell.rc.soc.size; ++k) r0_ohm = std::min(r0_ohm, cell.rc.r0_ohm[k]);
  return quantisation_step(r.voltage_v) / r0_ohm;
}

/// Stretches where the voltage does not change although the cell is loaded and unloaded, or its noise should show.
std::vector<model::Span> stuck_spans(const Record& r, const Cell& cell) {
  const double c_rate_a = cell.capacity_ah, invisible_a = invisible_swing_a(r, cell);
  // a converter whose last digit flickers does not stand still for long: how long, its other readings show
  std::vector<double> runs;
  double length = 1;
  for (std::size_t k = 1; k < r.size(); ++k) {
    if (r.voltage_v[k] == r.voltage_v[k - 1]) {
      ++length;
    } else {
      runs.push_back(length);
      length = 1;
    }
  }
  const double usual = runs.size() > fault_limits.runs_for_usual
                           ? measurement::quantile(std::move(runs), fault_limits.usual_run_quantile)
                           : static_cast<double>(r.size());
  std::vector<model::Span> spans;
  std::size_t from = 0;
  for (std::size_t k = 1; k <= r.size(); ++k) {
    if (k < r.size() && r.voltage_v[k] == r.voltage_v[from]) continue;
    const CurrentRange current(r, from, k);
    const std::size_t rows = k - from;
    const bool under_load =
                   rows >= fault_limits.stuck_rows_loaded && current.swing_a() > fault_limits.stuck_swing_c * c_rate_a,
               for_long = rows >= fault_limits.stuck_rows &&
                          static_cast<double>(rows) > fault_limits.stuck_times_usual * usual &&
                          current.swing_a() > fault_limits.stuck_small_swing_c * c_rate_a;
    if ((under_load || for_long) && current.swing_a() > invisible_a && !is_constant_voltage_charge(current, c_rate_a))
      spans.push_back({r.time_s[from], r.time_s[k - 1]});
    from = k;
  }
  return spans;
}

void check_stuck_voltage(Record& r, const Cell& cell, RecordingCheck& found) {
  const std::vector<model::Span> stuck = stuck_spans(r, cell);
  if (total_s(stuck) > std::max(fault_limits.stuck_at_most_s, fault_limits.stuck_at_most_share * r.duration_s())) {
    found.faults.push_back(
        {"stuck_voltage",
         fmt::format(
             "The voltage does not move for {:.0f} s in total while the current does. Check the voltage channel.",
             total_s(stuck)),
         stuck});
  } else if (!stuck.empty()) {
    std::size_t removed = 0;
    for (std::size_t k = 0; k < r.size(); ++k) {
      for (const model::Span& s : stuck) {
        if (r.time_s[k] <= s.start_s || r.time_s[k] > s.end_s) continue;
        r.voltage_v.edit()[k] = no_reading;
        ++removed;
      }
    }
    found.warnings.push_back(
        fmt::format("{} voltage readings that do not move with the current are not used", removed));
  }
}

/// Gaps under load: charge that flowed in them was not counted.
void check_gaps(Record& r, const Cell& cell, RecordingCheck& found) {
  const double usual_step_s = measurement::upper_median(measurement::time_steps(r.time_s));
  const auto load_a = [&](std::size_t k) { return std::isfinite(r.current_a[k]) ? std::abs(r.current_a[k]) : 0; };
  const double unchanged_s = longest_unchanged_s(r.time_s, r.current_a, cell.capacity_ah);
  std::vector<model::Span> gaps;
  double lost_soc = 0;
  for (const std::size_t k : measurement::rows_after_gaps(r.time_s, fault_limits.gap_steps * usual_step_s)) {
    const double dt_s = r.time_s[k] - r.time_s[k - 1];
    if (dt_s < fault_limits.gap_at_least_s || dt_s <= unchanged_s) continue;
    const double a = std::max(load_a(k), load_a(k - 1));
    if (a < fault_limits.gap_load_c * cell.capacity_ah) continue;
    gaps.push_back({r.time_s[k - 1], r.time_s[k]});
    lost_soc += a * dt_s / (3'600 * cell.capacity_ah);
  }
  if (lost_soc > fault_limits.gaps_lose_soc || gaps.size() > fault_limits.gaps_at_most) {
    found.faults.push_back(
        {"gaps",
         fmt::format("The recording has {} gaps under load, {:.0f} s in total: up to {:.1f} % of the "
                     "charge is unknown. Record again without gaps.",
                     gaps.size(), total_s(gaps), 100 * lost_soc),
         gaps});
  } else if (!gaps.empty()) {
    found.warnings.push_back(fmt::format("{} gaps under load", gaps.size()));
  }
}

/// At edges of the current the voltage must follow.
/// Returns true if the voltage falls while the same current charges, or rises while it discharges: a discharge at
/// constant current has too few steps to see the sign by.
bool moves_against_charge(const Record& r, const Cell& cell) {
  const double loaded_a = fault_limits.edge_c * cell.capacity_ah;
  std::size_t first = r.size(), last = 0;
  for (std::size_t k = 0; k < r.size(); ++k) {
    if (!(std::abs(r.current_a[k]) > loaded_a) || !std::isfinite(r.voltage_v[k])) continue;
    first = std::min(first, k);
    last = k;
  }
  if (first >= last) return false;
  double moved_soc = 0;
  for (std::size_t k = first + 1; k <= last; ++k) {
    const double a = r.current_a[k];
    if (!(a * r.current_a[first] > 0) || std::abs(a / r.current_a[first] - 1) > fault_limits.same_current) return false;
    moved_soc += a * (r.time_s[k] - r.time_s[k - 1]) / (3'600 * cell.capacity_ah);
  }
  const double moved_v = r.voltage_v[last] - r.voltage_v[first];
  return std::abs(moved_soc) > fault_limits.inverted_soc && moved_v * moved_soc < 0 &&
         std::abs(moved_v) > fault_limits.inverted_v;
}

void check_sign(Record& r, const Cell& cell, RecordingCheck& found) {
  const measurement::StepCorrelation edges =
      measurement::step_correlation(r.current_a, r.voltage_v, fault_limits.edge_c * cell.capacity_ah);
  const bool by_edges = edges.steps >= fault_limits.edges_for_sign &&
                        edges.product < fault_limits.inverted_correlation * edges.limit &&
                        edges.opposed > edges.steps * fault_limits.inverted_edges / fault_limits.inverted_of;
  if (by_edges || moves_against_charge(r, cell)) found.faults.push_back(inverted_current());
}

}  // namespace

DataFault inverted_current() {
  return {"current_inverted",
          "The voltage falls where the current rises, so the sign of the current is inverted. Charging "
          "must be positive: change the sign.",
          {}};
}

double longest_unchanged_s(std::span<const double> time_s, std::span<const double> current_a, double capacity_ah) {
  const double usual_step_s = measurement::upper_median(measurement::time_steps(time_s));
  std::size_t steps = 0, unchanged = 0;
  double longest_s = 0;
  for (const std::size_t k : measurement::rows_after_gaps(time_s, fault_limits.gap_steps * usual_step_s)) {
    const double dt_s = time_s[k] - time_s[k - 1];
    if (dt_s < fault_limits.gap_at_least_s) continue;
    ++steps;
    if (!(std::abs(current_a[k] - current_a[k - 1]) < fault_limits.unchanged_c * capacity_ah)) continue;
    ++unchanged;
    longest_s = std::max(longest_s, dt_s);
  }
  const bool on_change = unchanged >= fault_limits.unchanged_steps &&
                         static_cast<double>(unchanged) >= fault_limits.unchanged_share * static_cast<double>(steps);
  return on_change ? longest_s * fault_limits.unchanged_longer : 0;
}

RecordingCheck check_recording(PreparedRecording& r, const model::CellParameters<>& cell) {
  RecordingCheck found;
  if (check_units(r, cell, found)) return found;
  for (const auto check : {check_dropouts, check_spikes, check_stuck_voltage, check_gaps, check_sign})
    check(r, cell, found);
  return found;
}

}  // namespace bms::diagnosis
