#include "workflow/diagnose_recordings.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <string_view>

#include <fmt/format.h>

#include "diagnosis/experiments_already_done.hpp"
#include "diagnosis/next_experiment.hpp"
#include "diagnosis/recording_check.hpp"
#include "diagnosis/reference.hpp"
#include "diagnosis/texts.hpp"
#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "measurement/recording_checks.hpp"
#include "measurement/soc_column_text.hpp"
#include "workflow/diagnosis_comparison.hpp"
#include "workflow/finite_answer.hpp"
#include "workflow/next_steps.hpp"

namespace bms::workflow {

namespace {

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

/// Reads one recording and determines its start.
RecordingComparison read(const std::string& path, const files::ReadOptions& reading, const std::optional<double>& given,
                         std::string_view consequence, DiagnoseInput& input) {
  measurement::Recording r = read_for_diagnosis(path, reading, input.cell);
  measurement::compare_with_cell(r, input.cell.parameters);
  for (const measurement::Warning& w : r.warnings) input.warnings.push_back({w.id, path + ": " + w.text});
  const double capacity_ah = input.cell.parameters.capacity_ah;
  auto soc_column = measurement::own_soc_column(r, capacity_ah);
  measurement::warn_of_soc_column(soc_column, r, capacity_ah, path + ": ", input.warnings);
  const RecordingStart found = recording_start(r, input.cell, given);
  if (!found.origin.empty()) input.notes.push_back({"initial_soc", path + ": " + found.origin});
  if (!found.contradiction.empty())
    input.warnings.push_back({"start_contradicted", fmt::format("{}: {}; {}", path, found.contradiction, consequence)});
  auto comparison = prepared(std::move(r), std::filesystem::path(path).filename().string(), input.cell, found.start);
  comparison.soc_column = std::move(soc_column);
  return comparison;
}

bool same_readings(const measurement::Recording& a, const measurement::Recording& b) {
  const auto same = [](const measurement::Column& x, const measurement::Column& y) {
    return std::equal(x.begin(), x.end(), y.begin(), y.end(),
                      [](double p, double q) { return p == q || (std::isnan(p) && std::isnan(q)); });
  };
  return same(a.time_s, b.time_s) && same(a.current_a, b.current_a) && same(a.voltage_v, b.voltage_v);
}

/// A recording that is read twice counts twice as evidence, and as a hold-out it tests nothing.
void refuse_same(const DiagnoseInput& input) {
  std::vector<const RecordingComparison*> all;
  for (const auto* list : {&input.recordings, &input.holdouts}) {
    for (const RecordingComparison& c : *list) all.push_back(&c);
  }
  for (std::size_t n = 1; n < all.size(); ++n) {
    for (std::size_t m = 0; m < n; ++m) {
      if (!same_readings(all[m]->recording, all[n]->recording)) continue;
      throw files::BadInput(
          all[n]->recording.path, 1,
          fmt::format("the same readings as in {}, expected another recording", all[m]->recording.path));
    }
  }
}

}  // namespace

measurement::Recording read_for_diagnosis(const std::string& path, const files::ReadOptions& reading,
                                          const files::CellFile& cell) {
  measurement::Recording r = files::read_recording(path, files::VoltageColumn::required, reading);
  add_rows_before_changes(r, cell);
  return r;
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
                                      .checks = {},
                                      .other_initial_soc = start.contradicted_by};
  diagnosis::average_references(record, r.current_ref_a, r.voltage_ref_v, cell.parameters);
  return {std::move(r), std::move(record), {}, {}, {}, {}};
}

diagnosis::Coverage coverage_of(const files::CellFile& cell, const diagnosis::PreparedRecording& record) {
  return diagnosis::prediction_interval(cell.parameters, cell.mechanisms, record,
                                        diagnosis::predict(cell.parameters, cell.mechanisms, record), cell.healthy)
      .coverage;
}

DiagnoseInput read_diagnose_input(const DiagnoseOptions& options) {
  const std::vector<double>& soc = options.initial_soc;
  const std::size_t recordings = options.recordings.size(), all = recordings + options.holdouts.size();
  if (soc.size() > 1 && soc.size() != recordings && soc.size() != all) {
    throw files::BadInput("--initial-soc", 1,
                          fmt::format("{} values for {} recordings and {} hold-outs, expected one for all recordings, "
                                      "one for each recording, or one for each recording and then for each hold-out",
                                      soc.size(), recordings, options.holdouts.size()));
  }
  const auto given = [&](std::size_t n) -> std::optional<double> {
    if (soc.size() == 1 && n < recordings) return soc.front();
    return n < soc.size() && soc.size() > 1 ? std::optional(soc[n]) : std::nullopt;
  };
  DiagnoseInput input;
  input.cell = options.cell_file ? *options.cell_file : files::read_cell(options.cell);
  for (const std::string& path : options.recordings)
    input.recordings.push_back(read(path, options.reading, given(input.recordings.size()),
                                    "a wrong start is one of the causes that are tested", input));
  for (const std::string& path : options.holdouts) {
    input.holdouts.push_back(read(path, options.reading, given(recordings + input.holdouts.size()),
                                  "the comparison uses it as it is", input));
  }
  refuse_same(input);
  return input;
}

namespace {

/// Units that the file's own numbers contradict: a fault of the data, which no physics explains. Nothing if they
/// agree. Millivolts and milliamperes are found by the diagnosis itself.
std::optional<diagnosis::Diagnosis> wrong_units(const DiagnoseResult& r) {
  for (const RecordingComparison& c : r.recordings) {
    for (const measurement::Warning& w : c.recording.warnings) {
      if (w.id != "pack_voltage" && w.id != "time_in_ms" && w.id != "temperature_in_k") continue;
      diagnosis::Diagnosis d;
      d.cell = r.cell.parameters;
      d.verdict = diagnosis::Verdict::data_fault;
      d.statement = fmt::format("{}. Correct the file, or say it: {}.", diagnosis::capitalised(w.text),
                                measurement::unit_option(w));
      d.faults.push_back({w.id, d.statement, {{c.record.time_s.front(), c.record.time_s.back()}}});
      d.spans = d.faults.front().spans;
      return d;
    }
  }
  return std::nullopt;
}

}  // namespace

DiagnoseResult diagnose_recordings(DiagnoseInput input, const diagnosis::Options& options) {
  const auto begin = std::chrono::steady_clock::now();
  DiagnoseResult r;
  r.cell = std::move(input.cell);
  r.recordings = std::move(input.recordings);
  r.holdouts = std::move(input.holdouts);
  r.warnings = std::move(input.warnings);
  r.notes = std::move(input.notes);
  std::vector<diagnosis::PreparedRecording> records;
  for (const RecordingComparison& c : r.recordings) records.push_back(c.record);
  diagnosis::Options with_healthy = options;
  with_healthy.healthy = r.cell.healthy;
  if (auto fault = wrong_units(r))
    r.diagnosis = std::move(*fault);
  else
    r.diagnosis = diagnosis::diagnose(r.cell.parameters, r.cell.mechanisms, records, with_healthy);
  require_finite(r.diagnosis);
  diagnosis::describe(r.diagnosis, r.cell.parameters, records);
  for (const std::string& text : r.diagnosis.warnings) r.warnings.push_back({"readings", text});
  compare_recordings(r);
  r.baseline = figures(r.recordings, &RecordingComparison::base_v);
  r.extended = figures(r.recordings, &RecordingComparison::extended_v);
  r.extended_cell = extended_cell(r);
  compare_holdouts(r);
  r.baseline_holdout = figures(r.holdouts, &RecordingComparison::base_v);
  r.extended_holdout = figures(r.holdouts, &RecordingComparison::extended_v);
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
                                      diagnosis::experiments_already_done(records, r.cell.parameters.capacity_ah));
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

}  // namespace bms::workflow
