#include "measurement/recording_checks.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <fmt/format.h>

#include "measurement/silent_current.hpp"
#include "measurement/spans.hpp"
#include "measurement/statistics.hpp"
#include "model/ocv_voltage.hpp"

namespace bms::measurement {

namespace {

constexpr double gap_steps = 10;               ///< a longer step is a gap, in median steps
constexpr double inverted_correlation = -0.3;  ///< of the steps of current and voltage
constexpr double soc_ref_min = -0.5, soc_ref_max = 1.5;
constexpr double millivolt_factor = 100;   ///< median voltage over the cell's largest voltage
constexpr double pack_factor = 1.5;        ///< the same, of cells in series
constexpr double milliampere_factor = 20;  ///< median current over the cell's largest current
constexpr double largest_c_rate = 60;      ///< [1/h] no cell sustains more
constexpr double voltage_margin_v = 0.05;  ///< beyond the limits of the cell file
constexpr double current_margin_factor = 1.05;
constexpr double most_capacities = 1.25;       ///< that a current can move in one direction: a full cell, and an error
constexpr double least_kelvin = 150;           ///< no cell is as hot in degrees C, and none as cold in kelvin
constexpr double millisecond_capacities = 10;  ///< that a current moves if its milliseconds are read as seconds
constexpr double millisecond_step_s = 100;  ///< the usual step of a log of 10 Hz whose milliseconds are read as seconds

void check_time(Recording& r) {
  std::size_t duplicates = 0, first_duplicate = 0;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    if (!(r.time_s[k] - r.time_s[k - 1] > 0) && duplicates++ == 0) first_duplicate = k;
  }
  if (duplicates > 0) {
    r.warnings.push_back(
        {"duplicate_time",
         fmt::format("rows that repeat the time of the previous row: {}, the first at {:g} s; they are not used",
                     duplicates, r.time_s[first_duplicate])});
  }
  const double largest_s = gap_steps * usual_step_s(r);
  if (const auto rows = rows_after_gaps(r.time_s, largest_s); !rows.empty()) {
    r.warnings.push_back({"gap", fmt::format("gaps longer than {:g} s: {}, the first after {:g} s", largest_s,
                                             rows.size(), r.time_s[rows.front() - 1])});
  }
}

/// The voltage of a cell rises where its current rises. If it falls, the recording has the other sign convention.
void check_sign(Recording& r) {
  const StepCorrelation all = step_correlation(r.current_a, r.voltage_v, 0);
  if (all.product < inverted_correlation * all.limit && all.product < 0) {
    r.warnings.push_back({"current_inverted",
                          "the voltage falls where the current rises: the sign of the current looks inverted, "
                          "expected current_a > 0 while charging"});
  }
}

std::size_t count_outside(const Column& values, double low, double high) {
  return static_cast<std::size_t>(
      std::count_if(values.begin(), values.end(), [&](double v) { return v < low || v > high; }));
}

void warn_outside(Recording& r, std::size_t count, const std::string& what, double low, double high,
                  const std::string& unit) {
  if (count == 0) return;
  r.warnings.push_back(
      {"outside_cell_range", fmt::format("{} outside the cell's {} to {} {}: {}", what, low, high, unit, count)});
}

void check_voltage(Recording& r, const model::CellParameters<>& cell) {
  const model::Limits& limits = cell.limits;
  const double usual_v = upper_median(r.voltage_v.copy());
  if (usual_v > millivolt_factor * limits.voltage_max_v) {
    r.warnings.push_back(
        {"voltage_in_mv",
         fmt::format("voltages around {:g} look like millivolts, expected volts; they are not used", usual_v)});
    return;
  }
  if (usual_v > pack_factor * limits.voltage_max_v) {
    const double cells = std::max(2.0, std::round(usual_v / model::ocv_voltage(cell.ocv, 0.5)));
    r.warnings.push_back(
        {"pack_voltage", fmt::format("voltages around {:g} V look like those of about {:.0f} cells in series, expected "
                                     "one cell of at most {:g} V",
                                     usual_v, cells, limits.voltage_max_v)});
    return;
  }
  warn_outside(
      r, count_outside(r.voltage_v, limits.voltage_min_v - voltage_margin_v, limits.voltage_max_v + voltage_margin_v),
      "voltages", limits.voltage_min_v, limits.voltage_max_v, "V");
}

void check_current(Recording& r, const model::CellParameters<>& cell) {
  const model::Limits& limits = cell.limits;
  std::vector<double> magnitudes;
  for (const double i : r.current_a) {
    if (std::abs(i) > 0) magnitudes.push_back(std::abs(i));
  }
  const double usual_a = upper_median(magnitudes);
  const double largest_a = std::max(limits.charge_current_max_a, limits.discharge_current_max_a);
  if (usual_a > milliampere_factor * largest_a || usual_a > largest_c_rate * cell.capacity_ah) {
    r.warnings.push_back(
        {"current_in_ma", fmt::format("currents around {:g} look like milliamperes, expected amperes", usual_a)});
    return;
  }
  warn_outside(r,
               count_outside(r.current_a, -current_margin_factor * limits.discharge_current_max_a,
                             current_margin_factor * limits.charge_current_max_a),
               "continuous currents", -limits.discharge_current_max_a, limits.charge_current_max_a, "A");
}

/// Largest difference between two states of charge that the current alone leads to, in Ah. Gaps do not count.
double charge_range_ah(const Recording& r) {
  const double gap_s = gap_steps * usual_step_s(r);
  double charge_as = 0, lowest_as = 0, highest_as = 0;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const double step_s = r.time_s[k] - r.time_s[k - 1];
    if (step_s > gap_s || std::isnan(r.current_a[k])) continue;
    charge_as += r.current_a[k] * step_s;
    lowest_as = std::min(lowest_as, charge_as);
    highest_as = std::max(highest_as, charge_as);
  }
  return (highest_as - lowest_as) / 3'600;
}

/// A current that moves more than the capacity in one direction contradicts the time, the current or the capacity.
void check_charge(Recording& r, const model::CellParameters<>& cell) {
  for (const Warning& w : r.warnings) {
    if (w.id == "current_in_ma") return;  // explains it
  }
  const double moved_ah = charge_range_ah(r);
  if (!(moved_ah > most_capacities * cell.capacity_ah)) return;
  const double step_s = usual_step_s(r);
  if (step_s >= millisecond_step_s && moved_ah > millisecond_capacities * cell.capacity_ah) {
    r.warnings.push_back(
        {"time_in_ms", fmt::format("the usual time step is {:g} and the current moves {:.1f} Ah, the cell has {:g} Ah: "
                                   "the times look like milliseconds, expected seconds",
                                   step_s, moved_ah, cell.capacity_ah)});
    return;
  }
  r.warnings.push_back(
      {"charge_exceeds_capacity",
       fmt::format("the current moves {:.1f} Ah, the cell has {:g} Ah: the current has another unit or "
                   "an offset, or the cell file is of another cell",
                   moved_ah, cell.capacity_ah)});
}

}  // namespace

double usual_step_s(const Recording& r) {
  std::vector<double> steps;
  steps.reserve(r.rows());
  for (std::size_t k = 1; k < r.rows(); ++k) {
    if (const double step = r.time_s[k] - r.time_s[k - 1]; step > 0) steps.push_back(step);
  }
  return upper_median(steps);
}

void check_recording(Recording& r) {
  check_time(r);
  check_sign(r);
  if (count_outside(r.soc_ref, soc_ref_min, soc_ref_max) > 0) {
    r.warnings.push_back(
        {"soc_ref_in_percent", "soc_ref is far outside 0 to 1: it looks like percent, expected a fraction"});
  }
  if (r.rows() == 0) return;
  if (std::string text = silent_current_text(silent_currents(r), r.time_s.front()); !text.empty())
    r.warnings.push_back({"current_silent", std::move(text)});
}

void compare_with_cell(Recording& r, const model::CellParameters<>& cell) {
  check_voltage(r, cell);
  check_current(r, cell);
  check_charge(r, cell);
  const double usual_c = r.temperature_c.empty() ? 0 : upper_median(r.temperature_c.copy());
  if (usual_c > least_kelvin) {
    r.warnings.push_back(
        {"temperature_in_k", fmt::format("temperatures around {:g} look like kelvin, expected degrees C", usual_c)});
    return;
  }
  warn_outside(r, count_outside(r.temperature_c, cell.limits.temperature_min_c, cell.limits.temperature_max_c),
               "temperatures", cell.limits.temperature_min_c, cell.limits.temperature_max_c, "degrees C");
}

std::string_view unit_option(const Warning& warning) {
  if (warning.id == "time_in_ms") return "--unit time_s=ms";
  if (warning.id == "temperature_in_k") return "--unit temperature_c=K";
  if (warning.id == "voltage_in_mv") return "--unit voltage_v=mV";
  if (warning.id == "current_in_ma") return "--unit current_a=mA";
  if (warning.id == "pack_voltage") return "--map pack_voltage_v=COLUMN --series N";
  return {};
}

std::string contradiction(const Recording& r) {
  for (const Warning& w : r.warnings) {
    const std::string_view option = unit_option(w);
    if (option.empty()) continue;
    return fmt::format("{}: {}{}", w.text, option, w.id == "pack_voltage" ? ", or the columns of the cells" : "");
  }
  return {};
}

}  // namespace bms::measurement
