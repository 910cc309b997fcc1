#include "workflow/diagnosis_comparison.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "diagnosis/model_tolerance.hpp"
#include "identification/goodness_of_fit.hpp"
#include "model/start.hpp"
#include "replay/replay.hpp"

namespace bms::workflow {

namespace {

using diagnosis::Finding;
using model::catalogue;

/// The value rounded to significant digits.
double to_digits(double value, int digits) {
  return value == 0 || !std::isfinite(value) ? value : std::stod(fmt::format("{:.{}g}", value, digits));
}

model::CellParameters<> with_short_numbers(model::CellParameters<> p) {
  for (auto* column : {&p.ocv.b0_v, &p.ocv.b1_v, &p.ocv.half_gap_v, &p.ocv.soc}) {
    for (std::size_t k = 0; k < column->size; ++k) (*column)[k] = to_digits((*column)[k], 8);
  }
  for (auto* column : {&p.rc.r0_ohm, &p.rc.r1_ohm, &p.rc.c1_f}) {
    for (std::size_t k = 0; k < column->size; ++k) (*column)[k] = to_digits((*column)[k], 6);
  }
  p.capacity_ah = to_digits(p.capacity_ah, 7);
  return p;
}

std::string ids_of(const std::vector<std::size_t>& mechanisms) {
  std::string ids;
  for (const std::size_t m : mechanisms) ids += (ids.empty() ? "" : ", ") + std::string(catalogue[m].id);
  return ids;
}

/// Mechanisms of the extended model in the recordings that were diagnosed.
std::vector<model::MechanismSetting> extended_settings(const DiagnoseResult& r) {
  if (r.has_term()) return diagnosis::with_term(r.cell.mechanisms, *r.diagnosis.law);
  return r.named() ? r.diagnosis.extended.settings : r.cell.mechanisms;
}

}  // namespace

void compare_recordings(DiagnoseResult& r) {
  const std::vector<model::MechanismSetting>& own = r.cell.mechanisms;
  diagnosis::Hypothesis found{extended_settings(r), own.size(), {}};
  for (std::size_t n = 0; n < r.recordings.size(); ++n) {
    RecordingComparison& c = r.recordings[n];
    c.base_v = diagnosis::predict(r.cell.parameters, own, c.record);
    const std::vector<std::vector<model::Span>>& bursts = r.diagnosis.extended.bursts;
    found.bursts.clear();
    if (r.named() && bursts.size() == r.recordings.size()) found.bursts = {bursts[n]};
    const diagnosis::LikelihoodModel likelihood(r.diagnosis.cell, own, {c.record}, {});
    c.extended_v = likelihood.voltage(found, likelihood.unchanged(), 0);
  }
}

void compare_holdouts(DiagnoseResult& r) {
  for (RecordingComparison& c : r.holdouts) {
    c.base_v = diagnosis::predict(r.cell.parameters, r.cell.mechanisms, c.record);
    c.extended_v = diagnosis::predict(r.extended_cell.parameters, r.extended_cell.mechanisms, c.record);
  }
}

void add_intervals(DiagnoseResult& r) {
  const auto add = [&](RecordingComparison& c, const std::vector<model::MechanismSetting>& settings) {
    c.interval =
        diagnosis::prediction_interval(r.extended_cell.parameters, settings, c.record, c.extended_v, r.cell.healthy);
  };
  for (RecordingComparison& c : r.recordings) add(c, extended_settings(r));
  for (RecordingComparison& c : r.holdouts) add(c, r.extended_cell.mechanisms);
}

std::optional<diagnosis::Coverage> coverage(const std::vector<RecordingComparison>& list) {
  diagnosis::Coverage all;
  for (const RecordingComparison& c : list) all.add(c.record.voltage_v, c.extended_v, c.interval.sigma_v);
  return all.readings() > 0 ? std::optional(all) : std::nullopt;
}

std::optional<OpenLoopFigures> figures(const std::vector<RecordingComparison>& list,
                                       std::vector<double> RecordingComparison::*simulated) {
  identification::ErrorFigure error;
  identification::FitFigure fit;
  for (const RecordingComparison& c : list) {
    for (std::size_t k = 0; k < c.record.size(); ++k) {
      error.add(c.record.voltage_v[k] - (c.*simulated)[k]);
      fit.add(c.record.voltage_v[k], (c.*simulated)[k]);
    }
  }
  if (error.count() == 0) return std::nullopt;
  return OpenLoopFigures{error.rms(), fit.percent()};
}

std::optional<SocErrors> soc_errors(const DiagnoseResult& r) {
  identification::ErrorFigure base, extended, sigma;
  const auto add = [](const files::CellFile& cell, const RecordingComparison& c, identification::ErrorFigure& figure,
                      identification::ErrorFigure* stated) {
    const auto start =
        replay::starting_point(replay::SocPrior{c.record.initial_soc, std::max(c.record.initial_soc_sigma, 0.02)},
                               model::start_shift(cell.mechanisms));
    const replay::Track track =
        replay::run_on_host(cell, measurement::samples(c.recording), start, replay::ScalarKind::float32);
    for (std::size_t k = 0; k < track.rows.size(); ++k) {
      figure.add(track.rows[k].soc - c.recording.soc_ref[k]);
      if (stated != nullptr) stated->add(track.rows[k].soc_sigma);
    }
  };
  for (const RecordingComparison& c : r.holdouts) {
    if (c.recording.soc_ref.empty()) continue;
    add(r.cell, c, base, nullptr);
    add(r.extended_cell, c, extended, &sigma);
  }
  if (base.count() == 0) return std::nullopt;
  return SocErrors{base.rms(), extended.rms(), sigma.rms()};
}

namespace {

/// Adds a mechanism with short numbers to the cell file.
void add_setting(model::MechanismSetting setting, const std::string& source, files::CellFile& cell) {
  const double capacity_ah = cell.parameters.capacity_ah;
  const model::MechanismInfo& info = catalogue[setting.index];
  for (std::size_t k = 0; k < info.parameters; ++k) {
    const double short_value = to_digits(setting.value[k], 6);
    if (short_value >= info.parameter[k].lower(capacity_ah) && short_value <= info.parameter[k].upper(capacity_ah))
      setting.value[k] = short_value;
    setting.deviation[k] = std::isfinite(setting.deviation[k]) ? to_digits(setting.deviation[k], 3) : 0;
  }
  files::put_mechanism(cell, setting);
  cell.sources[files::table_of(info)] = source;
}

/// Adds a finding to the cell file with its source. What belongs to the recording is left out: its start, the branch on
/// which it began, the moment of a contact's change.
void add_finding(const DiagnoseResult& r, const std::string& files, const Finding& f, files::CellFile& cell) {
  const model::MechanismInfo& info = catalogue[f.setting.index];
  if (info.domain == model::Domain::start) return;
  model::MechanismSetting setting = f.setting;
  if (model::MechanismSetting later = setting; diagnosis::knowledge_of(setting.index).carry_over(later))
    setting = later;
  std::string source = fmt::format("bms diagnose of {}: {:.2f} mV RMS of the voltage, gain {:.0f}", files,
                                   1e3 * f.rms_contribution_v, f.gain);
  if (info.id == model::ContactStep::id) {
    source += fmt::format("; since {:.0f} s of {}", f.setting.value[1], r.recordings.front().record.name);
  }
  if (!f.equivalent_to.empty()) source += "; these recordings cannot distinguish it from " + ids_of(f.equivalent_to);
  add_setting(setting, source, cell);
}

/// Adds the term that was learned for an unknown cause.
void add_term(const DiagnoseResult& r, const std::string& files, files::CellFile& cell) {
  const diagnosis::LawTerm& law = *r.diagnosis.law;
  cell.parameters = with_short_numbers(r.diagnosis.cell);
  const std::string source =
      fmt::format("term for an unknown cause in {} (bms diagnose of {})", name_of_law(law), files);
  cell.source += "; with a " + source;
  for (const char* table : {"ocv", "rc"}) {
    cell.sources[table] += law.mechanism
                               ? fmt::format("; adjusted within its tolerance to {}, together with the term", files)
                               : "; with a " + source;
  }
  if (law.mechanism) add_setting(*law.mechanism, source, cell);
}

/// Widens the tolerance of OCV and drift to the residual of the extended cell on its own recordings.
void widen_tolerance(const DiagnoseResult& r, const std::string& files, files::CellFile& cell) {
  std::vector<diagnosis::PreparedRecording> records;
  for (const RecordingComparison& c : r.recordings) records.push_back(c.record);
  const double factor = diagnosis::tolerance_factor(cell.parameters, cell.mechanisms, std::move(records));
  if (!(factor > 1)) return;
  cell.parameters.tolerance = diagnosis::with_wider_tolerance(cell.parameters.tolerance, factor);
  for (double* v : {&cell.parameters.tolerance.ocv_v, &cell.parameters.tolerance.drift_v}) *v = to_digits(*v, 4);
  cell.sources["tolerance"] +=
      fmt::format("; OCV and drift widened by a factor of {:g}, to the residual of {}", factor, files);
}

}  // namespace

files::CellFile extended_cell(const DiagnoseResult& r) {
  files::CellFile cell = r.cell;
  std::string files;
  for (const RecordingComparison& c : r.recordings) files += (files.empty() ? "" : ", ") + c.record.name;
  if (r.has_term()) {
    if (!cell.name.ends_with("_extended")) cell.name += "_extended";
    add_term(r, files, cell);
    return cell;
  }
  if (!r.named()) {
    cell.source += fmt::format("; bms diagnose of {}: {}, nothing was added", files, name_of(r.diagnosis.verdict));
    return cell;
  }
  if (!cell.name.ends_with("_extended")) cell.name += "_extended";
  cell.source += fmt::format("; with the findings of bms diagnose in {}: {:.2f} mV RMS open loop, before {:.2f}", files,
                             1e3 * r.extended->rmse_v, 1e3 * r.baseline->rmse_v);
  cell.parameters = with_short_numbers(r.diagnosis.cell);
  for (const char* table : {"ocv", "rc"})
    cell.sources[table] += fmt::format("; adjusted within its tolerance to {}, together with the findings", files);
  for (const Finding& f : r.diagnosis.findings) add_finding(r, files, f, cell);
  if (!r.diagnosis.interrupted) widen_tolerance(r, files, cell);
  return cell;
}

}  // namespace bms::workflow
