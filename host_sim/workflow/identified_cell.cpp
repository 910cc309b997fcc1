#include "workflow/identified_cell.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "identification/joint_fit.hpp"
#include "identification/ocv_pieces.hpp"
#include "measurement/statistics.hpp"
#include "model/cell_fields.hpp"
#include "replay/simulation.hpp"
#include "workflow/reference_temperature.hpp"
#include "workflow/slow_parts.hpp"

namespace bms::workflow {

namespace id = identification;

namespace {

/// Slow runs of similar temperature.
struct SlowRuns {
  double temperature_c = 0;
  std::vector<id::SlowRun> runs;
  std::string files;
};

/// Ordered by their distance to the reference temperature, the nearest first.
std::vector<SlowRuns> slow_runs(const std::vector<std::string>& paths, const files::ReadOptions& reading,
                                double reference_c, std::vector<std::string>& read_as) {
  std::vector<measurement::Recording> recordings;
  for (const std::string& path : paths) {
    recordings.push_back(files::read_recording(path, files::VoltageColumn::required, reading));
    if (!recordings.back().read_as.empty()) read_as.push_back(path + ": " + recordings.back().read_as);
  }
  std::vector<SlowRuns> all;
  for (const TemperatureGroup& like : group_by_temperature(recordings, reference_c)) {
    SlowRuns& runs = all.emplace_back(SlowRuns{like.temperature_c, {}, {}});
    for (const std::size_t k : like.recordings) {
      for (const id::SlowRun& run : runs_of(recordings[k])) runs.runs.push_back(run);
      runs.files += (runs.files.empty() ? "" : ", ") + std::filesystem::path(paths[k]).filename().string();
    }
  }
  std::stable_sort(all.begin(), all.end(), [&](const SlowRuns& a, const SlowRuns& b) {
    return std::abs(a.temperature_c - reference_c) < std::abs(b.temperature_c - reference_c);
  });
  return all;
}

}  // namespace

std::vector<TemperatureGroup> group_by_temperature(const std::vector<measurement::Recording>& recordings,
                                                   double reference_c) {
  constexpr double largest_span_k = 5;
  std::vector<double> means_c;
  for (const measurement::Recording& r : recordings) means_c.push_back(measurement::mean(r.temperature_c));
  const bool known = std::none_of(means_c.begin(), means_c.end(), [](double c) { return std::isnan(c); });
  std::vector<TemperatureGroup> groups;
  for (std::vector<std::size_t>& like : measurement::groups_within(means_c, largest_span_k)) {
    double sum_c = 0;
    for (const std::size_t k : like) sum_c += means_c[k];
    const double mean_c = std::round(10 * sum_c / static_cast<double>(like.size())) / 10;
    std::sort(like.begin(), like.end());
    groups.push_back({known ? mean_c : reference_c, std::move(like)});
  }
  return groups;
}

OcvResult identify_ocv(const std::vector<std::string>& paths, const files::ReadOptions& reading, double max_error_v,
                       bool both_branches, files::CellFile& cell) {
  OcvResult taken;
  const auto groups = slow_runs(paths, reading, cell.parameters.reference_temperature_c, taken.read_as);
  const std::string& files = groups.front().files;
  std::vector<id::CurveAtTemperature> curves;
  try {
    for (const SlowRuns& group : groups) curves.push_back({group.temperature_c, id::ocv_curve(group.runs)});
  } catch (const std::invalid_argument& error) {
    throw files::BadInput(paths.front(), 1, error.what());
  }
  const double reference_c = cell.parameters.reference_temperature_c;
  taken.temperatures = curves.size();
  if (both_branches) taken.branches = id::fit_branches(curves, reference_c);
  const id::OcvCurve curve =
      taken.branches ? id::moved_to_reference(curves.front(), *taken.branches) : curves.front().curve;
  double error_v = max_error_v;
  auto pieces = id::fewest_pieces(curve, error_v);
  while (!pieces || pieces->soc.size() > model::max_ocv_edges) {
    error_v *= 1.5;
    if (error_v > 0.05)
      throw files::BadInput(paths.front(), 1,
                            "the open-circuit voltage does not rise with the state of charge, expected slow "
                            "recordings of a complete charge or discharge");
    pieces = id::fewest_pieces(curve, error_v);
  }
  if (error_v > max_error_v) {
    taken.warnings.push_back(
        {"ocv_error",
         fmt::format("the error of the straight pieces of the OCV is up to {:.1f} mV, {:.1f} mV were requested",
                     1e3 * pieces->largest_error_v, 1e3 * max_error_v)});
  }
  // the prepared cell has an interval between neighbouring corners of the OCV or nodes of R0, R1, C1
  constexpr std::size_t most_corners = model::max_ocv_edges;
  if (both_branches && curve.coulombic_efficiency) id::add_gap_corners(*pieces, curve, error_v, most_corners);
  auto& ocv = cell.parameters.ocv;
  ocv = {};
  ocv.lean = curve.branch;
  for (std::size_t k = 0; k < pieces->soc.size(); ++k) {
    ocv.soc.push_back(pieces->soc[k]);
    if (curve.coulombic_efficiency) ocv.half_gap_v.push_back(pieces->half_gap_v[k]);
    if (k == 0) continue;
    const double b1_v = (pieces->ocv_v[k] - pieces->ocv_v[k - 1]) / (pieces->soc[k] - pieces->soc[k - 1]);
    ocv.b0_v.push_back(pieces->ocv_v[k] - b1_v * pieces->soc[k]);
    ocv.b1_v.push_back(b1_v);
  }
  cell.parameters.tolerance.ocv_v = std::max(0.0005, pieces->largest_error_v);
  cell.parameters.capacity_ah = curve.capacity_ah;
  taken.largest_a = curves.front().curve.largest_a;
  taken.coulombic_efficiency = curve.coulombic_efficiency;
  cell.sources["ocv"] = fmt::format("{} of {}; {} straight pieces, within {:.1f} mV",
                                    curve.coulombic_efficiency ? "middle of slow charge and discharge" : "slow run",
                                    files, pieces->soc.size() - 1, 1e3 * pieces->largest_error_v);
  return taken;
}

void identify_noise(const std::vector<measurement::Recording>& recordings, const id::FitStatistics& judge,
                    const std::vector<id::Parameter>& parameters, model::CellParameters<>& p) {
  std::vector<double> voltage_steps, current_steps;
  double step_s = 1;
  for (const measurement::Recording& r : recordings) {
    const double quiet_a = 0.02 * p.capacity_ah;
    for (std::size_t k = 2; k < r.rows(); ++k) {
      if (std::abs(r.current_a[k]) > quiet_a || std::abs(r.current_a[k - 1]) > quiet_a ||
          std::abs(r.current_a[k - 2]) > quiet_a)
        continue;
      // second differences, because slow relaxation is not noise
      const double v = r.voltage_v[k] - 2 * r.voltage_v[k - 1] + r.voltage_v[k - 2];
      const double i = r.current_a[k] - 2 * r.current_a[k - 1] + r.current_a[k - 2];
      if (!std::isfinite(v) || !std::isfinite(i)) continue;
      voltage_steps.push_back(v * v);
      current_steps.push_back(i * i);
    }
    step_s = std::max(0.01, r.duration_s() / static_cast<double>(r.rows() - 1));
  }
  const auto sigma = [](const std::vector<double>& squares) {
    double sum = 0;
    for (const double s : squares) sum += s;
    return std::sqrt(sum / static_cast<double>(squares.size()) / 6);  // variance of a second difference: 1 + 4 + 1
  };
  constexpr std::size_t enough = 30;
  if (voltage_steps.size() >= enough) {
    p.noise.voltage_v = std::clamp(sigma(voltage_steps), 0.0002, 0.05);
    p.noise.current_a = std::clamp(sigma(current_steps), 1e-4 * p.capacity_ah, 0.1 * p.capacity_ah);
  }
  double model_v = judge.rmse_v;
  // the mean is included, because it is a persistent error
  p.noise.model_correlation_s =
      std::clamp(id::correlation_length(id::without_missing(judge.error_v)) * step_s, 1.0, 20'000.0);
  if (p.ocv.half_gap_v.size > 0) {
    double gap_v = 0;
    for (std::size_t k = 0; k < p.ocv.half_gap_v.size; ++k) {
      if (p.ocv.soc[k] > 0.1 && p.ocv.soc[k] < 0.95) gap_v = std::max(gap_v, p.ocv.half_gap_v[k]);
    }
    // The voltage is somewhere between the slow curves, and the model has a position between them. The error towards
    // the far curve need not have appeared in any recording. It is taken as uniformly distributed, and it lasts until
    // the current has reversed for a large part of an hour.
    model_v = std::max(model_v, (1 + std::abs(p.ocv.lean)) * gap_v / std::sqrt(3.0));
    p.noise.model_correlation_s = std::max(p.noise.model_correlation_s, 3'000.0);
    p.noise.rest_v = std::clamp((1 + std::abs(p.ocv.lean)) * gap_v, p.noise.rest_v, 0.2);
  }
  p.noise.model_v = std::clamp(model_v, 0.0005, 0.2);
  double largest = 0.005;
  for (const id::Parameter& q : parameters) {
    if (q.name == "r0_ohm" && q.value > 0) largest = std::max(largest, std::min(0.5, 2 * q.std / q.value));
  }
  p.tolerance.resistance_fraction = largest;
}

namespace {

/// The mechanism with the default values of the catalogue.
model::MechanismSetting default_mechanism(std::string_view id, const model::CellParameters<>& cell) {
  return model::default_setting(model::mechanism_index(id), cell);
}

}  // namespace

void identify_hysteresis(const OcvResult& ocv, files::CellFile& cell) {
  const model::CellParameters<>& p = cell.parameters;
  const double between_v = model::plateau_half_gap_v(p.ocv);
  if (!(between_v > 0)) return;
  // overvoltage of the slow current (C/30 to C/35)
  const double over_v = p.capacity_ah / 30 * (id::mean_of(p.rc.r0_ohm) + id::mean_of(p.rc.r1_ohm));
  model::MechanismSetting setting = default_mechanism("ocv_hysteresis", p);
  setting.value[0] = std::clamp(between_v - over_v, 0.1 * between_v, 0.07);
  setting.value[4] = 1;
  files::put_mechanism(cell, setting);
  cell.sources["mechanism.ocv_hysteresis"] =
      fmt::format("gap of slow charge and discharge, less {:.1f} mV over R0 and R1", 1e3 * over_v);
  if (!ocv.branches) return;
  const auto put = [&](std::string_view mechanism, const auto& values) {
    model::MechanismSetting with_values = default_mechanism(mechanism, p);
    std::copy(values.begin(), values.end(), with_values.value.begin());
    files::put_mechanism(cell, with_values);
    cell.sources[fmt::format("mechanism.{}", mechanism)] =
        fmt::format("slow runs at {} temperatures; {:.1f} mV RMS between law and runs", ocv.temperatures,
                    1e3 * ocv.branches->residual_v);
  };
  put("branch_temperature", id::for_half_gap(*ocv.branches, setting.value[0]));
  put("entropic_ocv", ocv.branches->entropic);
}

id::DataSet without_mechanisms(const files::CellFile& cell, const IdentificationData& of) {
  id::DataSet record = of.record;
  const auto tables = model::prepare<double, model::max_intervals>(cell.parameters);
  const auto simulated = [&](std::span<const model::MechanismSetting> mechanisms) {
    return replay::simulate({.cell = tables,
                             .capacity_ah = cell.parameters.capacity_ah,
                             .mechanisms = mechanisms,
                             .time_s = record.data.time_s,
                             .current_a = record.data.current_a,
                             .temperature_c = of.temperature_c,
                             .initial_soc = record.initial_soc});
  };
  const auto with = simulated(cell.mechanisms), without = simulated({});
  for (std::size_t k = 0; k < record.data.size(); ++k)
    record.data.voltage_v.edit()[k] -= with[k].voltage_v - without[k].voltage_v;
  return record;
}

namespace {

struct Rounding {
  static void table(const char*) {}
  static bool optional_table(const char*, bool known) { return known; }
  static void number(const char*, double& value) { value = std::stod(fmt::format("{:.7g}", value)); }
  static void optional_number(const char* key, double& value, double /*omitted*/ = 0) { number(key, value); }
  static void optional_flag(const char*, bool&) {}
  template <class Column>
  static void column(const char* key, Column& values) {
    for (std::size_t k = 0; k < values.size; ++k) number(key, values[k]);
  }
  template <class Column>
  static void optional_column(const char* key, Column& values) {
    column(key, values);
  }
};

}  // namespace

void round_digits(files::CellFile& cell) {
  Rounding rounding;
  model::visit_cell(rounding, cell.parameters);
  for (files::TemperatureTable& at : cell.at_temperature) model::visit_rc(rounding, at.rc);
  for (model::MechanismSetting& m : cell.mechanisms) {
    for (double& v : m.value) Rounding::number("", v);
  }
}

}  // namespace bms::workflow
