#include "workflow/joint_identification.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "replay/simulation.hpp"
#include "workflow/diagnose_recordings.hpp"

namespace bms::workflow {

namespace id = identification;

namespace {

using Of = id::JointUnknown::Of;

/// One node with the means of the columns.
void flatten(model::RcTable<double>& rc) {
  const double r0_ohm = id::mean_of(rc.r0_ohm), r1_ohm = id::mean_of(rc.r1_ohm), c1_f = id::mean_of(rc.c1_f);
  rc = {};
  rc.soc.push_back(0.5);
  rc.r0_ohm.push_back(r0_ohm);
  rc.r1_ohm.push_back(r1_ohm);
  rc.c1_f.push_back(c1_f);
}

/// The mechanisms without those that the joint fit determines.
std::vector<model::MechanismSetting> without_circuit(const files::CellFile& cell, bool temperatures) {
  std::vector<model::MechanismSetting> kept;
  for (const model::MechanismSetting& m : cell.mechanisms) {
    if (m.index == model::mechanism_index_of<model::SlowPolarisation>) continue;
    if (m.index == model::mechanism_index_of<model::TemperatureResistance> && temperatures) continue;
    kept.push_back(m);
  }
  return kept;
}

template <class Column>
void put_deviation(const Column& values, double relative, Column& deviations) {
  deviations = values;
  for (std::size_t k = 0; k < deviations.size; ++k) deviations[k] *= relative;
}

/// Circuit and mechanisms with their standard deviations.
void put_values(const id::StructureChoice& choice, files::CellFile& cell) {
  auto& rc = cell.parameters.rc;
  rc = choice.model.cell.rc;
  cell.mechanisms = choice.model.mechanisms;
  for (std::size_t k = 0; k < choice.model.unknowns.size(); ++k) {
    const id::JointUnknown& u = choice.model.unknowns[k];
    const auto i = static_cast<Eigen::Index>(k);
    const double relative = choice.fit.std[i] / choice.fit.value[i];
    if (u.of == Of::r0) put_deviation(rc.r0_ohm, relative, rc.r0_std_ohm);
    if (u.of == Of::r1) put_deviation(rc.r1_ohm, relative, rc.r1_std_ohm);
    if (u.of == Of::c1) put_deviation(rc.c1_f, relative, rc.c1_std_f);
    for (model::MechanismSetting& m : cell.mechanisms) {
      if (u.of == Of::mechanism && m.index == u.mechanism) m.deviation[u.parameter] = choice.fit.std[i];
    }
  }
}

}  // namespace

id::JointRecording joint_recording(const measurement::Recording& recording, const IdentificationData& of,
                                   double initial_soc, double capacity_ah) {
  id::JointRecording r{recording.path, of.record.data, of.temperature_c, initial_soc, 0};
  r.data.capacity_ah = capacity_ah;
  const std::size_t rows = r.data.size();
  std::vector<double> soc;
  if (!recording.soc_ref.empty()) {
    // the data set ends before the recording does, and may begin later
    std::size_t first = 0;
    while (recording.time_s[first] < r.data.time_s[0]) ++first;
    soc = recording.soc_ref.part(first, rows).copy();
    r.current_correction_a = id::current_correction_a(r.data, soc, initial_soc);
  } else {
    double counted = initial_soc, known_a = 0;
    for (std::size_t k = 0; k < rows; ++k) {
      if (std::isfinite(r.data.current_a[k])) known_a = r.data.current_a[k];
      if (k > 0) counted += known_a * (r.data.time_s[k] - r.data.time_s[k - 1]) / (3'600 * capacity_ah);
      soc.push_back(counted);
    }
  }
  std::vector<double>& voltage_v = r.data.voltage_v.edit();
  for (std::size_t k = 0; k < rows; ++k) {
    if (!(soc[k] >= joint_window.low && soc[k] <= joint_window.high))
      voltage_v[k] = std::numeric_limits<double>::quiet_NaN();
  }
  return r;
}

bool covers_both_directions(const std::vector<id::JointRecording>& recordings) {
  constexpr double enough = 0.5;
  double rise = 0, fall = 0;
  for (const id::JointRecording& r : recordings) {
    double soc = 0, lowest = 0, highest = 0;
    for (std::size_t k = 1; k < r.data.size(); ++k) {
      if (!std::isfinite(r.data.current_a[k])) continue;
      soc += r.data.current_a[k] * (r.data.time_s[k] - r.data.time_s[k - 1]) / (3'600 * r.data.capacity_ah);
      lowest = std::min(lowest, soc);
      highest = std::max(highest, soc);
      rise = std::max(rise, soc - lowest);
      fall = std::max(fall, highest - soc);
    }
  }
  return rise >= enough && fall >= enough;
}

JointResult identify_jointly(const files::CellFile& cell, bool keeps_shape,
                             const std::vector<id::JointRecording>& recordings, std::optional<int> rc_pairs) {
  JointResult joint;
  joint.keeps_shape = keeps_shape;
  joint.temperatures = id::by_temperature(recordings).size();
  for (const id::JointRecording& r : recordings) joint.recordings.push_back(r.name);
  model::CellParameters<> start = cell.parameters;
  if (!keeps_shape) flatten(start.rc);
  try {
    auto candidates = id::joint_candidates(start, without_circuit(cell, joint.temperatures > 1), recordings);
    if (rc_pairs) std::erase_if(candidates, [&](const auto& c) { return c.rc_pairs != *rc_pairs; });
    joint.choice = id::choose_structure(candidates, recordings, {});
  } catch (const std::invalid_argument& error) {
    throw files::BadInput(recordings.front().name, 1, error.what());
  }
  return joint;
}

JointResult identified_again(const JointResult& joint, const std::vector<id::JointRecording>& recordings) {
  JointResult again;
  again.keeps_shape = joint.keeps_shape;
  again.temperatures = joint.temperatures;
  for (const id::JointRecording& r : recordings) again.recordings.push_back(r.name);
  try {
    again.choice = id::fitted_again(joint.choice, recordings, {});
  } catch (const std::invalid_argument& error) {
    throw files::BadInput(recordings.front().name, 1, error.what());
  }
  return again;
}

void hold_out(const std::vector<std::string>& paths, const files::ReadOptions& reading, DataOptions options,
              const files::CellFile& cell, JointResult& joint) {
  for (const std::string& path : paths) {
    const measurement::Recording recording = files::read_recording(path, files::VoltageColumn::required, reading);
    options.initial = {start_of(recording, cell).soc, false};  // a start that the user gives is that of the recordings
    const IdentificationData of = identification_data(recording, options);
    const auto r = joint_recording(recording, of, of.record.initial_soc, joint.choice.model.cell.capacity_ah);
    joint.held_out.push_back(id::left_out_error(joint.choice.model, r, {}));
  }
}

void add_coverage(const std::vector<std::string>& paths, const files::ReadOptions& reading, const files::CellFile& cell,
                  JointResult& joint) {
  for (std::size_t k = 0; k < paths.size(); ++k) {
    measurement::Recording recording = read_for_diagnosis(paths[k], reading, cell);
    const StartSoc start = start_of(recording, cell);
    joint.coverage.push_back(coverage_of(cell, prepared(std::move(recording), paths[k], cell, start).record));
    joint.held_out[k].rmse_v = joint.coverage.back().error_v();
  }
}

std::vector<measurement::Warning> warnings_of(const JointResult& joint) {
  const id::StructureChoice& choice = joint.choice;
  std::vector<measurement::Warning> warnings;
  for (std::size_t k = 0; k < choice.model.unknowns.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    if (choice.fit.at_bound[i] == 0) continue;
    warnings.push_back({"at_bound", fmt::format("{} ended at its bound of {:.4g}", choice.model.unknowns[k].name(),
                                                choice.fit.value[i])});
  }
  if (!choice.fit.optimum.converged) warnings.push_back({"not_converged", choice.fit.optimum.reason});
  return warnings;
}

id::FitStatistics compare(const files::CellFile& cell, const IdentificationData& with, double fading) {
  const auto tables = model::prepare<double, model::max_intervals>(cell.parameters);
  const id::Data& d = with.record.data;
  const auto rows = replay::simulate({.cell = tables,
                                      .capacity_ah = cell.parameters.capacity_ah,
                                      .mechanisms = cell.mechanisms,
                                      .time_s = d.time_s,
                                      .current_a = d.current_a,
                                      .temperature_c = with.temperature_c,
                                      .initial_soc = with.record.initial_soc});
  Eigen::VectorXd simulated_v(static_cast<Eigen::Index>(rows.size()));
  for (std::size_t k = 0; k < rows.size(); ++k) simulated_v[static_cast<Eigen::Index>(k)] = rows[k].voltage_v;
  return id::fit_of(d.voltage_v, simulated_v, d.current_a, fading);
}

void put_noise(const id::ModelErrors& errors, model::CellParameters<>& p) {
  // minor hysteresis loops that the recordings need not have shown: a quarter of an LFP cell's half gap
  constexpr double least_v = 0.005;
  p.noise.model_v = std::clamp(errors.model_v, least_v, 0.2);
  // until the current has reversed for a large part of an hour
  p.noise.model_correlation_s = std::clamp(errors.correlation_s, 600.0, 20'000.0);
  p.noise.rest_v = std::max(p.noise.model_v, 0.01);
  p.tolerance.resistance_fraction = std::clamp(errors.resistance_fraction, 0.005, 1.0);
  p.tolerance.initial_soc = std::clamp(errors.initial_soc, p.tolerance.initial_soc, 0.2);
  // a current sensor with an offset of up to a hundredth of the 1C current, constant over a working day
  p.noise.current_offset_a = 0.01 * p.capacity_ah;
  p.noise.current_offset_correlation_s = 36'000;
  p.noise.current_at_rest_a = 0.002 * p.capacity_ah;
  p.noise.current_gain = 0.007;
  p.noise.errors_are_states = true;
}

namespace {

/// Where the circuit was identified, and how fast its error grows outside, if that was measured.
void put_range(const id::StructureChoice& choice, files::CellFile& cell) {
  const id::IdentifiedExtent& extent = choice.extent;
  model::IdentifiedRange& range = cell.parameters.range;
  range.temperature_min_c = extent.temperature_min_c.value_or(model::IdentifiedRange::unknown);
  range.temperature_max_c = extent.temperature_max_c.value_or(model::IdentifiedRange::unknown);
  range.soc_min = std::clamp(extent.soc_min, 0.0, 1.0);
  range.soc_max = std::clamp(extent.soc_max, 0.0, 1.0);
  range.current_max_a = extent.current_max_a;
  range.duration_s = extent.duration_s;
  cell.sources["range"] = "the recordings of [rc]";
  if (choice.errors.resistance_per_ev > 0)
    cell.parameters.tolerance.resistance_per_ev = std::min(choice.errors.resistance_per_ev, 1.0);
}

}  // namespace

void put(const JointResult& joint, files::CellFile& cell) {
  const id::StructureChoice& choice = joint.choice;
  put_values(choice, cell);
  put_noise(choice.errors, cell.parameters);
  put_range(choice, cell);
  const id::CandidateResult& winner = choice.candidates[choice.chosen];
  const std::string what = fmt::format(
      "{}: one fit of all recordings at {} temperature{}, {:.1f} mV RMS; {:.1f} mV where one {} was left out",
      winner.name, joint.temperatures, joint.temperatures == 1 ? "" : "s", 1e3 * winner.fitted_rmse_v,
      1e3 * winner.left_out_v, choice.left_out);
  cell.sources["rc"] = what + (joint.keeps_shape ? "; shape over soc of the grey box" : "; constant over soc");
  for (const id::JointUnknown& u : choice.model.unknowns) {
    if (u.of != Of::mechanism) continue;
    std::string& source = cell.sources["mechanism." + std::string(model::catalogue[u.mechanism].id)];
    constexpr const char* by_fit = "by the fit of [rc]";
    if (u.mechanism == model::mechanism_index_of<model::OcvHysteresis> && source.find(by_fit) == std::string::npos)
      source += std::string(source.empty() ? "" : "; ") + "decay " + by_fit;
    else
      source = by_fit;
  }
}

}  // namespace bms::workflow
