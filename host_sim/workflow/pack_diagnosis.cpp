#include "workflow/pack_diagnosis.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <fmt/format.h>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/pack/current_sign.hpp"
#include "diagnosis/pack/pack_texts.hpp"
#include "diagnosis/pack/pack_thresholds.hpp"
#include "diagnosis/quantity_text.hpp"
#include "diagnosis/texts.hpp"
#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "measurement/recording_checks.hpp"
#include "measurement/silent_current.hpp"
#include "measurement/soc_column_text.hpp"
#include "measurement/statistics.hpp"
#include "replay/replay.hpp"
#include "workflow/diagnose_recordings.hpp"
#include "workflow/finite_answer.hpp"

namespace bms::workflow {

namespace {

namespace dp = diagnosis::pack;

constexpr std::size_t least_cells = 3;
constexpr double car_soc_sigma = 0.03;    // of a soc_ref: that of a vehicle is seldom better
constexpr double given_soc_sigma = 0.02;  // of --initial-soc
constexpr double longest_step_s = 10;     // between rows, for what all cells share: R1 C1 must be visible
constexpr double longest_hours = 24;
constexpr double several_cells = 1.5;  // a voltage this many times that of a cell is that of the pack
constexpr double cells_end = 0.7;      // share of the progress

/// Row by row.
std::vector<double> median_cell_v(const measurement::Recording& r) {
  std::vector<double> values, median;
  for (std::size_t k = 0; k < r.rows(); ++k) {
    values.clear();
    for (const measurement::Column& c : r.cell_voltage_v) values.push_back(c[k]);
    median.push_back(measurement::median(values));
  }
  return median;
}

std::vector<double> mean_of(const std::vector<std::vector<double>>& columns, const std::vector<std::size_t>& which) {
  std::vector<double> mean(columns.front().size());
  for (std::size_t k = 0; k < mean.size(); ++k) {
    double sum = 0, count = 0;
    for (const std::size_t c : which) {
      if (!std::isfinite(columns[c][k])) continue;
      sum += columns[c][k];
      ++count;
    }
    mean[k] = count > 0 ? sum / count : std::nan("");
  }
  return mean;
}

measurement::Recording one_cell(const measurement::Recording& r, std::vector<double> voltage_v) {
  measurement::Recording one;
  one.path = r.path;
  one.time_s = r.time_s;
  one.current_a = r.current_a;
  one.temperature_c = r.temperature_c;
  one.voltage_v = std::move(voltage_v);
  return one;
}

std::optional<replay::SocPrior> start_of(const measurement::Recording& r, const std::optional<double>& given) {
  if (given) return replay::SocPrior{*given, given_soc_sigma};
  if (!r.soc_ref.empty() && r.soc_ref.front() >= 0 && r.soc_ref.front() <= 1)
    return replay::SocPrior{r.soc_ref.front(), car_soc_sigma};
  return std::nullopt;
}

/// A sensor that reads 0 under load: the filter does without these rows, and the count does not test the sensor.
std::optional<dp::PackFinding> silent_current(measurement::Recording& r, std::string& charge_unknown) {
  const std::vector<measurement::SilentCurrent> silent = measurement::silent_currents(r);
  if (silent.empty()) return std::nullopt;
  dp::PackFinding f;
  f.cause = dp::Cause::current_silent;
  f.probability = 1;
  std::vector<double> current_a = r.current_a.copy();
  for (const measurement::SilentCurrent& s : silent) {
    f.value += s.to_s - s.from_s;
    std::fill(current_a.begin() + static_cast<std::ptrdiff_t>(s.rows.begin),
              current_a.begin() + static_cast<std::ptrdiff_t>(s.rows.end), std::nan(""));
  }
  r.current_a = std::move(current_a);
  f.because = diagnosis::capitalised(measurement::silent_current_text(silent, r.time_s.front())) + ".";
  charge_unknown = "the current reads exactly 0 under load, and the charge of that time is not counted";
  return f;
}

/// Turns a reversed current, so that the rest of the diagnosis is possible.
std::optional<dp::PackFinding> turn_current(measurement::Recording& r, const files::CellFile& cell) {
  std::vector<std::vector<double>> cell_v;
  for (const measurement::Column& c : r.cell_voltage_v) cell_v.push_back(c.copy());
  std::vector<double> current_a = r.current_a.copy();
  const double quiet_a = dp::limits.channels.step_c * cell.parameters.capacity_ah;
  std::optional<dp::PackFinding> found = dp::reversed_current(current_a, cell_v, quiet_a);
  if (!found) return found;
  for (double& a : current_a) a = -a;
  r.current_a = std::move(current_a);
  return found;
}

dp::PackRecording pack_of(const measurement::Recording& r, const files::CellFile& cell,
                          const std::optional<double>& initial_soc) {
  dp::PackRecording pack{.time_s = r.time_s.copy(),
                         .current_a = r.current_a.copy(),
                         .soc = {},
                         .cell_v = {},
                         .sensor_c = {},
                         .pack_v = r.pack_voltage_v.copy(),
                         .single_readings = false,
                         .count_walk = 0,
                         .usual_step_s = 0,
                         .charge_unknown = {}};
  for (const measurement::Column& c : r.cell_voltage_v) pack.cell_v.push_back(c.copy());
  for (const measurement::Column& c : r.cell_temperature_c) pack.sensor_c.push_back(c.copy());
  const measurement::Recording median = one_cell(r, median_cell_v(r));
  const auto track =
      replay::run_on_host(cell, measurement::samples(median), replay::starting_point(start_of(r, initial_soc)),
                          replay::ScalarKind::float64, replay::Timing::none);
  for (const replay::EstimateRow& row : track.rows) pack.soc.push_back(row.soc);
  return pack;
}

bool is_of_the_current_sensor(std::string_view id) { return id.starts_with("current_"); }

/// Why the mean of the cells is not diagnosed; empty if it is.
std::string not_shared(const PackResult& r) {
  if (2 * r.diagnosis.channels.repeated().size() > r.diagnosis.cells)
    return "Not tested: most readings are repeated, so that the mean of the cells has no defined time.";
  if (!r.pack.charge_unknown.empty()) return "Not tested: " + r.pack.charge_unknown + ".";
  if (r.diagnosis.another_cell)
    return "Not tested: the open-circuit voltage of these cells is not that of the cell file, which is of another "
           "cell.";
  if (measurement::usual_step_s(r.recording) > longest_step_s)
    return fmt::format("Not tested: rows are more than {:.0f} s apart.", longest_step_s);
  if (r.diagnosis.duration_s > longest_hours * 3'600)
    return fmt::format("Not tested: the recording is longer than {:.0f} h. Diagnose a part of it.", longest_hours);
  return "";
}

void add_shared(PackResult& r, const std::optional<double>& initial_soc, const Progress& progress) {
  const measurement::Recording mean = one_cell(r.recording, mean_of(r.pack.cell_v, r.diagnosis.reference));
  StartSoc start = workflow::start_of(mean, r.cell);
  if (initial_soc)
    start = given_start(r.cell, *initial_soc);
  else if (!r.recording.soc_ref.empty())
    start = {r.recording.soc_ref.front(), car_soc_sigma, false};
  const RecordingComparison c = prepared(mean, "mean of the cells", r.cell, start);
  diagnosis::Options options;
  options.healthy = r.cell.healthy;
  options.progress = [&](double done, const std::string& what) {
    if (progress) progress(cells_end + (1 - cells_end) * done, what);
  };
  diagnosis::Diagnosis d = diagnosis::diagnose(r.cell.parameters, r.cell.mechanisms, {c.record}, options);
  require_finite(d);
  diagnosis::describe(d, r.cell.parameters, {c.record});
  r.shared = fmt::format("{}: {}", diagnosis::name_of(d.verdict), d.statement);
  const auto of_current = [](const dp::PackFinding& f) {
    return f.cause == dp::Cause::current_offset || f.cause == dp::Cause::current_gain;
  };
  const bool known = std::any_of(r.diagnosis.findings.begin(), r.diagnosis.findings.end(), of_current);
  if (known || !diagnosis::names(d.verdict)) return;
  for (const diagnosis::Finding& f : d.findings) {
    const model::MechanismInfo& info = model::catalogue[f.setting.index];
    if (!is_of_the_current_sensor(info.id)) continue;
    dp::PackFinding shared;
    shared.cause = dp::Cause::shared;
    shared.id = info.id;
    shared.value = f.setting.value[0];
    shared.sigma = f.setting.deviation[0];
    shared.probability = f.probability;
    shared.gain = f.gain;
    shared.because = d.statement;
    r.diagnosis.findings.push_back(std::move(shared));
  }
}

}  // namespace

measurement::Recording read_pack(const std::string& path, const files::ReadOptions& reading) {
  measurement::Recording r = files::read_recording(path, files::VoltageColumn::optional, reading);
  if (r.cell_voltage_v.size() < least_cells)
    throw files::BadInput(path, 1,
                          fmt::format("{} columns of cell voltages, expected v_1 to v_N of {} cells or more",
                                      r.cell_voltage_v.size(), least_cells));
  const double cell_v = measurement::median(median_cell_v(r));
  if (r.pack_voltage_v.empty() && !r.voltage_v.empty() &&
      measurement::median(r.voltage_v.copy()) > several_cells * cell_v) {
    r.pack_voltage_v = r.voltage_v;
    r.voltage_v = median_cell_v(r);
  }
  return r;
}

PackResult diagnose_pack(const files::CellFile& cell, measurement::Recording recording, const PackOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  PackResult r;
  r.cell = cell;
  r.recording = std::move(recording);
  r.warnings = r.recording.warnings;
  const std::optional<dp::PackFinding> reversed = turn_current(r.recording, cell);
  r.soc_column = measurement::own_soc_column(r.recording, cell.parameters.capacity_ah);  // counts the turned current
  measurement::warn_of_soc_column(r.soc_column, r.recording, cell.parameters.capacity_ah, "", r.warnings);
  std::string charge_unknown;
  const std::optional<dp::PackFinding> silent = silent_current(r.recording, charge_unknown);
  r.pack = pack_of(r.recording, cell, options.initial_soc);
  r.pack.charge_unknown = charge_unknown;
  dp::PackOptions of_cells;
  of_cells.progress = [&](double done, const std::string& what) {
    if (options.progress) options.progress(cells_end * done, what);
  };
  r.diagnosis = dp::diagnose_pack(cell.parameters, r.pack, of_cells);
  require_finite(r.diagnosis);
  if (r.pack.single_readings)
    r.warnings.push_back({"single_readings",
                          "the current of a row is taken for a single reading, not for the mean of the row: what it "
                          "did between two rows is an error of the counted charge"});
  for (std::size_t c = 0; c < r.diagnosis.channels.cells.size(); ++c) {
    const std::size_t count = r.diagnosis.channels.cells[c].glitches;
    if (count > 0)
      r.warnings.push_back({"impossible_readings", fmt::format("cell {}: {} readings differ from those around them "
                                                               "by more than a cell can change; they are left out",
                                                               c + 1, count)});
  }
  for (const auto& of_sensor : {reversed, silent}) {
    if (of_sensor) r.diagnosis.findings.push_back(*of_sensor);
  }
  r.shared = options.shared ? not_shared(r) : "Not tested: not wanted.";
  if (r.shared.empty()) add_shared(r, options.initial_soc, options.progress);
  dp::conclude(r.diagnosis);
  r.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return r;
}

PackResult diagnose_pack(const PackOptions& options) {
  const files::CellFile cell = files::read_cell(options.cell);
  return diagnose_pack(cell, read_pack(options.recording, options.reading), options);
}

}  // namespace bms::workflow
