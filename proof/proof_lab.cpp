#include "proof/proof_lab.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "diagnosis/texts.hpp"
#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "images/child_process.hpp"
#include "tool/command_identify.hpp"
#include "workflow/diagnosis_comparison.hpp"

namespace bms::proof {

namespace {

using model::catalogue;

workflow::RecordingComparison begun(const measurement::Recording& r, const files::CellFile& cell) {
  if (r.soc_ref.empty() || !std::isfinite(r.soc_ref.front()))
    throw files::BadInput(r.path, 1, "no soc_ref at the start, expected the reference state of charge");
  return {r,
          workflow::record_of(r, std::filesystem::path(r.path).stem().string(), cell.parameters, r.soc_ref.front(),
                              std::max(cell.parameters.tolerance.initial_soc, 1e-4), true),
          {},
          {}};
}

}  // namespace

const measurement::Recording& ProofLab::recording(const std::string& name) {
  return recordings_.get(name, [&] { return files::read_recording(path(name)); });
}

const files::CellFile& ProofLab::built_in(const std::string& name) {
  return cells_.get(name, [&] { return files::read_cell(name); });
}

const files::CellFile& ProofLab::identified(const std::string& name, const std::vector<std::string>& ocv,
                                            const std::string& recording) {
  return cells_.get(name, [&] {
    report_progress(0, "identifying " + name);
    const images::TemporaryFolder folder;
    tool::IdentifyOptions options;
    for (const std::string& slow : ocv) options.ocv.push_back(path(slow));
    options.recordings = {path(recording)};
    options.start = "a123_26650";
    options.window = "0.95:0.15";
    options.name = name;
    options.out = (folder.path() / "cell.toml").string();
    options.output.quiet = true;
    tool::run(options);
    return files::read_cell(options.out);
  });
}

const workflow::DiagnoseResult& ProofLab::diagnosed(const files::CellFile& cell,
                                                    const std::vector<std::string>& names) {
  std::string together;
  std::vector<measurement::Recording> list;
  for (const std::string& name : names) {
    together += (together.empty() ? "" : " + ") + name;
    list.push_back(recording(name));
  }
  return diagnosed(cell, together, list);
}

const workflow::DiagnoseResult& ProofLab::diagnosed(const files::CellFile& cell, const std::string& name,
                                                    const std::vector<measurement::Recording>& list) {
  const std::string key = cell.name + ": " + name;
  return *diagnoses_.get(key, [&] {
    const auto begin = std::chrono::steady_clock::now();
    auto r = std::make_shared<workflow::DiagnoseResult>();
    r->cell = cell;
    std::vector<diagnosis::PreparedRecording> records;
    double rows = 0;
    for (const measurement::Recording& recording : list) {
      r->recordings.push_back(begun(recording, cell));
      records.push_back(r->recordings.back().record);
      rows += static_cast<double>(recording.rows());
    }
    diagnosis::Options how;
    double reported = 0;
    how.progress = [&](double done, const std::string&) {
      report_progress(rows * std::max(0.0, done - reported), key);
      reported = std::max(reported, done);
    };
    r->diagnosis = diagnosis::diagnose(cell.parameters, cell.mechanisms, records, how);
    report_progress(rows * (1 - reported), key);
    diagnosis::describe(r->diagnosis, cell.parameters, records);
    workflow::compare(*r);
    r->baseline = workflow::figures(r->recordings, &workflow::RecordingComparison::base_v);
    r->extended = workflow::figures(r->recordings, &workflow::RecordingComparison::extended_v);
    r->extended_cell = workflow::extended_cell(*r);
    r->extended_cell.name = key + " (extended)";  // names diagnoses made with it
    r->wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return r;
  });
}

workflow::RecordingComparison ProofLab::scored(const workflow::DiagnoseResult& of, const std::string& name,
                                               const diagnosis::Hypothesis* instead) {
  workflow::DiagnoseResult one;
  one.cell = of.cell;
  one.diagnosis = of.diagnosis;
  if (instead != nullptr) one.diagnosis.extended = *instead;
  one.holdouts.push_back(begun(recording(name), of.cell));
  workflow::compare(one);
  return one.holdouts.front();
}

std::vector<ProofDiagnosis> ProofLab::diagnoses() const {
  std::vector<ProofDiagnosis> list;
  for (const auto& [name, value] : diagnoses_.all()) {
    const workflow::DiagnoseResult* r = nullptr;
    try {
      r = value.get().get();
    } catch (const std::exception&) {
      continue;  // the experiment has said so
    }
    ProofDiagnosis d{name, name_of(r->diagnosis.verdict), r->diagnosis.statement, {}, 0, 0, r->wall_s};
    if (r->baseline) d.before_v = r->baseline->rmse_v;
    if (r->extended) d.after_v = r->extended->rmse_v;
    for (const diagnosis::Finding& f : r->diagnosis.findings) {
      if (!r->named()) break;
      const model::MechanismInfo& info = catalogue[f.setting.index];
      std::string text(info.id);
      for (std::size_t k = 0; k < info.parameters; ++k) {
        const model::Parameter& p = info.parameter[k];
        text += fmt::format("{} {} {}", k == 0 ? ":" : ",", p.name,
                            diagnosis::parameter_text(p, f.setting.value[k], f.setting.deviation[k]));
      }
      for (std::size_t k = 0; k < f.equivalent_to.size(); ++k)
        text += (k == 0 ? "; or " : ", ") + std::string(catalogue[f.equivalent_to[k]].id);
      d.found.push_back(text);
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
