#include "proof/proof_lab.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "diagnosis/texts.hpp"
#include "files/bad_input.hpp"
#include "files/text_file.hpp"
#include "images/child_process.hpp"
#include "workflow/diagnose_recordings.hpp"
#include "workflow/diagnosis_comparison.hpp"
#include "workflow/identify_cell.hpp"

namespace bms::proof {

namespace {

using model::catalogue;

workflow::RecordingComparison begun(const files::Recording& r, const files::CellFile& cell) {
  if (r.soc_ref.empty() || !std::isfinite(r.soc_ref.front()))
    throw files::BadInput(r.path, 1, "no soc_ref at the start, expected the reference state of charge");
  return workflow::prepared(r, std::filesystem::path(r.path).stem().string(), cell,
                            workflow::given_start(cell, r.soc_ref.front()));
}

}  // namespace

const files::Recording& ProofLab::recording(const std::string& name) {
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
    workflow::IdentifyOptions options;
    for (const std::string& slow : ocv) options.ocv.push_back(path(slow));
    options.recordings = {path(recording)};
    options.start = "a123_26650";
    options.window = {0.95, 0.15};
    options.name = name;
    options.out = (folder.path() / "cell.toml").string();
    files::write_file(options.out, files::cell_text(*workflow::identify_cell(options).cell_file));
    return files::read_cell(options.out);
  });
}

const workflow::DiagnoseResult& ProofLab::diagnosed(const files::CellFile& cell,
                                                    const std::vector<std::string>& names) {
  std::string together;
  std::vector<files::Recording> list;
  for (const std::string& name : names) {
    together += (together.empty() ? "" : " + ") + name;
    list.push_back(recording(name));
  }
  return diagnosed(cell, together, list);
}

const workflow::DiagnoseResult& ProofLab::diagnosed(const files::CellFile& cell, const std::string& name,
                                                    const std::vector<files::Recording>& list) {
  const std::string key = cell.name + ": " + name;
  return *diagnoses_.get(key, [&] {
    workflow::DiagnoseInput input{cell, {}, {}, {}};
    double rows = 0;
    for (const files::Recording& recording : list) {
      input.recordings.push_back(begun(recording, cell));
      rows += static_cast<double>(recording.rows());
    }
    diagnosis::Options how;
    double reported = 0;
    how.progress = [&](double done, const std::string&) {
      report_progress(rows * std::max(0.0, done - reported), key);
      reported = std::max(reported, done);
    };
    auto r = std::make_shared<workflow::DiagnoseResult>(workflow::diagnose_recordings(std::move(input), how));
    report_progress(rows * (1 - reported), key);
    r->extended_cell.name = key + " (extended)";  // names diagnoses made with it
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
