#include "tool/command_diagnose.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "diagnosis/next_experiment.hpp"
#include "diagnosis/reference.hpp"
#include "diagnosis/texts.hpp"
#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/recording.hpp"
#include "host_sim/replay.hpp"
#include "measurement/recording_checks.hpp"
#include "reports/diagnosis_page.hpp"
#include "reports/json_results.hpp"
#include "workflow/diagnosis_comparison.hpp"
#include "workflow/diagnosis_result.hpp"

namespace bms::tool {

namespace {

using diagnosis::Finding;
using diagnosis::PreparedRecording;
using diagnosis::Verdict;
using model::catalogue;

std::string name_of_file(const std::string& path) { return std::filesystem::path(path).filename().string(); }

/// Where a recording began, and how far that is known.
struct Start {
  double soc = 0.5, sigma = 0.3;
  bool soc_given = false;
  std::string from;  ///< empty: of the user
};

Start told_start(const files::CellFile& cell, double soc, const std::string& from) {
  return {soc, std::max(cell.parameters.tolerance.initial_soc, 1e-4), true, from};
}

std::optional<Start> reference_start(const measurement::Recording& r, const files::CellFile& cell) {
  if (r.soc_ref.empty() || !(r.soc_ref.front() >= 0 && r.soc_ref.front() <= 1)) return std::nullopt;
  return told_start(cell, r.soc_ref.front(),
                    fmt::format("starts at soc_ref's first value, {:.1f} %", 100 * r.soc_ref.front()));
}

/// As the estimator reads it: the OCV curve asked with what the present current leaves open.
Start voltage_start(const measurement::Recording& r, const files::CellFile& cell) {
  const auto first = std::find_if(r.voltage_v.begin(), r.voltage_v.end(), [](double v) { return std::isfinite(v); });
  if (first == r.voltage_v.end()) return {};
  measurement::Recording one;
  const auto k = static_cast<std::size_t>(first - r.voltage_v.begin());
  one.time_s = {0};
  one.current_a = {r.current_a[k]};
  one.voltage_v = {r.voltage_v[k]};
  if (!r.temperature_c.empty()) one.temperature_c = {r.temperature_c[k]};
  const host_sim::EstimateRow row =
      host_sim::run_on_host(cell, measurement::samples(one), std::nullopt, host_sim::ScalarKind::float64).rows.front();
  return {row.soc, row.soc_sigma, false,
          fmt::format("starts where the first voltage says, {:.0f} % give or take {:.0f} %", 100 * row.soc,
                      100 * row.soc_sigma)};
}

Start start_of(const measurement::Recording& r, const files::CellFile& cell, const std::optional<double>& given) {
  if (given) return told_start(cell, *given, "");
  if (const auto start = reference_start(r, cell)) return *start;
  return voltage_start(r, cell);
}

/// A later recording's own reference goes before what was said of the first.
Start start_of_holdout(const measurement::Recording& r, const files::CellFile& cell,
                       const std::optional<double>& given) {
  if (const auto start = reference_start(r, cell)) return *start;
  return start_of(r, cell, given);
}

workflow::RecordingComparison opened(const std::string& path, const files::CellFile& cell,
                                     const std::optional<double>& given,
                                     Start (*rule)(const measurement::Recording&, const files::CellFile&,
                                                   const std::optional<double>&),
                                     std::vector<measurement::Warning>& warnings) {
  workflow::RecordingComparison c{files::read_recording(path), {}, {}, {}};
  measurement::compare_with_cell(c.recording, cell.parameters);
  for (const measurement::Warning& w : c.recording.warnings) warnings.push_back({w.id, path + ": " + w.text});
  const Start start = rule(c.recording, cell, given);
  if (!start.from.empty()) warnings.push_back({"initial_soc", path + ": " + start.from});
  c.record =
      workflow::record_of(c.recording, name_of_file(path), cell.parameters, start.soc, start.sigma, start.soc_given);
  return c;
}

std::string progress_line(double done, double left_s, const std::string& what) {
  return std::isfinite(left_s) ? fmt::format("{:3.0f} %, about {:.0f} s left: {:40}", 100 * done, left_s, what) : "";
}

std::string summary(const workflow::DiagnoseResult& r) {
  std::string text = fmt::format("{}: {}\n", name_of(r.diagnosis.verdict), r.diagnosis.statement);
  for (const Finding& f : r.diagnosis.findings) {
    if (!r.named()) break;
    const model::MechanismInfo& info = catalogue[f.setting.index];
    for (std::size_t k = 0; k < info.parameters; ++k) {
      text += fmt::format("  {:24} {:24} {:10.5g}{} {}\n", k == 0 ? info.id : "", info.parameter[k].name,
                          f.setting.value[k],
                          f.setting.deviation[k] > 0 ? fmt::format(" +- {:.2g}", f.setting.deviation[k]) : "",
                          info.parameter[k].unit == "1" ? "" : info.parameter[k].unit);
    }
    if (!f.because.empty()) text += "  " + f.because + "\n";
  }
  if (r.next)
    text += fmt::format("{}\n  {}\n  {}\n", diagnosis::why(*r.next), diagnosis::instruction(*r.next),
                        diagnosis::command(*r.next));
  if (r.baseline && r.extended && r.named())
    text += fmt::format("Open loop: {:.2f} mV RMS before, {:.2f} mV with what was found.\n", 1e3 * r.baseline->rmse_v,
                        1e3 * r.extended->rmse_v);
  if (r.baseline_holdout && r.extended_holdout) {
    text += fmt::format(
        "On recordings not used: {:.2f} mV RMS before, {:.2f} mV after; the noise floor is {:.2f} mV.\n",
        1e3 * r.baseline_holdout->rmse_v, 1e3 * r.extended_holdout->rmse_v, 1e3 * r.diagnosis.noise_floor_v);
  }
  if (r.soc)
    text += fmt::format("State of charge on them: {:.2f} % RMS before, {:.2f} % after.\n", 100 * r.soc->baseline_rmse,
                        100 * r.soc->extended_rmse);
  if (!r.out.empty()) text += "Cell file: " + r.out + "\n";
  text.pop_back();
  return text;
}

}  // namespace

int run(const DiagnoseOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  workflow::DiagnoseResult result;
  result.out = options.out;
  result.cell = files::read_cell(options.cell);
  std::vector<PreparedRecording> records;
  const std::vector<double>& soc_given = options.initial_soc;
  if (soc_given.size() > 1 && soc_given.size() != options.recordings.size()) {
    throw files::BadInput("--initial-soc", 1,
                          fmt::format("{} values for {} recordings, expected one for all or one for each",
                                      soc_given.size(), options.recordings.size()));
  }
  const auto given_soc = [&](std::size_t n) {
    return soc_given.empty() ? std::nullopt : std::optional(soc_given[std::min(n, soc_given.size() - 1)]);
  };
  for (const std::string& path : options.recordings) {
    result.recordings.push_back(
        opened(path, result.cell, given_soc(result.recordings.size()), start_of, result.warnings));
    records.push_back(result.recordings.back().record);
  }
  for (const std::string& path : options.holdouts)
    result.holdouts.push_back(opened(path, result.cell, soc_given.size() == 1 ? given_soc(0) : std::nullopt,
                                     start_of_holdout, result.warnings));

  diagnosis::Options how;
  how.progress = progress_on_terminal(0.1, progress_line);
  result.diagnosis = diagnosis::diagnose(result.cell.parameters, result.cell.mechanisms, records, how);
  diagnosis::describe(result.diagnosis, result.cell.parameters, records);
  for (const std::string& text : result.diagnosis.warnings) result.warnings.push_back({"readings", text});
  if (result.named()) {
    const bool temperature = std::any_of(records.begin(), records.end(),
                                         [](const PreparedRecording& r) { return !r.temperature_c.empty(); });
    result.next = diagnosis::next_experiment(result.cell.parameters, result.diagnosis, temperature);
  }

  workflow::compare(result);
  result.baseline = workflow::figures(result.recordings, &workflow::RecordingComparison::base_v);
  result.extended = workflow::figures(result.recordings, &workflow::RecordingComparison::extended_v);
  result.baseline_holdout = workflow::figures(result.holdouts, &workflow::RecordingComparison::base_v);
  result.extended_holdout = workflow::figures(result.holdouts, &workflow::RecordingComparison::extended_v);
  result.extended_cell = workflow::extended_cell(result);
  result.soc = workflow::soc_errors(result);
  if (result.named() && result.baseline_holdout && result.extended_holdout &&
      result.extended_holdout->rmse_v > 1.05 * result.baseline_holdout->rmse_v) {
    result.warnings.push_back(
        {"holdout_worse", fmt::format("what was found makes the recordings that were not used worse, {:.1f} mV in "
                                      "place of {:.1f} mV: do not rely on it",
                                      1e3 * result.extended_holdout->rmse_v, 1e3 * result.baseline_holdout->rmse_v)});
  }
  if (result.named() && result.soc && result.soc->extended_rmse > 1.05 * result.soc->baseline_rmse) {
    result.warnings.push_back(
        {"soc_worse", fmt::format("the estimated state of charge is worse with it, {:.2f} % in place of {:.2f} %",
                                  100 * result.soc->extended_rmse, 100 * result.soc->baseline_rmse)});
  }

  for (const measurement::Warning& w : result.warnings) warn(w.text);
  if (!options.out.empty()) write_output(options.out, files::cell_text(result.extended_cell));
  result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (!options.output.json.empty()) write_output(options.output.json, reports::json_of(result));
  if (!options.output.report.empty()) write_output(options.output.report, reports::diagnosis_report(result));
  print_summary(options.output, summary(result));
  return 0;
}

}  // namespace bms::tool
