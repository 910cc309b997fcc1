#include "proof/proof_lab.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "diagnosis/texts.hpp"
#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "workflow/diagnose_recordings.hpp"
#include "workflow/diagnosis_comparison.hpp"
#include "workflow/identify_cell.hpp"

namespace bms::proof {

namespace {

using model::catalogue;

constexpr workflow::SocWindow identified_window{.high = 0.95, .low = 0.15};

/// A recording that starts from its reference state of charge.
workflow::RecordingComparison prepared(const measurement::Recording& r, const files::CellFile& cell) {
  if (r.soc_ref.empty() || !std::isfinite(r.soc_ref.front()))
    throw files::BadInput(r.path, 1, "no soc_ref at the start, expected the reference state of charge");
  const std::string file = std::filesystem::path(r.path).filename().string();
  return workflow::prepared(r, file.substr(0, file.find('.')), cell, workflow::given_start(cell, r.soc_ref.front()));
}

/// "ocv_hysteresis: half_gap_v 18.4 +- 0.4 mV; or slow_polarisation".
std::string text_of(const diagnosis::Finding& f) {
  const model::MechanismInfo& info = catalogue[f.setting.index];
  std::string text(info.id);
  for (std::size_t k = 0; k < info.parameters; ++k) {
    const model::Parameter& p = info.parameter[k];
    text += fmt::format("{} {} {}", k == 0 ? ":" : ",", p.name,
                        diagnosis::parameter_text(p, f.setting.value[k], f.setting.deviation[k]));
  }
  for (std::size_t k = 0; k < f.equivalent_to.size(); ++k)
    text += (k == 0 ? "; or " : ", ") + std::string(catalogue[f.equivalent_to[k]].id);
  return text;
}

}  // namespace

std::string ProofLab::path(const std::string& name) const {
  const std::string plain = folder_ + "/" + name + ".csv", compressed = plain + ".gz";
  return std::filesystem::exists(compressed) && !std::filesystem::exists(plain) ? compressed : plain;
}

const measurement::Recording& ProofLab::recording(const std::string& name) {
  return recordings_.get(name, [&] { return files::read_recording(path(name)); });
}

const files::CellFile& ProofLab::built_in(const std::string& name) {
  return cells_.get(name, [&] { return files::read_cell(name); });
}

const files::CellFile& ProofLab::identified(const IdentifiedCell& cell) {
  return cells_.get(cell.name, [&] {
    report_progress(0, "identifying " + cell.name);
    workflow::IdentifyOptions options;
    for (const std::string& slow : cell.ocv) options.ocv.push_back(path(slow));
    options.recordings = {path(cell.drive)};
    options.start = "a123_26650";
    options.window = identified_window;
    options.name = cell.name;
    return files::parse_cell(files::cell_text(*workflow::identify_cell(options).cell_file), cell.name);
  });
}

const workflow::DiagnoseResult& ProofLab::diagnosed(const files::CellFile& cell,
                                                    const std::vector<std::string>& names) {
  std::string all_names;
  std::vector<measurement::Recording> list;
  for (const std::string& name : names) {
    all_names += (all_names.empty() ? "" : " + ") + name;
    list.push_back(recording(name));
  }
  return diagnosed(cell, all_names, list);
}

const workflow::DiagnoseResult& ProofLab::diagnosed(const files::CellFile& cell, const std::string& name,
                                                    const std::vector<measurement::Recording>& list) {
  const std::string key = cell.name + ": " + name;
  return *diagnoses_.get(key, [&] {
    workflow::DiagnoseInput input{cell, {}, {}, {}, {}};
    double rows = 0;
    for (const measurement::Recording& recording : list) {
      input.recordings.push_back(prepared(recording, cell));
      rows += static_cast<double>(recording.rows());
    }
    diagnosis::Options options;
    double reported = 0;
    options.progress = [&](double done, const std::string&) {
      report_progress(rows * std::max(0.0, done - reported), key);
      reported = std::max(reported, done);
    };
    auto r = std::make_shared<workflow::DiagnoseResult>(workflow::diagnose_recordings(std::move(input), options));
    report_progress(rows * (1 - reported), key);
    r->extended_cell.name = key + " (extended)";  // part of the names of the diagnoses made with it
    return r;
  });
}

workflow::RecordingComparison ProofLab::scored(const workflow::DiagnoseResult& of, const std::string& name,
                                               const diagnosis::Hypothesis* instead) {
  workflow::DiagnoseResult one;
  one.cell = of.cell;
  one.extended_cell = of.extended_cell;
  one.holdouts.push_back(prepared(recording(name), of.cell));
  workflow::compare_holdouts(one);
  workflow::RecordingComparison& c = one.holdouts.front();
  if (instead != nullptr && of.named()) {
    const auto settings = diagnosis::later_recording(*instead, c.record.initial_soc);
    c.extended_v = diagnosis::predict(of.diagnosis.cell, settings, c.record);
  }
  return c;
}

std::vector<ProofDiagnosis> ProofLab::diagnoses() const {
  std::vector<ProofDiagnosis> list;
  for (const auto& [name, value] : diagnoses_.all()) {
    const workflow::DiagnoseResult* r = nullptr;
    try {
      r = value.get().get();
    } catch (const std::exception&) {
      continue;  // the experiment reports it
    }
    ProofDiagnosis d{name, name_of(r->diagnosis.verdict), r->diagnosis.statement, {}, 0, 0, r->wall_s};
    if (r->baseline) d.before_v = r->baseline->rmse_v;
    if (r->extended) d.after_v = r->extended->rmse_v;
    if (r->named()) {
      for (const diagnosis::Finding& f : r->diagnosis.findings) d.found.push_back(text_of(f));
    }
    list.push_back(std::move(d));
  }
  return list;
}

void ProofLab::report_progress(double rows, const std::string& what) {
  const std::lock_guard lock(progress_mutex_);
  done_ += rows;
  if (progress_) progress_(std::min(0.99, done_ / work_), what);
}

}  // namespace bms::proof
