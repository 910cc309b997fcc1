#include "workflow/diagnose_recordings.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "diagnosis/courses_among.hpp"
#include "diagnosis/next_experiment.hpp"
#include "diagnosis/recording_check.hpp"
#include "diagnosis/reference.hpp"
#include "diagnosis/texts.hpp"
#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "host_sim/replay.hpp"
#include "measurement/recording_checks.hpp"
#include "workflow/diagnosis_comparison.hpp"
#include "workflow/likeliest_start.hpp"
#include "workflow/next_steps.hpp"

namespace bms::workflow {

namespace {

constexpr double least_start_sigma = 1e-4;     ///< of a given initial SOC
constexpr double significant_increase = 1.05;  ///< of an error on the hold-outs, before a warning says so

/// The first value of soc_ref; nothing if it is missing or not a state of charge.
std::optional<StartSoc> reference_start(const measurement::Recording& r, const files::CellFile& cell) {
  if (r.soc_ref.empty() || !(r.soc_ref.front() >= 0 && r.soc_ref.front() <= 1)) return std::nullopt;
  return given_start(cell, r.soc_ref.front());
}

/// The estimator's result for the first sample with a voltage; nothing if no sample has one.
std::optional<StartSoc> estimated_start(const measurement::Recording& r, const files::CellFile& cell) {
  const auto first = std::find_if(r.voltage_v.begin(), r.voltage_v.end(), [](double v) { return std::isfinite(v); });
  if (first == r.voltage_v.end()) return std::nullopt;
  measurement::Recording one;
  const auto k = static_cast<std::size_t>(first - r.voltage_v.begin());
  one.time_s = r.time_s.part(k, 1);
  one.current_a = r.current_a.part(k, 1);
  one.voltage_v = r.voltage_v.part(k, 1);
  one.temperature_c = r.temperature_c.part(k, 1);
  const host_sim::EstimateRow row =
      host_sim::run_on_host(cell, measurement::samples(one), std::nullopt, host_sim::ScalarKind::float64).rows.front();
  return StartSoc{row.soc, row.soc_sigma, false};
}

/// Of a logger that writes rows on change: the current of the row before holds until a row with another one. A row of
/// a recording has the mean current since the row before, so one without a voltage is added just before each change.
void add_rows_before_changes(measurement::Recording& r, const files::CellFile& cell) {
  const double unchanged_s = diagnosis::longest_unchanged_s(r.time_s, r.current_a, cell.parameters.capacity_ah),
               step_s = measurement::usual_step_s(r);
  if (!(unchanged_s > 0)) return;
  std::vector<std::size_t> changes;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const double dt_s = r.time_s[k] - r.time_s[k - 1];
    if (dt_s > 2 * step_s && dt_s <= unchanged_s && r.current_a[k] != r.current_a[k - 1]) changes.push_back(k);
  }
  const auto with_rows = [&](measurement::Column& column, auto value) {
    if (column.empty()) return;
    std::vector<double> values;
    auto next = changes.begin();
    for (std::size_t k = 0; k < column.size(); ++k) {
      if (next != changes.end() && *next == k) {
        values.push_back(value(column, k));
        ++next;
      }
      values.push_back(column[k]);
    }
    column = std::move(values);
  };
  const auto missing = [](const measurement::Column&, std::size_t) { return std::nan(""); };
  const auto before = [](const measurement::Column& c, std::size_t k) { return c[k - 1]; };
  with_rows(r.time_s, [&](const measurement::Column& c, std::size_t k) { return c[k] - step_s; });
  with_rows(r.current_a, before);
  with_rows(r.temperature_c, before);
  with_rows(r.soc_ref, [](const measurement::Column& c, std::size_t k) { return c[k]; });
  for (auto column : {&measurement::Recording::voltage_v, &measurement::Recording::current_ref_a,
                      &measurement::Recording::voltage_ref_v})
    with_rows(r.*column, missing);
}

enum class Priority { user_first, reference_first };

/// Reads one recording and determines its start.
RecordingComparison read(const std::string& path, const files::ReadOptions& reading, const std::optional<double>& given,
                         Priority priority, DiagnoseInput& input) {
  measurement::Recording r = read_for_diagnosis(path, reading, input.cell);
  measurement::compare_with_cell(r, input.cell.parameters);
  for (const measurement::Warning& w : r.warnings) input.warnings.push_back({w.id, path + ": " + w.text});
  const auto reference = reference_start(r, input.cell);
  StartSoc start;
  std::string origin;
  if (given && !(reference && priority == Priority::reference_first)) {
    start = given_start(input.cell, *given);
  } else if (reference) {
    start = *reference;
    origin = fmt::format("starts at the first value of soc_ref, {:.1f} %", 100 * start.soc);
  } else if (const auto estimated = estimated_start(r, input.cell)) {
    start = likeliest_start(r, input.cell, *estimated);
    origin = fmt::format(
        "starts at the state of charge estimated from the first voltage, {:.0f} % with a standard "
        "deviation of {:.0f} %",
        100 * estimated->soc, 100 * estimated->sigma);
    if (start.soc != estimated->soc)
      origin += fmt::format("; the whole recording fits best from {:.1f} % on", 100 * start.soc);
  }
  if (!origin.empty()) input.warnings.push_back({"initial_soc", path + ": " + origin});
  return prepared(std::move(r), std::filesystem::path(path).filename().string(), input.cell, start);
}

}  // namespace

StartSoc start_of(const measurement::Recording& r, const files::CellFile& cell) {
  if (const auto reference = reference_start(r, cell)) return *reference;
  const auto estimated = estimated_start(r, cell);
  return estimated ? likeliest_start(r, cell, *estimated) : StartSoc{};
}

measurement::Recording read_for_diagnosis(const std::string& path, const files::ReadOptions& reading,
                                          const files::CellFile& cell) {
  measurement::Recording r = files::read_recording(path, files::VoltageColumn::required, reading);
  add_rows_before_changes(r, cell);
  return r;
}

StartSoc given_start(const files::CellFile& cell, double soc) {
  return {soc, std::max(cell.parameters.tolerance.initial_soc, least_start_sigma), true};
}

RecordingComparison prepared(measurement::Recording r, const std::string& name, const files::CellFile& cell,
                             const StartSoc& start) {
  const bool any_temperature =
      std::any_of(r.temperature_c.begin(), r.temperature_c.end(), [](double t) { return std::isfinite(t); });
  diagnosis::PreparedRecording record{.name = name,
                                      .time_s = r.time_s,
                                      .current_a = r.current_a,
                                      .voltage_v = r.voltage_v,
                                      .temperature_c = any_temperature ? r.temperature_c : measurement::Column{},
                                      .initial_soc = start.soc,
                                      .initial_soc_sigma = start.sigma,
                                      .initial_soc_given = start.given,
                                      .checks = {}};
  diagnosis::average_references(record, r.current_ref_a, r.voltage_ref_v, cell.parameters);
  return {std::move(r), std::move(record), {}, {}, {}};
}

diagnosis::Coverage coverage_of(const files::CellFile& cell, const diagnosis::PreparedRecording& record) {
  return diagnosis::prediction_interval(cell.parameters, cell.mechanisms, record,
                                        diagnosis::predict(cell.parameters, cell.mechanisms, record), cell.healthy)
      .coverage;
}

DiagnoseInput read_diagnose_input(const DiagnoseOptions& options) {
  const std::vector<double>& soc = options.initial_soc;
  if (soc.size() > 1 && soc.size() != options.recordings.size()) {
    throw files::BadInput("--initial-soc", 1,
                          fmt::format("{} values for {} recordings, expected one for all or one for each", soc.size(),
                                      options.recordings.size()));
  }
  const auto given = [&](std::size_t n) {
    return soc.empty() ? std::nullopt : std::optional(soc[std::min(n, soc.size() - 1)]);
  };
  DiagnoseInput input;
  input.cell = options.cell_file ? *options.cell_file : files::read_cell(options.cell);
  for (const std::string& path : options.recordings)
    input.recordings.push_back(
        read(path, options.reading, given(input.recordings.size()), Priority::user_first, input));
  for (const std::string& path : options.holdouts) {
    input.holdouts.push_back(
        read(path, options.reading, soc.size() == 1 ? given(0) : std::nullopt, Priority::reference_first, input));
  }
  return input;
}

DiagnoseResult diagnose_recordings(DiagnoseInput input, const diagnosis::Options& options) {
  const auto begin = std::chrono::steady_clock::now();
  DiagnoseResult r;
  r.cell = std::move(input.cell);
  r.recordings = std::move(input.recordings);
  r.holdouts = std::move(input.holdouts);
  r.warnings = std::move(input.warnings);
  std::vector<diagnosis::PreparedRecording> records;
  for (const RecordingComparison& c : r.recordings) records.push_back(c.record);
  diagnosis::Options with_healthy = options;
  with_healthy.healthy = r.cell.healthy;
  r.diagnosis = diagnosis::diagnose(r.cell.parameters, r.cell.mechanisms, records, with_healthy);
  diagnosis::describe(r.diagnosis, r.cell.parameters, records);
  for (const std::string& text : r.diagnosis.warnings) r.warnings.push_back({"readings", text});
  compare(r);
  r.baseline = figures(r.recordings, &RecordingComparison::base_v);
  r.extended = figures(r.recordings, &RecordingComparison::extended_v);
  r.baseline_holdout = figures(r.holdouts, &RecordingComparison::base_v);
  r.extended_holdout = figures(r.holdouts, &RecordingComparison::extended_v);
  r.extended_cell = extended_cell(r);
  add_intervals(r);
  r.soc = soc_errors(r);
  r.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return r;
}

void add_next_experiment(const DiagnoseOptions& options, DiagnoseResult& r) {
  if (!r.named()) return;
  std::vector<diagnosis::PreparedRecording> records;
  for (const RecordingComparison& c : r.recordings) records.push_back(c.record);
  const bool temperature = std::any_of(r.recordings.begin(), r.recordings.end(),
                                       [](const RecordingComparison& c) { return !c.record.temperature_c.empty(); });
  r.next = diagnosis::next_experiment(r.cell.parameters, r.diagnosis, temperature,
                                      diagnosis::courses_among(records, r.cell.parameters.capacity_ah));
  if (r.next) {
    r.then = joint_command(options, r.recordings, *r.next);
    return;
  }
  r.nothing_more = diagnosis::nothing_more_text(r.diagnosis);
  std::string& statement = r.diagnosis.statement;
  if (!r.nothing_more.empty() && statement.ends_with(diagnosis::another_experiment)) {
    statement.resize(statement.size() - diagnosis::another_experiment.size());
    statement += "No other experiment would.";
  }
}

void add_holdout_warnings(DiagnoseResult& r) {
  if (!r.named() && !r.has_term()) return;
  if (r.baseline_holdout && r.extended_holdout &&
      r.extended_holdout->rmse_v > significant_increase * r.baseline_holdout->rmse_v) {
    r.warnings.push_back(
        {"holdout_worse", fmt::format("with the extended cell file the error on the hold-out recordings increases from "
                                      "{:.1f} mV to {:.1f} mV: do not rely on it",
                                      1e3 * r.baseline_holdout->rmse_v, 1e3 * r.extended_holdout->rmse_v)});
  }
  if (r.soc && r.soc->extended_rmse > significant_increase * r.soc->baseline_rmse) {
    r.warnings.push_back(
        {"soc_worse", fmt::format("with the findings the error of the estimated state of charge increases from "
                                  "{:.2f} % to {:.2f} %",
                                  100 * r.soc->baseline_rmse, 100 * r.soc->extended_rmse)});
  }
}

}  // namespace bms::workflow
