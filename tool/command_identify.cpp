#include "tool/command_identify.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/recording.hpp"
#include "identification/identify.hpp"
#include "identification/linear_models.hpp"
#include "identification/prefilter.hpp"
#include "measurement/recording_checks.hpp"
#include "reports/identify_page.hpp"
#include "reports/json_results.hpp"
#include "workflow/identification_data.hpp"
#include "workflow/identified_cell.hpp"

namespace bms::tool {

namespace {

namespace id = identification;

id::Method method_of(const std::string& name) {
  for (const id::Method m :
       {id::Method::subspace_gauss_newton, id::Method::adaptive_subspace_gauss_newton, id::Method::levenberg_marquardt,
        id::Method::steepest_descent, id::Method::trust_region_reflective}) {
    if (name == id::name_of(m)) return m;
  }
  throw files::BadInput("--optimizer", 1, "no such optimiser '" + name + "', expected one of: gn, agn, lm, sd, nls");
}

void filter(const IdentifyOptions& options, const std::string& path, id::Data& data) {
  try {
    if (options.remove_offset) {
      const id::Offset offset = id::offset_at_rest(data);
      if (offset.samples == 0) warn(path + ": no rest to read the current's offset from, nothing was subtracted");
      for (double& i : data.current_a) i -= offset.current_a;
    }
    if (options.filter_hz > 0)
      data.current_a = id::filter_zero_phase(
          id::butterworth_low_pass(options.filter_hz, 1 / id::even_step_s(data.time_s)), data.current_a);
  } catch (const std::invalid_argument& error) {
    throw files::BadInput(path, 1, error.what());
  }
}

std::string warning_text(const std::string& warning) { return warning.substr(warning.find(": ") + 2); }

void add_warnings(reports::IdentifyResult& result) {
  for (const std::string& w : result.identification.warnings)
    result.warnings.push_back({w.substr(0, w.find(':')), warning_text(w)});
}

std::string name_of_cell(const IdentifyOptions& options) {
  return !options.name.empty() ? options.name : std::filesystem::path(options.out).stem().string();
}

workflow::SocWindow validation_window(const IdentifyOptions& options) {
  return workflow::window_of("--validate-window",
                             options.validate_window.empty() ? options.window : options.validate_window);
}

/// recordings: the first that was identified from, then those that validate.
void finish(const IdentifyOptions& options, const std::vector<id::Data>& recordings,
            std::chrono::steady_clock::time_point begin, reports::IdentifyResult& result) {
  for (const measurement::Warning& w : result.warnings) warn(w.text);
  result.out = options.out;
  result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (!options.output.json.empty()) write_output(options.output.json, reports::json_of(result));
  if (!options.output.report.empty()) write_output(options.output.report, reports::identify_report(result, recordings));
  const id::Identification& found = result.identification;
  std::string text = fmt::format("{} samples: {:.2f} mV RMS open loop, fit {:.1f} %, one step ahead {:.1f} %. {}\n",
                                 found.estimation.samples, 1e3 * found.estimation.rmse_v, found.estimation.fit_percent,
                                 found.estimation.one_step_fit_percent, found.optimum.reason);
  for (const id::Parameter& p : found.parameters) {
    text += fmt::format("  {:8} {:3.0f} %{}  {:10.5g} +- {:.2g}{}\n", p.name, 100 * p.soc,
                        p.temperature_c ? fmt::format(" {:5.1f} C", *p.temperature_c) : "", p.value, p.std,
                        p.at_bound ? "  at its bound" : "");
  }
  for (const auto& [path, fit] : result.validations)
    text += fmt::format("Validated on {}: {:.2f} mV RMS, fit {:.1f} %.\n", path, 1e3 * fit.rmse_v, fit.fit_percent);
  print_summary(options.output, text + (result.cell.empty() ? "No cell file." : "Cell file: " + options.out));
}

/// Records of like temperature.
struct Group {
  double temperature_c = 25;
  std::vector<id::DataSet> records;
};

std::vector<Group> grouped(const std::vector<measurement::Recording>& recordings,
                           const std::vector<id::DataSet>& records) {
  std::vector<Group> groups;
  for (const workflow::TemperatureGroup& like : workflow::group_by_temperature(recordings)) {
    Group& group = groups.emplace_back(Group{like.temperature_c, {}});
    for (const std::size_t k : like.recordings) group.records.push_back(records[k]);
  }
  return groups;
}

/// Each group's table. The OCV and its lean are those of the main group.
std::vector<files::TemperatureTable> at_temperatures(const std::vector<Group>& groups, std::size_t main_group,
                                                     id::GreyBoxOptions options, id::Method method,
                                                     reports::IdentifyResult& result) {
  std::vector<files::TemperatureTable> tables;
  const model::CellParameters<> main_cell = result.identification.cell;
  options.estimate_ocv_branch = false;
  for (id::Parameter& p : result.identification.parameters) p.temperature_c = groups[main_group].temperature_c;
  for (std::size_t k = 0; k < groups.size(); ++k) {
    if (k == main_group) {
      tables.push_back({groups[k].temperature_c, main_cell.rc});
      continue;
    }
    id::Identification found = id::identify_grey_box(main_cell, groups[k].records, options, method);
    tables.push_back({groups[k].temperature_c, found.cell.rc});
    for (id::Parameter& p : found.parameters) {
      p.temperature_c = groups[k].temperature_c;
      result.identification.parameters.push_back(p);
    }
    for (const std::string& w : found.warnings)
      result.warnings.push_back(
          {w.substr(0, w.find(':')), fmt::format("{:g} degrees C: {}", groups[k].temperature_c, warning_text(w))});
  }
  return tables;
}

/// tf, oe, hw: one record. Exit code 1 when what follows the voltage is no circuit: there is no cell file then.
int run_linear(const IdentifyOptions& options, id::Method method, files::CellFile cell, const id::DataSet& record,
               double soc, const workflow::DataOptions& given, reports::IdentifyResult& result) {
  const auto begin = std::chrono::steady_clock::now();
  const id::LinearKind kind = options.model == "tf"   ? id::LinearKind::transfer_function
                              : options.model == "oe" ? id::LinearKind::output_error
                                                      : id::LinearKind::hammerstein_wiener;
  id::LinearIdentification found;
  try {
    found = id::identify_linear(kind, cell.parameters, record.data, soc, method);
  } catch (const std::invalid_argument& error) {
    throw files::BadInput(options.recordings.front(), 1, error.what());
  }
  result.identification = found.identification;
  add_warnings(result);
  if (options.recordings.size() > 1)
    result.warnings.push_back(
        {"first_recording_only", "a linear model is identified from one recording, the first was taken"});
  workflow::DataOptions data = given;
  data.window = validation_window(options);
  std::vector<id::Data> shown = {record.data};
  for (const std::string& path : options.validate) {
    shown.push_back(workflow::identification_data(files::read_recording(path), data).record.data);
    result.validations.push_back({path, id::validate(found.model, shown.back(), found.identification.fading)});
  }
  if (!result.validations.empty()) result.validation = result.validations.front().second;
  const auto& p = result.identification.parameters;  // b1, R0, R1, C1
  cell.parameters.rc = {};
  cell.parameters.rc.soc.push_back(std::clamp(std::round(100 * soc) / 100, 0.0, 1.0));
  cell.parameters.rc.r0_ohm.push_back(p[1].value);
  cell.parameters.rc.r1_ohm.push_back(p[2].value);
  cell.parameters.rc.c1_f.push_back(p[3].value);
  cell.name = name_of_cell(options);
  cell.source = fmt::format("R0, R1, C1 identified from {}; the rest from {}",
                            std::filesystem::path(options.recordings.front()).filename().string(), options.start);
  cell.sources["rc"] = fmt::format("{} by {}, {:.2f} mV RMS", options.model, options.optimizer,
                                   1e3 * result.identification.estimation.rmse_v);
  const model::CellFault fault = model::first_fault(cell.parameters);
  if (fault.what == nullptr) {
    workflow::round_digits(cell);
    write_output(options.out, files::cell_text(cell));
    result.cell = cell.name;
  } else {
    result.warnings.push_back(
        {"no_cell_file",
         fmt::format("what was identified is no cell: '{}' is out of range, expected {}; there is no cell file",
                     fault.key, fault.what)});
  }
  finish(options, shown, begin, result);
  return fault.what == nullptr ? 0 : 1;
}

}  // namespace

int run(const IdentifyOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  reports::IdentifyResult result;
  result.model = options.model;
  result.optimizer = options.optimizer;
  const id::Method method = method_of(options.optimizer);
  files::CellFile cell = files::read_cell(options.start);
  const double start_capacity_ah = cell.parameters.capacity_ah;
  workflow::OcvResult taken;
  if (!options.ocv.empty()) {
    taken = workflow::identify_ocv(options.ocv, options.ocv_error_v, options.extend, cell);
    result.coulombic_efficiency = taken.coulombic_efficiency;
    result.warnings = taken.warnings;
  }
  if (options.capacity_ah > 0) cell.parameters.capacity_ah = options.capacity_ah;
  if (options.extend) workflow::identify_hysteresis(taken, cell);
  const bool has_hysteresis = options.extend && !cell.mechanisms.empty();
  if (options.ocv_branch && cell.parameters.ocv.half_gap_v.size > 0)
    cell.parameters = id::with_ocv_branch(cell.parameters, *options.ocv_branch);

  workflow::DataOptions data{workflow::initial_soc_of(options.initial_soc),
                             workflow::window_of("--window", options.window), cell.parameters};
  std::vector<measurement::Recording> recordings;
  std::vector<id::DataSet> records;
  std::vector<workflow::IdentificationData> measured;
  double soc_min = 1, soc_max = 0;
  for (const std::string& path : options.recordings) {
    recordings.push_back(files::read_recording(path));
    measurement::Recording& r = recordings.back();
    measurement::compare_with_cell(r, cell.parameters);
    for (const measurement::Warning& w : r.warnings) result.warnings.push_back({w.id, path + ": " + w.text});
    workflow::IdentificationData d = workflow::identification_data(r, data);
    filter(options, path, d.record.data);
    records.push_back(has_hysteresis ? workflow::without_mechanisms(cell, d) : d.record);
    soc_min = std::min(soc_min, d.soc_min);
    soc_max = std::max(soc_max, d.soc_max);
    measured.push_back(std::move(d));
  }

  if (options.model != "nlgr")
    return run_linear(options, method, cell, records.front(), (soc_min + soc_max) / 2, data, result);

  // the model's own table comes from the recordings nearest to 25 degrees C, where several temperatures are given
  const auto groups = grouped(recordings, records);
  std::size_t main_group = 0;
  for (std::size_t k = 0; k < groups.size(); ++k) {
    if (std::abs(groups[k].temperature_c - 25) < std::abs(groups[main_group].temperature_c - 25)) main_group = k;
  }
  id::GreyBoxOptions grey_box;
  grey_box.soc_nodes = options.nodes.empty() ? id::nodes_for(soc_min, soc_max) : options.nodes;
  grey_box.bounds = workflow::circuit_bounds(cell.parameters.capacity_ah);
  grey_box.estimate_ocv_branch = !options.ocv_branch && !has_hysteresis && cell.parameters.ocv.half_gap_v.size > 0;
  grey_box.voltage_sigma_v = cell.parameters.noise.voltage_v;
  try {
    result.identification = id::identify_grey_box(
        id::started_from_rests(cell.parameters, groups[main_group].records.front().data, grey_box.bounds),
        groups[main_group].records, grey_box, method);
    add_warnings(result);
    if (groups.size() > 1) cell.at_temperature = at_temperatures(groups, main_group, grey_box, method, result);
  } catch (const std::invalid_argument& error) {
    throw files::BadInput(options.recordings.front(), 1, error.what());
  }

  data.window = validation_window(options);
  std::vector<id::Data> shown = {groups[main_group].records.front().data};
  for (const std::string& path : options.validate) {
    const id::DataSet record = workflow::identification_data(files::read_recording(path), data).record;
    result.validations.push_back(
        {path, id::validate(result.identification.cell, record, result.identification.fading)});
    shown.push_back(record.data);
  }
  if (!result.validations.empty()) result.validation = result.validations.front().second;

  cell.parameters = result.identification.cell;
  workflow::identify_noise(recordings, result.validation ? *result.validation : result.identification.estimation,
                           result.identification.parameters, cell.parameters);
  const auto& nodes = cell.parameters.rc.soc;
  std::string files;
  for (const std::string& path : options.recordings)
    files += (files.empty() ? "" : ", ") + std::filesystem::path(path).filename().string();
  cell.name = name_of_cell(options);
  cell.source = fmt::format("identified from {}; limits and the rest from {}", files, options.start);
  cell.sources["rc"] =
      fmt::format("{} by {} from {}, {} node{}: {:.2f} mV RMS, fit {:.1f} %; deviations count runs of residuals",
                  options.model, options.optimizer, files, nodes.size, nodes.size == 1 ? "" : "s",
                  1e3 * result.identification.estimation.rmse_v, result.identification.estimation.fit_percent);
  if (cell.parameters.ocv.lean != 0)
    cell.sources["ocv"] += fmt::format("; leaning by {:.2f} of the way to slow {}", std::abs(cell.parameters.ocv.lean),
                                       cell.parameters.ocv.lean < 0 ? "discharge" : "charge");
  const std::string judged_by =
      result.validations.empty() ? files : std::filesystem::path(options.validate.front()).filename().string();
  cell.sources["noise"] =
      fmt::format("voltage and current: rests of {}; ", files) +
      (options.extend ? workflow::extended_noise
                      : fmt::format("model: what {} left over; current offset as in {}", judged_by, options.start));
  cell.parameters.noise.current_offset_a *= cell.parameters.capacity_ah / start_capacity_ah;
  cell.parameters.noise.current_unknown_a *= cell.parameters.capacity_ah / start_capacity_ah;
  if (options.extend) workflow::extend(taken, measured, cell);
  if (const model::CellFault fault = model::first_fault(cell.parameters); fault.what != nullptr) {
    throw files::BadInput(options.out, 1,
                          fmt::format("what was identified is no cell: '{}' is out of range, expected {}; more or "
                                      "other recordings, or fewer --nodes, may help",
                                      fault.key, fault.what));
  }
  workflow::round_digits(cell);
  write_output(options.out, files::cell_text(cell));

  result.cell = cell.name;
  finish(options, shown, begin, result);
  return 0;
}

}  // namespace bms::tool
