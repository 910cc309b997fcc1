#include "workflow/identify_cell.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <span>
#include <stdexcept>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "identification/prefilter.hpp"
#include "measurement/recording_checks.hpp"
#include "workflow/finite_answer.hpp"
#include "workflow/identified_cell.hpp"
#include "workflow/learn_healthy.hpp"
#include "workflow/reference_temperature.hpp"
#include "workflow/start_cell.hpp"

namespace bms::workflow {

namespace {

namespace id = identification;

/// The recordings to identify from, by their place in the list.
struct Inputs {
  DataOptions options;
  std::vector<measurement::Recording> recordings;
  std::vector<IdentificationData> measured;
  std::vector<id::DataSet> data_sets;  ///< with the effect of the cell's mechanisms removed
  double soc_min = 1, soc_max = 0;     ///< of the samples that count
};

/// Data sets of similar temperature.
struct Group {
  double temperature_c = 0;
  std::vector<id::DataSet> data_sets;
};

std::string file_name(const std::string& path) { return std::filesystem::path(path).filename().string(); }

std::string file_names(const std::vector<std::string>& paths) {
  std::string names;
  for (const std::string& path : paths) names += (names.empty() ? "" : ", ") + file_name(path);
  return names;
}

/// Warnings of an identification are "id: text".
measurement::Warning warning_of(const std::string& warning, const std::string& before = "") {
  const std::size_t colon = warning.find(':');
  return {warning.substr(0, colon), before + warning.substr(colon + 2)};
}

/// Offset removal and low-pass of the current.
void filter(const IdentifyOptions& options, const std::string& path, id::Data& data,
            std::vector<measurement::Warning>& warnings) {
  try {
    if (options.remove_offset) {
      const id::Offset offset = id::offset_at_rest(data);
      if (offset.samples == 0) {
        warnings.push_back(
            {"no_rest", path + ": no rest that shows the offset of the current, so no offset was subtracted"});
      }
      for (double& i : data.current_a.edit()) i -= offset.current_a;
    }
    if (options.filter_hz > 0) {
      data.current_a = id::filter_zero_phase(
          id::butterworth_low_pass(options.filter_hz, 1 / id::even_step_s(data.time_s)), data.current_a);
    }
  } catch (const std::invalid_argument& error) {
    throw files::BadInput(path, 1, error.what());
  }
}

Inputs read_inputs(const IdentifyOptions& options, StartCell& start, std::vector<measurement::Warning>& warnings,
                   std::vector<std::string>& read_as) {
  Inputs inputs;
  for (const std::string& path : options.recordings) {
    inputs.recordings.push_back(files::read_recording(path, files::VoltageColumn::required, options.reading));
    leave_out(options.left_out, inputs.recordings.back());
    leave_out_odd_readings(inputs.recordings.back());
  }
  adapt_start(options, inputs.recordings, start, warnings);
  inputs.options = {options.initial_soc, options.window, start.cell.parameters};
  for (measurement::Recording& r : inputs.recordings) {
    if (!r.read_as.empty()) read_as.push_back(r.path + ": " + r.read_as);
    measurement::compare_with_cell(r, start.cell.parameters);
    check_size(options, start, r);
    for (const measurement::Warning& w : r.warnings) warnings.push_back({w.id, r.path + ": " + w.text});
    IdentificationData d = identification_data(r, inputs.options);
    filter(options, r.path, d.record.data, warnings);
    inputs.data_sets.push_back(start.has_hysteresis ? without_mechanisms(start.cell, d) : d.record);
    inputs.soc_min = std::min(inputs.soc_min, d.soc_min);
    inputs.soc_max = std::max(inputs.soc_max, d.soc_max);
    inputs.measured.push_back(std::move(d));
  }
  return inputs;
}

/// Compares with the validation recordings. statistics: FitStatistics of their data.
template <class Statistics>
void validate(const IdentifyOptions& options, DataOptions data, Statistics statistics, IdentifyResult& result) {
  data.window = options.validate_window.value_or(options.window);
  for (const std::string& path : options.validate) {
    const IdentificationData measured =
        identification_data(files::read_recording(path, files::VoltageColumn::required, options.reading), data);
    result.validations.emplace_back(path, statistics(measured));
    result.data.push_back(measured.record.data);
  }
  if (!result.validations.empty()) result.validation = result.validations.front().second;
}

std::string out_of_range(const model::CellFault& fault) {
  return fmt::format("the identified cell is invalid: '{}' (entry {}) is out of range, expected {}", fault.key,
                     fault.index + 1, fault.what);
}

/// Throws FailedFit for a fit that means nothing.
void check_fit(const IdentifyOptions& options, const IdentifyResult& result) {
  const id::Identification& found = result.identification;
  const id::FitStatistics& fit = found.estimation;
  bool finite = std::isfinite(fit.rmse_v) && std::isfinite(fit.fit_percent);
  for (const id::Parameter& p : found.parameters) finite = finite && std::isfinite(p.value) && std::isfinite(p.std);
  if (finite && fit.fit_percent > 0) return;
  std::string text = options.recordings.front() + ":1: the identification failed: ";
  text += finite ? fmt::format("the model is off by {:.0f} mV RMS and follows the voltage no better than its mean",
                               1e3 * fit.rmse_v)
                 : std::string("its residuals are not numbers");
  throw FailedFit(text + "; expected a recording of this cell with a voltage that follows the current",
                  result.warnings);
}

// ---- linear models: one recording, one node

void identify_linear_cell(const IdentifyOptions& options, StartCell start, const Inputs& inputs,
                          IdentifyResult& result) {
  const id::DataSet& data_set = inputs.data_sets.front();
  const double soc = (inputs.soc_min + inputs.soc_max) / 2;
  id::LinearIdentification found;
  try {
    found = id::identify_linear(*options.linear, start.cell.parameters, data_set.data, soc, options.method);
  } catch (const std::invalid_argument& error) {
    throw files::BadInput(options.recordings.front(), 1, error.what());
  }
  result.identification = found.identification;
  for (const std::string& w : result.identification.warnings) result.warnings.push_back(warning_of(w));
  check_fit(options, result);
  if (options.recordings.size() > 1) {
    result.warnings.push_back(
        {"first_recording_only", "a linear model is identified from one recording; only the first was used"});
  }
  result.data = {found.data};
  validate(
      options, inputs.options,
      [&](const IdentificationData& d) {
        return id::validate(found.model, d.record.data, found.identification.fading);
      },
      result);

  files::CellFile& cell = start.cell;
  const auto& p = result.identification.parameters;  // b1, R0, R1, C1
  cell.parameters.rc = {};
  cell.parameters.rc.soc.push_back(std::clamp(std::round(100 * soc) / 100, 0.0, 1.0));
  cell.parameters.rc.r0_ohm.push_back(p[1].value);
  cell.parameters.rc.r1_ohm.push_back(p[2].value);
  cell.parameters.rc.c1_f.push_back(p[3].value);
  state_reference(cell, !options.ocv.empty());
  cell.name = options.name;
  cell.source = fmt::format("R0, R1, C1 identified from {}; everything else from {}",
                            file_name(options.recordings.front()), options.start);
  cell.sources["rc"] = fmt::format("{} by {}, {:.2f} mV RMS", result.model, result.optimizer,
                                   1e3 * result.identification.estimation.rmse_v);
  if (const model::CellFault fault = model::first_fault(cell.parameters); fault.what != nullptr) {
    result.warnings.push_back({"no_cell_file", out_of_range(fault) + "; there is no cell file"});
    return;
  }
  round_digits(cell);
  result.cell = cell.name;
  result.cell_file = std::move(cell);
}

// ---- the grey box

std::vector<Group> grouped(const Inputs& inputs, double reference_c) {
  std::vector<Group> groups;
  for (const TemperatureGroup& like : group_by_temperature(inputs.recordings, reference_c)) {
    Group& group = groups.emplace_back(Group{like.temperature_c, {}});
    for (const std::size_t k : like.recordings) group.data_sets.push_back(inputs.data_sets[k]);
  }
  return groups;
}

/// Index of the group whose temperature is nearest to the reference.
std::size_t nearest_to_reference(std::span<const Group> groups, double reference_c) {
  const auto nearest = std::min_element(groups.begin(), groups.end(), [&](const Group& a, const Group& b) {
    return std::abs(a.temperature_c - reference_c) < std::abs(b.temperature_c - reference_c);
  });
  return static_cast<std::size_t>(nearest - groups.begin());
}

/// The table of each group. OCV and branch position are those of the main group.
std::vector<files::TemperatureTable> temperature_tables(const IdentifyOptions& options, std::span<const Group> groups,
                                                        std::size_t main_group, id::GreyBoxOptions grey_box,
                                                        IdentifyResult& result) {
  std::vector<files::TemperatureTable> tables;
  const model::CellParameters<> main_cell = result.identification.cell;
  grey_box.estimate_ocv_branch = false;
  for (id::Parameter& p : result.identification.parameters) p.temperature_c = groups[main_group].temperature_c;
  for (std::size_t k = 0; k < groups.size(); ++k) {
    const double temperature_c = groups[k].temperature_c;
    if (k == main_group) {
      tables.push_back({temperature_c, main_cell.rc});
      continue;
    }
    id::Identification found = id::identify_grey_box(main_cell, groups[k].data_sets, grey_box, options.method);
    tables.push_back({temperature_c, found.cell.rc});
    for (id::Parameter& p : found.parameters) {
      p.temperature_c = temperature_c;
      result.identification.parameters.push_back(p);
    }
    for (const std::string& w : found.warnings)
      result.warnings.push_back(warning_of(w, fmt::format("{:g} degrees C: ", temperature_c)));
  }
  return tables;
}

/// Fits the grey box to each group; the cell takes its tables by temperature. Returns the temperature of the main one.
double fit_grey_box(const IdentifyOptions& options, StartCell& start, const Inputs& inputs, IdentifyResult& result) {
  const model::CellParameters<>& p = start.cell.parameters;
  const auto groups = grouped(inputs, p.reference_temperature_c);
  const std::size_t main_group = nearest_to_reference(groups, p.reference_temperature_c);
  const Group& main = groups[main_group];
  const bool moved = options.extend && (groups.size() > 1 || start.ocv.temperatures > 1);
  if (!options.reference_temperature_c && !moved)
    start.cell.parameters.reference_temperature_c = reference_of(p.reference_temperature_c, main.temperature_c);
  id::GreyBoxOptions grey_box;
  grey_box.soc_nodes = options.nodes.empty() ? id::nodes_for(inputs.soc_min, inputs.soc_max) : options.nodes;
  grey_box.bounds = circuit_bounds(p.capacity_ah);
  grey_box.estimate_ocv_branch = !options.ocv_branch && !start.has_hysteresis && p.ocv.half_gap_v.size > 0;
  grey_box.voltage_sigma_v = p.noise.voltage_v;
  const auto started = id::started_from_rests(p, main.data_sets.front().data, grey_box.bounds);
  if (options.ocv_from_load)  // it follows the voltages of the fit
    grey_box.ocv_hidden_v = start.ocv_error_v;
  else
    grey_box.ocv_sigma_v = ocv_sigma_v(start.ocv, started);
  grey_box.ocv_ends_unmeasured = start.ocv.temperatures > 0;
  try {
    result.identification = id::identify_grey_box(started, main.data_sets, grey_box, options.method);
    require_finite(result.identification);
    if (!options.extend) {  // else the joint fit replaces it
      for (const std::string& w : result.identification.warnings) result.warnings.push_back(warning_of(w));
    }
    check_fit(options, result);
    if (groups.size() > 1 && !options.extend)
      start.cell.at_temperature = temperature_tables(options, groups, main_group, grey_box, result);
  } catch (const std::invalid_argument& error) {
    throw files::BadInput(options.recordings.front(), 1, error.what());
  }
  result.data = {main.data_sets.front().data};
  return main.temperature_c;
}

/// Where the values of the cell file come from.
void write_sources(const IdentifyOptions& options, const IdentifyResult& result, files::CellFile& cell) {
  const std::string files = file_names(options.recordings);
  const std::size_t nodes = cell.parameters.rc.soc.size;
  const double position = cell.parameters.ocv.lean;
  const id::FitStatistics& fit = result.identification.estimation;
  cell.name = options.name;
  cell.source = fmt::format("identified from {}; limits and everything else from {}", files, options.start);
  cell.sources["rc"] = fmt::format(
      "{} by {} from {}, {} node{}: {:.2f} mV RMS, fit {:.1f} %; standard deviations allow for correlated "
      "residuals",
      result.model, result.optimizer, files, nodes, nodes == 1 ? "" : "s", 1e3 * fit.rmse_v, fit.fit_percent);
  if (position != 0 && cell.parameters.ocv.half_gap_v.size > 0) {
    cell.sources["ocv"] += fmt::format("; {:.2f} of the way from the middle to slow {}", std::abs(position),
                                       position < 0 ? "discharge" : "charge");
  }
  const std::string validated_on = result.validations.empty() ? files : file_name(options.validate.front());
  cell.sources["noise"] =
      fmt::format("voltage and current: rests of {}; ", files) +
      (options.extend ? extended_noise
                      : fmt::format("model: residual of {}; current offset as in {}", validated_on, options.start));
}

/// One fit over all recordings, and the prediction of those that were held out.
void identify_joint_circuit(const IdentifyOptions& options, const Inputs& inputs, IdentifyResult& result,
                            files::CellFile& cell) {
  std::vector<id::JointRecording> recordings;
  for (std::size_t k = 0; k < inputs.measured.size(); ++k) {
    const IdentificationData& of = inputs.measured[k];
    recordings.push_back(joint_recording(inputs.recordings[k], of, of.record.initial_soc, cell.parameters.capacity_ah));
  }
  JointResult joint = options.circuit
                          ? identified_again(*options.circuit, recordings)
                          : identify_jointly(cell, covers_both_directions(recordings), recordings, options.rc_pairs);
  hold_out(options.hold_out, options.reading, inputs.options, cell, joint);
  for (const measurement::Warning& w : warnings_of(joint)) result.warnings.push_back(w);
  put(joint, cell);
  result.joint = std::move(joint);
}

void identify_grey_box_cell(const IdentifyOptions& options, StartCell start, const Inputs& inputs,
                            IdentifyResult& result) {
  report(options.progress, 0.05, "R0, R1, C1 over the state of charge");
  const double identified_c = fit_grey_box(options, start, inputs, result);
  if (!options.extend) {
    validate(
        options, inputs.options,
        [&](const IdentificationData& d) {
          return id::validate(result.identification.cell, d.record, result.identification.fading);
        },
        result);
  }
  files::CellFile& cell = start.cell;
  cell.parameters = result.identification.cell;
  auto& noise = cell.parameters.noise;
  identify_noise(inputs.recordings, result.validation ? *result.validation : result.identification.estimation,
                 result.identification.parameters, cell.parameters);
  write_sources(options, result, cell);
  if (start.ocv_error_v > 0) {  // an error of the curve lasts as long as the state of charge stays near it
    noise.model_v = std::clamp(start.ocv_error_v, noise.model_v, 0.2);
    noise.model_correlation_s = std::max(noise.model_correlation_s, 3'000.0);
  }
  if (!start.limits_source.empty()) {
    cell.sources["limits"] = start.limits_source;
    cell.source =
        fmt::format("identified from {}; initial values from {}", file_names(options.recordings), options.start);
  }
  if (!start.other_cell) {  // otherwise they are scaled already
    noise.current_offset_a *= cell.parameters.capacity_ah / start.capacity_ah;
    noise.current_unknown_a *= cell.parameters.capacity_ah / start.capacity_ah;
  }
  state_reference(cell, !options.ocv.empty());
  if (options.extend) {
    report(options.progress, 0.1, "the circuit over all recordings");
    identify_joint_circuit(options, inputs, result, cell);
    const double fading = result.identification.fading;
    validate(
        options, inputs.options, [&](const IdentificationData& d) { return compare(cell, d, fading); }, result);
  }
  check_reference(cell, identified_c, result.joint && result.joint->temperatures > 1, result.warnings);
  if (const model::CellFault fault = model::first_fault(cell.parameters); fault.what != nullptr) {
    throw files::BadInput(options.out, 1,
                          out_of_range(fault) + "; more or other recordings, or fewer --nodes, may help");
  }
  round_digits(cell);
  result.cell = cell.name;
  result.cell_file = std::move(cell);
}

}  // namespace

const char* name_of(const std::optional<id::LinearKind>& model) {
  if (!model) return "nlgr";
  switch (*model) {
    case id::LinearKind::transfer_function:
      return "tf";
    case id::LinearKind::output_error:
      return "oe";
    default:
      return "hw";
  }
}

IdentifyResult identify_cell(const IdentifyOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  IdentifyResult result;
  result.model = name_of(options.linear);
  result.optimizer = id::name_of(options.method);
  result.out = options.out;
  StartCell start = read_start(options);
  result.coulombic_efficiency = start.ocv.coulombic_efficiency;
  result.warnings = start.ocv.warnings;
  result.read_as = start.ocv.read_as;
  report(options.progress, 0, "reading the recordings");
  const Inputs inputs = read_inputs(options, start, result.warnings, result.read_as);
  if (options.linear)
    identify_linear_cell(options, std::move(start), inputs, result);
  else
    identify_grey_box_cell(options, std::move(start), inputs, result);
  if (result.cell_file && !options.healthy.empty()) {
    files::CellFile& cell = *result.cell_file;
    cell.healthy = learn_healthy(options, cell, result.joint, result.warnings);
    cell.sources["healthy"] = healthy_summary(cell.healthy) + "; each diagnosed with a cell identified without it";
  }
  if (result.cell_file && result.joint)
    add_coverage(options.hold_out, options.reading, *result.cell_file, *result.joint);
  require_finite(result);
  report(options.progress, 1, "");
  result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

}  // namespace bms::workflow
