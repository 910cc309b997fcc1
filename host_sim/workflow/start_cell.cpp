#include "workflow/start_cell.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "measurement/recording_checks.hpp"
#include "workflow/loaded_ocv.hpp"
#include "workflow/rest_ocv.hpp"

namespace bms::workflow {

namespace {

constexpr double least_of_start = 0.7,
                 most_of_start = 1.4;  ///< capacity of a worn cell, or of a new one; not of another
constexpr double same_capacity = 0.2;  ///< between a stated capacity and the charge of slow runs

void derive(const IdentifyOptions& options, const std::vector<measurement::Recording>& recordings, StartCell& start,
            std::vector<measurement::Warning>& warnings) {
  const std::string chemistry = options.chemistry.empty() ? chemistry_of(recordings) : options.chemistry;
  start.limits_source = derive_limits(options.limits, chemistry, recordings, start.cell);
  if (start.other_cell) start.cell.chemistry = chemistry;
  if (start.limits_source == "stated by the user") return;
  const model::Limits& l = start.cell.parameters.limits;
  warnings.push_back(
      {"limits_derived",
       fmt::format("limits of use: {:g} to {:g} V, {:g} A charging, {:g} A discharging; {}", l.voltage_min_v,
                   l.voltage_max_v, l.charge_current_max_a, l.discharge_current_max_a, start.limits_source)});
}

/// State of charge at the start of a recording. option: that asks for it.
double first_soc(const IdentifyOptions& options, const measurement::Recording& r, const char* option) {
  if (options.initial_soc.value) return *options.initial_soc.value;
  if (r.soc_ref.empty()) throw files::BadInput(option, 1, "no state of charge at the start, expected --initial-soc");
  return r.soc_ref.front();
}

void take_ocv_from_load(const IdentifyOptions& options, const std::vector<measurement::Recording>& recordings,
                        StartCell& start, std::vector<measurement::Warning>& warnings) {
  std::vector<LoadedRecording> loaded;
  for (const measurement::Recording& r : recordings) loaded.push_back({&r, first_soc(options, r, "--ocv-from-load")});
  try {
    const LoadedOcv ocv = take_ocv_from_load(loaded, start.cell);
    const std::string source = fmt::format(
        "voltages under load from {:.0f} to {:.0f} % plus the drop over {:.3g} ohm, the median of {} steps of the "
        "current; good to {:.0f} mV",
        100 * ocv.soc_min, 100 * ocv.soc_max, ocv.resistance_ohm, ocv.steps, 1e3 * ocv.error_v);
    start.cell.sources["ocv"] = source;
    start.ocv_error_v = ocv.error_v;
    model::CellParameters<>& p = start.cell.parameters;
    p.tolerance.ocv_v = std::clamp(ocv.error_v, 0.0005, 0.1);
    p.noise.rest_v = std::clamp(ocv.error_v, p.noise.rest_v, 0.5);
    warnings.push_back({"ocv_from_load", "OCV from " + source});
  } catch (const std::invalid_argument& error) {
    throw files::BadInput(options.recordings.front(), 1, error.what());
  }
}

void take_ocv_from_rests(const IdentifyOptions& options, const std::vector<measurement::Recording>& recordings,
                         StartCell& start, std::vector<measurement::Warning>& warnings) {
  std::vector<RestedPoint> points;
  for (const measurement::Recording& r : recordings) {
    const double first = first_soc(options, r, "--ocv-from-rests");
    const auto of = rested_points(r, first, start.cell.parameters.capacity_ah);
    points.insert(points.end(), of.begin(), of.end());
  }
  try {
    const RestedOcv ocv = move_ocv_to(std::move(points), start.cell);
    const std::string source =
        fmt::format("{} rests from {:.0f} to {:.0f} %; between them and beyond them the shape of {}", ocv.points,
                    100 * ocv.soc_min, 100 * ocv.soc_max, options.start);
    start.cell.sources["ocv"] = source;
    start.ocv_error_v = ocv.error_v;
    start.cell.parameters.tolerance.ocv_v = std::clamp(ocv.error_v, 0.0005, 0.1);
    // beyond the rests the curve is that of another cell: as wrong as cells of one chemistry differ near full and empty
    constexpr double unknown_v = 0.02, covered_low = 0.15, covered_high = 0.95;
    const bool covered = ocv.soc_min <= covered_low && ocv.soc_max >= covered_high;
    const double rest_v = covered ? ocv.error_v : std::max(ocv.error_v, unknown_v);
    start.cell.parameters.noise.rest_v = std::clamp(rest_v, start.cell.parameters.noise.rest_v, 0.5);
    warnings.push_back({"ocv_from_rests", "OCV from " + source});
  } catch (const std::invalid_argument& error) {
    throw files::BadInput(options.recordings.front(), 1, error.what());
  }
}

}  // namespace

StartCell read_start(const IdentifyOptions& options) {
  StartCell start;
  start.cell = options.start_cell ? *options.start_cell : files::read_cell(options.start);
  start.capacity_ah = start.cell.parameters.capacity_ah;
  start.cell.pulses = {};  // its maker states them for that cell, and recordings do not show them
  start.cell.sources.erase("pulses");
  model::CellParameters<>& p = start.cell.parameters;
  p.reference_temperature_c = options.reference_temperature_c.value_or(p.reference_temperature_c);
  if (!options.ocv.empty()) {
    start.ocv = identify_ocv(options.ocv, options.reading, options.ocv_error_v, options.extend, start.cell);
    if (options.capacity_ah > 0 && std::abs(p.capacity_ah / options.capacity_ah - 1) > same_capacity) {
      throw files::BadInput(options.ocv.front(), 1,
                            fmt::format("the slow runs move {:.4g} Ah, expected the {:g} Ah of --capacity-ah",
                                        p.capacity_ah, options.capacity_ah));
    }
  }
  constexpr double complete = 0.95;  ///< of the capacity, that slow runs move
  if (!options.ocv.empty() && options.capacity_ah > 0 && p.capacity_ah < complete * options.capacity_ah) {
    throw files::BadInput(
        options.ocv.front(), 1,
        fmt::format(
            "the slow runs move {:.4g} of the {:g} Ah of --capacity-ah, {:.0f} % of the state of charge, and are "
            "not stretched to all of it; expected complete runs, or no --capacity-ah if they are complete",
            p.capacity_ah, options.capacity_ah, 100 * p.capacity_ah / options.capacity_ah));
  }
  const double capacity_ah = options.capacity_ah > 0 ? options.capacity_ah : p.capacity_ah;
  const double of_start = capacity_ah / start.capacity_ah;
  start.other_cell = of_start < least_of_start || of_start > most_of_start || !options.chemistry.empty();
  p.capacity_ah = start.other_cell ? start.capacity_ah : capacity_ah;
  if (start.other_cell) scale_to(capacity_ah, start.cell);
  if (options.extend) identify_hysteresis(start.ocv, start.cell);
  start.has_hysteresis = options.extend && !start.cell.mechanisms.empty();
  if (options.ocv_branch && p.ocv.half_gap_v.size > 0) p = identification::with_ocv_branch(p, *options.ocv_branch);
  return start;
}

/// Standard deviation of the branch position around its mean over a recording: uniform over half of the way to either
/// branch.
constexpr double branch_wanders = 0.29;

double ocv_sigma_v(const OcvResult& ocv, const model::CellParameters<>& p) {
  const double overvoltage_v =
      ocv.coulombic_efficiency
          ? branch_wanders * model::plateau_half_gap_v(p.ocv)
          : ocv.largest_a * (identification::mean_of(p.rc.r0_ohm) + identification::mean_of(p.rc.r1_ohm));
  return std::hypot(p.tolerance.ocv_v, overvoltage_v);
}

void adapt_start(const IdentifyOptions& options, const std::vector<measurement::Recording>& recordings,
                 StartCell& start, std::vector<measurement::Warning>& warnings) {
  if (start.other_cell || options.limits.any()) derive(options, recordings, start, warnings);
  if (options.ocv_from_rests) {
    take_ocv_from_rests(options, recordings, start, warnings);
  } else if (options.ocv_from_load) {
    take_ocv_from_load(options, recordings, start, warnings);
  } else if (start.other_cell && options.ocv.empty()) {
    warnings.push_back(
        {"ocv_of_start",
         fmt::format("the OCV is that of {}: --ocv-from-rests takes it from the rests of "
                     "the recordings, --ocv-from-load from a discharge under load, --ocv from a slow charge or "
                     "discharge",
                     options.start)});
  }
}

void check_size(const IdentifyOptions& options, const StartCell& start, const measurement::Recording& r) {
  if (const std::string what = measurement::contradiction(r); !what.empty()) throw files::BadInput(r.path, 1, what);
  for (const measurement::Warning& w : r.warnings) {
    if (w.id != "charge_exceeds_capacity") continue;
    std::string origin = options.ocv.empty() ? options.start : "--ocv";
    if (options.capacity_ah > 0) origin = "--capacity-ah";
    throw files::BadInput(r.path, 1,
                          fmt::format("{}; its {:g} Ah are those of {}, expected the capacity of this cell: "
                                      "--capacity-ah, or --ocv with a slow charge or discharge",
                                      w.text, start.cell.parameters.capacity_ah, origin));
  }
}

}  // namespace bms::workflow
