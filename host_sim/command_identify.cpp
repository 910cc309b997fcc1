#include "host_sim/command_identify.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>

#include <fmt/format.h>

#include "host_sim/bad_input.hpp"
#include "host_sim/cell_file.hpp"
#include "host_sim/identification_data.hpp"
#include "host_sim/json_results.hpp"
#include "host_sim/recording.hpp"
#include "host_sim/report_page.hpp"
#include "identification/identify.hpp"
#include "identification/linear_models.hpp"
#include "identification/ocv_curve.hpp"
#include "identification/prefilter.hpp"

namespace bms {

namespace {

namespace id = identification;

id::Method method_of(const std::string& name) {
  for (const id::Method m : {id::Method::subspace_gauss_newton, id::Method::adaptive_subspace_gauss_newton, id::Method::levenberg_marquardt,
                             id::Method::steepest_descent, id::Method::trust_region_reflective}) {
    if (name == id::name_of(m)) return m;
  }
  throw BadInput("--optimizer", 1, "no such optimiser '" + name + "', expected one of: gn, agn, lm, sd, nls");
}

/// OCV and capacity of slow runs put into the cell.
void take_ocv(const IdentifyOptions& options, CellFile& cell, IdentifyResult& result) {
  std::vector<id::SlowRun> runs;
  std::string files;
  for (const std::string& path : options.ocv) {
    const Recording r = read_recording(path);
    runs.push_back({{r.time_s, r.current_a, r.voltage_v, 0}, r.soc_ref});
    files += (files.empty() ? "" : ", ") + std::filesystem::path(path).filename().string();
  }
  id::OcvCurve curve;
  try {
    curve = id::ocv_curve(runs);
  } catch (const std::invalid_argument& error) {
    throw BadInput(options.ocv.front(), 1, error.what());
  }
  double error_v = options.ocv_error_v;
  auto pieces = id::fewest_pieces(curve, error_v);
  while (!pieces || pieces->soc.size() > model::max_ocv_edges) {
    error_v *= 1.5;
    if (error_v > 0.05) throw BadInput(options.ocv.front(), 1, "the open-circuit voltage does not rise with the state of charge, expected slow runs of a whole charge or discharge");
    pieces = id::fewest_pieces(curve, error_v);
  }
  if (error_v > options.ocv_error_v) {
    result.warnings.push_back({"ocv_error", fmt::format("the straight pieces of the OCV are up to {:.1f} mV off, {:.1f} were asked for", 1e3 * pieces->largest_error_v, 1e3 * options.ocv_error_v)});
  }
  auto& ocv = cell.parameters.ocv;
  ocv = {};
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
  result.coulombic_efficiency = curve.coulombic_efficiency;
  cell.sources["ocv"] = fmt::format("{} of {}; {} straight pieces, within {:.1f} mV", curve.coulombic_efficiency ? "middle of slow charge and discharge" : "slow run", files,
                                    pieces->soc.size() - 1, 1e3 * pieces->largest_error_v);
}

/// What the recordings say of the measuring chain and of what the model leaves over.
void take_noise(const std::vector<Recording>& recordings, const IdentifyResult& result, model::CellParameters<>& p) {
  std::vector<double> voltage_steps, current_steps;
  double step_s = 1;
  for (const Recording& r : recordings) {
    const double quiet_a = 0.02 * p.capacity_ah;
    for (std::size_t k = 2; k < r.rows(); ++k) {
      if (std::abs(r.current_a[k]) > quiet_a || std::abs(r.current_a[k - 1]) > quiet_a || std::abs(r.current_a[k - 2]) > quiet_a) continue;
      // second differences: what relaxes slowly is not noise
      const double v = r.voltage_v[k] - 2 * r.voltage_v[k - 1] + r.voltage_v[k - 2], i = r.current_a[k] - 2 * r.current_a[k - 1] + r.current_a[k - 2];
      if (std::isfinite(v) && std::isfinite(i)) voltage_steps.push_back(v * v), current_steps.push_back(i * i);
    }
    step_s = std::max(0.01, r.duration_s() / static_cast<double>(r.rows() - 1));
  }
  const auto sigma = [](const std::vector<double>& squares) {
    double sum = 0;
    for (const double s : squares) sum += s;
    return std::sqrt(sum / static_cast<double>(squares.size()) / 6);  // 1 + 4 + 1
  };
  constexpr std::size_t enough = 30;
  if (voltage_steps.size() >= enough) {
    p.noise.voltage_v = std::clamp(sigma(voltage_steps), 0.0002, 0.05);
    p.noise.current_a = std::clamp(sigma(current_steps), 1e-4 * p.capacity_ah, 0.1 * p.capacity_ah);
  }
  const id::Fit& judge = result.validation ? *result.validation : result.identification.estimation;
  double model_v = judge.rmse_v;
  // with its mean, which is an error that lasts
  p.noise.model_correlation_s = std::clamp(id::correlation_length(id::without_missing(judge.error_v)) * step_s, 1.0, 20'000.0);
  if (p.ocv.half_gap_v.size > 0) {
    double gap_v = 0;
    for (std::size_t k = 0; k < p.ocv.half_gap_v.size; ++k) {
      if (p.ocv.soc[k] > 0.1 && p.ocv.soc[k] < 0.95) gap_v = std::max(gap_v, p.ocv.half_gap_v[k]);
    }
    // The voltage is somewhere between the slow curves, and the model leans: how far it is off on the other side no recording needs to
    // have shown. As evenly distributed; and it lasts until the current has turned for a good part of an hour.
    model_v = std::max(model_v, (1 + std::abs(p.ocv.lean)) * gap_v / std::sqrt(3.0));
    p.noise.model_correlation_s = std::max(p.noise.model_correlation_s, 3'000.0);
    p.noise.rest_v = std::clamp((1 + std::abs(p.ocv.lean)) * gap_v, p.noise.rest_v, 0.2);
  }
  p.noise.model_v = std::clamp(model_v, 0.0005, 0.2);
  double largest = 0.005;
  for (const id::Parameter& q : result.identification.parameters) {
    if (q.name == "r0_ohm" && q.value > 0) largest = std::max(largest, std::min(0.5, 2 * q.std / q.value));
  }
  p.tolerance.resistance_fraction = largest;
}

void filter(const IdentifyOptions& options, const std::string& path, id::Data& data) {
  try {
    if (options.remove_offset) {
      const id::Offset offset = id::offset_at_rest(data);
      if (offset.samples == 0) warn(path + ": no rest to read the current's offset from, nothing was subtracted");
      for (double& i : data.current_a) i -= offset.current_a;
    }
    if (options.filter_hz > 0) data.current_a = id::filter_zero_phase(id::butterworth_low_pass(options.filter_hz, 1 / id::even_step_s(data.time_s)), data.current_a);
  } catch (const std::invalid_argument& error) {
    throw BadInput(path, 1, error.what());
  }
}

std::string warning_text(const std::string& warning) { return warning.substr(warning.find(": ") + 2); }

void add_warnings(IdentifyResult& result) {
  for (const std::string& w : result.identification.warnings) result.warnings.push_back({w.substr(0, w.find(':')), warning_text(w)});
}

/// Parameters, figures, and how the first recording and the validations are followed.
std::string page_of_identification(const IdentifyResult& r, const std::vector<id::Data>& recordings) {
  const id::Identification& found = r.identification;
  PageContent content{"Identification by " + r.model + " and " + r.optimizer,
                      fmt::format("{} samples, {:.2f} mV RMS open loop, fit {:.1f} %. {}", found.estimation.samples, 1e3 * found.estimation.rmse_v, found.estimation.fit_percent, found.optimum.reason),
                      {}, {}, {}};
  for (const Warning& w : r.warnings) content.warnings.push_back(w.text);
  const auto cell = [](const std::string& text) { return PageCell{text, {}, {}}; };
  PageTable parameters{"parameters", "Parameters", {"name", "soc", "value", "standard deviation", "if residuals were white", "if the OCV were off by its tolerance", "remarks"}, {}, ""};
  for (const id::Parameter& p : found.parameters) {
    parameters.rows.push_back({cell(p.name), cell(fmt::format("{:.0f} %", 100 * p.soc)), cell(fmt::format("{:.5g}", p.value)), cell(fmt::format("{:.2g}", p.std)), cell(fmt::format("{:.2g}", p.std_white)),
                               cell(fmt::format("{:.2g}", p.by_ocv_tolerance)), cell(!p.seen ? "not seen" : p.at_bound ? "at its bound" : "")});
  }
  PageTable fits{"fits", "How the voltage is followed, open loop", {"recording", "RMSE", "largest", "fit", "1, 10 and 60 steps ahead, RMSE", "bias and its band", "lags outside the white band"}, {}, ""};
  const auto add_fit = [&](const std::string& name, const id::Fit& f) {
    std::string ahead;
    for (const id::Fit::Ahead& a : f.ahead) ahead += fmt::format("{}{:.2f}", ahead.empty() ? "" : ", ", 1e3 * a.rmse_v);
    ahead += " mV";
    fits.rows.push_back({cell(name), cell(fmt::format("{:.2f} mV", 1e3 * f.rmse_v)), cell(fmt::format("{:.2f} mV", 1e3 * f.largest_v)), cell(fmt::format("{:.1f} %", f.fit_percent)),
                         cell(ahead), cell(fmt::format("{:.2f}, {:.2f} mV", 1e3 * f.residuals.mean_v, 1e3 * f.residuals.mean_band_v)),
                         cell(fmt::format("{:.0f} % of itself, {:.0f} % with the current", 100 * f.residuals.autocorrelated, 100 * f.residuals.input_correlated))});
  };
  add_fit("identified from", found.estimation);
  for (const auto& [path, fit] : r.validations) add_fit(path, fit);
  content.tables = {std::move(parameters), std::move(fits)};
  const auto add_charts = [&](const std::string& name, const id::Data& data, const id::Fit& f) {
    PageChart voltage{name + ": voltage", {"measured, V", "simulated, V"}, data.time_s, {data.voltage_v, {}}}, error{name + ": measured less simulated, mV", {"mV"}, data.time_s, {{}}};
    for (Eigen::Index k = 0; k < f.error_v.size(); ++k) {
      voltage.columns[1].push_back(data.voltage_v[static_cast<std::size_t>(k)] - f.error_v[k]);
      error.columns[0].push_back(1e3 * f.error_v[k]);
    }
    content.charts.push_back(std::move(voltage));
    content.charts.push_back(std::move(error));
  };
  add_charts("Identified from", recordings.front(), found.estimation);
  for (std::size_t k = 0; k < r.validations.size(); ++k) add_charts(r.validations[k].first, recordings[k + 1], r.validations[k].second);
  return page_of(content);
}

/// recordings: the first that was identified from, then those that validate.
void finish(const IdentifyOptions& options, const std::vector<id::Data>& recordings, std::chrono::steady_clock::time_point begin, IdentifyResult& result) {
  for (const Warning& w : result.warnings) warn(w.text);
  result.out = options.out;
  result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (!options.output.json.empty()) put(options.output.json, json_of(result));
  if (!options.output.report.empty()) put(options.output.report, page_of_identification(result, recordings));
  const id::Identification& found = result.identification;
  std::string text = fmt::format("{} samples: {:.2f} mV RMS open loop, fit {:.1f} %, one step ahead {:.1f} %. {}\n", found.estimation.samples, 1e3 * found.estimation.rmse_v,
                                 found.estimation.fit_percent, found.estimation.one_step_fit_percent, found.optimum.reason);
  for (const id::Parameter& p : found.parameters) {
    text += fmt::format("  {:8} {:3.0f} %{}  {:10.5g} +- {:.2g}{}\n", p.name, 100 * p.soc, p.temperature_c ? fmt::format(" {:5.1f} C", *p.temperature_c) : "", p.value, p.std,
                        p.at_bound ? "  at its bound" : "");
  }
  for (const auto& [path, fit] : result.validations) text += fmt::format("Validated on {}: {:.2f} mV RMS, fit {:.1f} %.\n", path, 1e3 * fit.rmse_v, fit.fit_percent);
  tell(options.output, text + (result.cell.empty() ? "No cell file." : "Cell file: " + options.out));
}

/// Recordings of like temperature.
struct Group {
  double temperature_c = 25;
  std::vector<id::Record> records;
};

/// Ascending; one when temperatures are not recorded or lie within a few kelvins.
std::vector<Group> grouped(const std::vector<Recording>& recordings, const std::vector<id::Record>& records) {
  constexpr double alike_k = 5;
  std::vector<std::pair<double, std::size_t>> means;
  for (std::size_t k = 0; k < recordings.size(); ++k) {
    double sum = 0;
    std::size_t count = 0;
    for (const double t : recordings[k].temperature_c) {
      if (std::isfinite(t)) sum += t, ++count;
    }
    if (count == 0) return {{25, records}};
    means.emplace_back(sum / static_cast<double>(count), k);
  }
  std::sort(means.begin(), means.end());
  std::vector<Group> groups;
  std::vector<double> begins;
  for (const auto& [temperature_c, k] : means) {
    if (groups.empty() || temperature_c - begins.back() > alike_k) {
      groups.emplace_back();
      begins.push_back(temperature_c);
      groups.back().temperature_c = 0;
    }
    Group& group = groups.back();
    const auto n = static_cast<double>(group.records.size());
    group.temperature_c = (group.temperature_c * n + temperature_c) / (n + 1);
    group.records.push_back(records[k]);
  }
  for (Group& group : groups) group.temperature_c = std::round(10 * group.temperature_c) / 10;
  return groups;
}

/// Each group's table. The OCV and its lean are those of the main group.
std::vector<TemperatureTable> at_temperatures(const std::vector<Group>& groups, std::size_t main_group, id::GreyBoxOptions options, id::Method method, IdentifyResult& result) {
  std::vector<TemperatureTable> tables;
  const model::CellParameters<> main_cell = result.identification.cell;
  options.estimate_lean = false;
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
    for (const std::string& w : found.warnings) result.warnings.push_back({w.substr(0, w.find(':')), fmt::format("{:g} degrees C: {}", groups[k].temperature_c, warning_text(w))});
  }
  return tables;
}

/// tf, oe, hw: one record. Exit code 1 when what follows the voltage is no circuit: there is no cell file then.
int run_linear(const IdentifyOptions& options, id::Method method, CellFile cell, const id::Record& record, double soc, const DataOptions& given, IdentifyResult& result) {
  const auto begin = std::chrono::steady_clock::now();
  const id::LinearKind kind = options.model == "tf" ? id::LinearKind::transfer_function : options.model == "oe" ? id::LinearKind::output_error : id::LinearKind::hammerstein_wiener;
  id::LinearIdentification found;
  try {
    found = id::identify_linear(kind, cell.parameters, record.data, soc, method);
  } catch (const std::invalid_argument& error) {
    throw BadInput(options.recordings.front(), 1, error.what());
  }
  result.identification = found.identification;
  add_warnings(result);
  if (options.recordings.size() > 1) result.warnings.push_back({"first_recording_only", "a linear model is identified from one recording, the first was taken"});
  DataOptions data = given;
  data.window = window_of("--validate-window", options.validate_window.empty() ? options.window : options.validate_window);
  std::vector<id::Data> shown = {record.data};
  for (const std::string& path : options.validate) {
    shown.push_back(identification_data(read_recording(path), data).record.data);
    result.validations.push_back({path, id::validate(found.model, shown.back(), found.identification.fading)});
  }
  if (!result.validations.empty()) result.validation = result.validations.front().second;
  const auto& p = result.identification.parameters;  // b1, R0, R1, C1
  cell.parameters.rc = {};
  cell.parameters.rc.soc.push_back(std::clamp(std::round(100 * soc) / 100, 0.0, 1.0));
  cell.parameters.rc.r0_ohm.push_back(p[1].value);
  cell.parameters.rc.r1_ohm.push_back(p[2].value);
  cell.parameters.rc.c1_f.push_back(p[3].value);
  cell.name = !options.name.empty() ? options.name : std::filesystem::path(options.out).stem().string();
  cell.source = fmt::format("R0, R1, C1 identified from {}; the rest from {}", std::filesystem::path(options.recordings.front()).filename().string(), options.start);
  cell.sources["rc"] = fmt::format("{} by {}, {:.2f} mV RMS", options.model, options.optimizer, 1e3 * result.identification.estimation.rmse_v);
  const model::CellFault fault = model::first_fault(cell.parameters);
  if (fault.what == nullptr) {
    put(options.out, cell_text(cell));
    result.cell = cell.name;
  } else {
    result.warnings.push_back({"no_cell_file", fmt::format("what was identified is no cell: '{}' is out of range, expected {}; there is no cell file", fault.key, fault.what)});
  }
  finish(options, shown, begin, result);
  return fault.what == nullptr ? 0 : 1;
}

}  // namespace

int run(const IdentifyOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  IdentifyResult result;
  result.model = options.model;
  result.optimizer = options.optimizer;
  const id::Method method = method_of(options.optimizer);
  CellFile cell = read_cell(options.start);
  const double start_capacity_ah = cell.parameters.capacity_ah;
  if (!options.ocv.empty()) take_ocv(options, cell, result);
  if (options.capacity_ah > 0) cell.parameters.capacity_ah = options.capacity_ah;
  if (options.lean && cell.parameters.ocv.half_gap_v.size > 0) cell.parameters = id::leaning(cell.parameters, *options.lean);

  DataOptions data{initial_soc_of(options.initial_soc), window_of("--window", options.window), cell.parameters};
  std::vector<Recording> recordings;
  std::vector<id::Record> records;
  double soc_min = 1, soc_max = 0;
  for (const std::string& path : options.recordings) {
    recordings.push_back(read_recording(path));
    Recording& r = recordings.back();
    compare_with_cell(r, cell.parameters);
    for (const Warning& w : r.warnings) result.warnings.push_back({w.id, path + ": " + w.text});
    IdentificationData d = identification_data(r, data);
    filter(options, path, d.record.data);
    records.push_back(std::move(d.record));
    soc_min = std::min(soc_min, d.soc_min);
    soc_max = std::max(soc_max, d.soc_max);
  }

  // the model's own table comes from the recordings nearest to 25 degrees C, where several temperatures are given
  const auto groups = grouped(recordings, records);
  std::size_t main_group = 0;
  for (std::size_t k = 0; k < groups.size(); ++k) {
    if (std::abs(groups[k].temperature_c - 25) < std::abs(groups[main_group].temperature_c - 25)) main_group = k;
  }
  if (options.model != "nlgr") return run_linear(options, method, cell, records.front(), (soc_min + soc_max) / 2, data, result);

  id::GreyBoxOptions grey_box;
  grey_box.soc_nodes = options.nodes.empty() ? id::nodes_for(soc_min, soc_max) : options.nodes;
  grey_box.bounds = circuit_bounds(cell.parameters.capacity_ah);
  grey_box.estimate_lean = !options.lean && cell.parameters.ocv.half_gap_v.size > 0;
  grey_box.voltage_sigma_v = cell.parameters.noise.voltage_v;
  try {
    result.identification = id::identify_grey_box(id::started_from_rests(cell.parameters, groups[main_group].records.front().data, grey_box.bounds), groups[main_group].records, grey_box, method);
  } catch (const std::invalid_argument& error) {
    throw BadInput(options.recordings.front(), 1, error.what());
  }
  add_warnings(result);
  if (groups.size() > 1) cell.at_temperature = at_temperatures(groups, main_group, grey_box, method, result);

  data.window = window_of("--validate-window", options.validate_window.empty() ? options.window : options.validate_window);
  std::vector<id::Data> shown = {records.front().data};
  for (const std::string& path : options.validate) {
    const id::Record record = identification_data(read_recording(path), data).record;
    result.validations.push_back({path, id::validate(result.identification.cell, record, result.identification.fading)});
    shown.push_back(record.data);
  }
  if (!result.validations.empty()) result.validation = result.validations.front().second;

  cell.parameters = result.identification.cell;
  take_noise(recordings, result, cell.parameters);
  const auto& nodes = cell.parameters.rc.soc;
  std::string files;
  for (const std::string& path : options.recordings) files += (files.empty() ? "" : ", ") + std::filesystem::path(path).filename().string();
  cell.name = !options.name.empty() ? options.name : std::filesystem::path(options.out).stem().string();
  cell.source = fmt::format("identified from {}; limits and the rest from {}", files, options.start);
  cell.sources["rc"] = fmt::format("{} by {} from {}, {} node{}: {:.2f} mV RMS, fit {:.1f} %; deviations count runs of residuals", options.model, options.optimizer, files,
                                   nodes.size, nodes.size == 1 ? "" : "s", 1e3 * result.identification.estimation.rmse_v, result.identification.estimation.fit_percent);
  if (cell.parameters.ocv.lean != 0) cell.sources["ocv"] += fmt::format("; leaning by {:.2f} of the way to slow {}", std::abs(cell.parameters.ocv.lean), cell.parameters.ocv.lean < 0 ? "discharge" : "charge");
  cell.sources["noise"] = fmt::format("voltage and current: rests of {}; model: what {} left over; current offset as in {}", files,
                                      result.validations.empty() ? files : std::filesystem::path(options.validate.front()).filename().string(), options.start);
  cell.parameters.noise.current_offset_a *= cell.parameters.capacity_ah / start_capacity_ah;
  cell.parameters.noise.current_unknown_a *= cell.parameters.capacity_ah / start_capacity_ah;
  if (const model::CellFault fault = model::first_fault(cell.parameters); fault.what != nullptr) {
    throw BadInput(options.out, 1, fmt::format("what was identified is no cell: '{}' is out of range, expected {}; more or other recordings, or fewer --nodes, may help", fault.key, fault.what));
  }
  put(options.out, cell_text(cell));

  result.cell = cell.name;
  finish(options, shown, begin, result);
  return 0;
}

}  // namespace bms
