// bms simulate: the model's voltage for the current of a recording or a profile, open loop.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <optional>

#include <fmt/format.h>

#include "diagnosis/prediction_interval.hpp"
#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/recording.hpp"
#include "measurement/recording_checks.hpp"
#include "replay/gaussian_noise.hpp"
#include "replay/processor_time.hpp"
#include "replay/simulation.hpp"
#include "replay/simulation_result.hpp"
#include "reports/json_cell.hpp"
#include "reports/report_page.hpp"
#include "tool/commands.hpp"
#include "tool/options.hpp"
#include "tool/pack_cells.hpp"
#include "tool/recording_part.hpp"
#include "workflow/diagnose_recordings.hpp"

namespace bms::tool {

namespace {

struct SimulateOptions {
  std::string cell;
  std::string recording, profile;  ///< one of the two
  std::vector<std::string> with;   ///< "ID:param=value,...": mechanisms to add, or to use instead of the cell's own
  double initial_soc = 0.5;
  CLI::Option* initial_soc_given = nullptr;
  double noise_v = 0, noise_a = 0;  ///< standard deviations
  unsigned long seed = 1;
  bool interval = false;
  std::string out;
  files::ReadOptions reading;
  RecordingPart part;
  Output output;

  const std::string& input() const { return recording.empty() ? profile : recording; }
};

/// What was read, and what has been computed.
struct SimulationRun {
  files::CellFile cell;
  measurement::Recording recording;
  std::vector<replay::SimulatedRow> rows;
  std::vector<SimulatedCell> cells;                            ///< of a pack recording
  std::optional<diagnosis::PredictionInterval> interval = {};  ///< with --interval
  replay::SimulationResult result;
};

[[noreturn]] void refuse_mechanism(const std::string& what) { throw files::BadInput("--with", 1, what); }

/// Sets one parameter from "param=value".
void set_parameter(const model::MechanismInfo& info, const std::string& text, model::MechanismSetting& setting) {
  const std::size_t equals = std::min(text.find('='), text.size());
  const std::string name = text.substr(0, equals);
  std::size_t k = 0;
  while (k < info.parameters && info.parameter[k].name != name) ++k;
  if (k == info.parameters) {
    std::string names;
    for (std::size_t i = 0; i < info.parameters; ++i)
      names += (i == 0 ? "" : ", ") + std::string(info.parameter[i].name);
    refuse_mechanism("no such parameter '" + name + "' of " + std::string(info.id) + ", expected one of: " + names);
  }
  const char *first = text.data() + std::min(equals + 1, text.size()), *last = text.data() + text.size();
  const auto [stopped, error] = std::from_chars(first, last, setting.value[k]);
  if (first == last || stopped != last || error != std::errc{})
    refuse_mechanism("no value of '" + name + "', expected " + name + "=NUMBER");
}

/// "ID:param=value,..." as a cell file would have it; parameters that are not named keep their defaults.
model::MechanismSetting mechanism_of(const std::string& text, const model::CellParameters<>& cell) {
  const double capacity_ah = cell.capacity_ah;
  const std::size_t colon = text.find(':');
  const std::string id = text.substr(0, colon);
  const std::size_t index = model::mechanism_index(id);
  if (index == model::mechanism_count) {
    std::string ids;
    for (const model::MechanismInfo& info : model::catalogue) ids += (ids.empty() ? "" : ", ") + std::string(info.id);
    refuse_mechanism("no such mechanism '" + id + "', expected one of: " + ids);
  }
  if (colon == std::string::npos) refuse_mechanism("'" + id + "' without parameters, expected ID:param=value,...");
  const model::MechanismInfo& info = model::catalogue[index];
  model::MechanismSetting setting = model::default_setting(index, cell);
  for (std::size_t at = colon; at < text.size();) {
    const std::size_t end = std::min(text.find(',', at + 1), text.size());
    set_parameter(info, text.substr(at + 1, end - at - 1), setting);
    at = end;
  }
  if (const std::size_t k = model::first_fault(setting, capacity_ah); k < info.parameters) {
    refuse_mechanism(fmt::format("'{}' is out of range, expected {}", info.parameter[k].name,
                                 files::range_of(info.parameter[k], capacity_ah)));
  }
  return setting;
}

bool bursts_unknown(const files::CellFile& file) {
  return std::any_of(file.mechanisms.begin(), file.mechanisms.end(),
                     [](const auto& m) { return model::catalogue[m.index].id == model::ContactIntermittent::id; });
}

SimulationRun read(const SimulateOptions& options) {
  if (options.recording.empty() == options.profile.empty())
    throw files::BadInput("bms simulate", 1, "one input needed, expected --recording or --profile");
  SimulationRun run;
  run.cell = files::read_cell(options.cell);
  for (const std::string& mechanism : options.with)
    files::put_mechanism(run.cell, mechanism_of(mechanism, run.cell.parameters));
  run.recording = files::read_recording(
      options.input(), options.recording.empty() ? files::VoltageColumn::optional : files::VoltageColumn::required,
      options.reading);
  print_read_as(options.output, run.recording);
  cut(options.part, run.recording);
  measurement::compare_with_cell(run.recording, run.cell.parameters);
  refuse_contradiction(run.recording);
  if (options.interval && !run.recording.cell_voltage_v.empty())
    throw files::BadInput(
        "--interval", 1,
        "not for the recording of a pack, expected that of one cell; --map voltage_v=v_1 reads a cell");
  if (bursts_unknown(run.cell)) {
    run.recording.warnings.push_back(
        {"bursts_unknown", "contact_intermittent has no effect: a cell file does not contain the times of its bursts"});
  }
  for (const measurement::Warning& warning : run.recording.warnings) warn(options.input() + ": " + warning.text);
  return run;
}

/// Throws BadInput with the likely cause if the state of charge leaves the cell.
void check_range(const SimulateOptions& options, const SimulationRun& run) {
  const auto outside = std::find_if(run.rows.begin(), run.rows.end(), [](const replay::SimulatedRow& row) {
    return !(row.soc > model::min_soc && row.soc < model::max_soc);  // the simulation holds it there
  });
  if (outside == run.rows.end()) return;
  const auto k = static_cast<std::size_t>(outside - run.rows.begin());
  std::string cause = "the current, the initial state of charge or the capacity of the cell is wrong";
  for (const measurement::Warning& w : run.recording.warnings) {
    if (w.id == "time_in_ms" || w.id == "current_in_ma" || w.id == "charge_exceeds_capacity") cause = w.text;
  }
  throw files::BadInput(
      options.input(), 1,
      fmt::format("the state of charge leaves {:g} to {:g} % after {:g} s; likely cause: {}; expected "
                  "a current that the cell can deliver",
                  100 * model::min_soc, 100 * model::max_soc, run.recording.time_s[k] - run.recording.time_s.front(),
                  cause));
}

void compute(const SimulateOptions& options, SimulationRun& run) {
  const auto cell = model::prepare<double, model::max_intervals>(run.cell.parameters);
  const double begin_s = replay::processor_time_s();
  run.rows = replay::simulate({.cell = cell,
                               .capacity_ah = run.cell.parameters.capacity_ah,
                               .mechanisms = run.cell.mechanisms,
                               .time_s = run.recording.time_s,
                               .current_a = run.recording.current_a,
                               .temperature_c = run.recording.temperature_c,
                               .initial_soc = options.initial_soc});
  const double seconds = replay::processor_time_s() - begin_s;
  check_range(options, run);
  run.cells = simulate_cells(run.cell, run.recording);
  run.result = {.cell = run.cell.name,
                .input = options.input(),
                .out = options.out,
                .read_as = run.recording.read_as,
                .samples = run.rows.size(),
                .duration_s = run.recording.duration_s(),
                .initial_soc = options.initial_soc,
                .final_soc = run.rows.back().soc,
                .final_voltage_v = run.rows.back().voltage_v,
                .steps_per_second = static_cast<double>(run.rows.size()) / seconds,
                .warnings = run.recording.warnings};
}

/// The interval of the voltage from a start that is known to the tolerance of the cell file.
void add_interval(const SimulateOptions& options, SimulationRun& run) {
  const measurement::Recording& r = run.recording;
  const workflow::StartSoc start = workflow::given_start(run.cell, options.initial_soc);
  const bool measured = !r.voltage_v.empty();
  diagnosis::PreparedRecording record{.name = options.input(),
                                      .time_s = r.time_s,
                                      .current_a = r.current_a,
                                      .voltage_v = measured ? r.voltage_v : std::vector(r.rows(), std::nan("")),
                                      .temperature_c = r.temperature_c,
                                      .initial_soc = start.soc,
                                      .initial_soc_sigma = start.sigma};
  std::vector<double> voltage_v;
  for (const replay::SimulatedRow& row : run.rows) voltage_v.push_back(row.voltage_v);
  run.interval =
      diagnosis::prediction_interval(run.cell.parameters, run.cell.mechanisms, record, voltage_v, run.cell.healthy);
}

std::string csv_of(const SimulateOptions& options, const SimulationRun& run) {
  const measurement::Recording& r = run.recording;
  replay::GaussianNoise noise(options.seed);
  const bool temperature = !r.temperature_c.empty();  // a replay needs it, because mechanisms depend on it
  std::string csv = "time_s,current_a,voltage_v,soc";
  if (temperature) csv += ",temperature_c";
  for (const SimulatedCell& cell : run.cells) fmt::format_to(std::back_inserter(csv), ",v_{}", cell.number);
  if (run.interval) csv += ",voltage_std_v";
  csv += ",soc_ref\n";
  csv.reserve(run.rows.size() * 48);
  const auto reading = [](double value) { return std::isfinite(value) ? fmt::format("{}", value) : ""; };
  for (std::size_t k = 0; k < run.rows.size(); ++k) {
    const double current_a = r.current_a[k] + options.noise_a * noise.next();
    const double voltage_v = run.rows[k].voltage_v + options.noise_v * noise.next();
    // ten digits: far below a microvolt and a microampere
    fmt::format_to(std::back_inserter(csv), "{},{:.10g},{:.10g},{:.10g}", r.time_s[k], current_a, voltage_v,
                   run.rows[k].soc);
    if (temperature) fmt::format_to(std::back_inserter(csv), ",{}", reading(r.temperature_c[k]));
    for (const SimulatedCell& cell : run.cells)
      fmt::format_to(std::back_inserter(csv), ",{:.10g}", cell.voltage_v[k] + options.noise_v * noise.next());
    if (run.interval) fmt::format_to(std::back_inserter(csv), ",{:.4g}", run.interval->sigma_v[k]);
    // a mechanism or a start may lead further beyond full: no command accepts that as a reference
    const double soc = run.rows[k].soc;
    csv += soc <= files::largest_soc_ref ? fmt::format(",{:.10g}\n", soc) : ",\n";
  }
  return csv;
}

files::PageContent page_content(const SimulationRun& run) {
  const measurement::Recording& r = run.recording;
  files::PageChart voltage{"Voltage, open loop", {"simulated, V"}, r.time_s.copy(), {{}}};
  files::PageChart current{"Current, > 0 charges", {"measured, A"}, r.time_s.copy(), {r.current_a.copy()}};
  files::PageChart soc{"State of charge", {"simulated, %"}, r.time_s.copy(), {{}}};
  if (!r.voltage_v.empty()) {
    voltage.labels.push_back("measured, V");
    voltage.columns.push_back(r.voltage_v.copy());
  }
  for (const replay::SimulatedRow& row : run.rows) {
    voltage.columns[0].push_back(row.voltage_v);
    soc.columns[0].push_back(100 * row.soc);
  }
  if (run.interval) {
    voltage.labels[0] = "simulated with its 95 % interval, V";
    voltage.half_band.resize(voltage.columns.size());
    for (const double v : run.interval->sigma_v) voltage.half_band[0].push_back(diagnosis::half_width_sigmas * v);
  }
  return {"Simulation of " + run.result.input.substr(run.result.input.rfind('/') + 1),
          "Cell " + run.result.cell + ", open loop.",
          {},
          {},
          {voltage, current, soc}};
}

/// Of the measured voltage; nothing without one or without --interval.
std::optional<diagnosis::Coverage> coverage_of(const SimulationRun& run) {
  if (!run.interval || run.interval->coverage.readings() == 0) return std::nullopt;
  return run.interval->coverage;
}

void write(const SimulateOptions& options, const SimulationRun& run) {
  write_output(options.out, csv_of(options, run));
  const std::optional<diagnosis::Coverage> coverage = coverage_of(run);
  if (!options.output.json.empty()) {
    const std::string json = reports::json_of(run.result, coverage);
    write_output(options.output.json, run.cells.empty() ? json : with_cells(json, run.cells));
  }
  if (!options.output.report.empty()) write_output(options.output.report, reports::page_of(page_content(run)));
  if (options.out == "-") return;
  print_summary(options.output, fmt::format("{} rows in {}: from {:.1f} % to {:.1f} % state of charge in {:.2f} h.",
                                            run.rows.size(), options.out, 100 * options.initial_soc,
                                            100 * run.result.final_soc, run.result.duration_s / 3'600));
  if (!run.cells.empty()) print_summary(options.output, cells_text(run.cells));
  if (coverage)
    print_summary(options.output,
                  diagnosis::sentence_of(*coverage, options.input().substr(options.input().rfind('/') + 1)));
}

class SimulateCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand("simulate", "Compute the model's voltage for a given current, open loop");
    c.footer("Example: bms simulate --cell table9 --profile shift.csv --initial-soc 0.9 --out simulated.csv");
    c.add_option("--cell", o_.cell, cell_help())->required();
    auto* recording = c.add_option("--recording", o_.recording, "recording whose current is used")->type_name("FILE");
    c.add_option("--profile", o_.profile, "current profile: a recording without voltage_v")
        ->type_name("FILE")
        ->excludes(recording);
    o_.initial_soc_given =
        c.add_option("--initial-soc", o_.initial_soc,
                     "state of charge at the start, 0..1; if not given the first value of soc_ref, or else an "
                     "estimate from the first voltage, or else 0.5")
            ->check(Within(0.0, 1.0));
    c.add_option("--with", o_.with,
                 "mechanism to add, or to use instead of the cell's own, for example "
                 "ocv_hysteresis:half_gap_v=0.01,decay=40; may be repeated")
        ->type_name("ID:param=value,...")
        ->expected(1)
        ->take_all();
    c.add_option("--noise-v", o_.noise_v, "standard deviation in V of noise added to the voltage")
        ->check(Within(0.0, 1e6));
    c.add_option("--noise-a", o_.noise_a, "standard deviation in A of noise added to the current in the output")
        ->check(Within(0.0, 1e6));
    c.add_option("--seed", o_.seed, "seed of the noise")->capture_default_str();
    c.add_flag("--interval", o_.interval,
               "add the column voltage_std_v, the standard deviation of a healthy cell's reading around the simulated "
               "voltage: 1.96 times it contains 95 % of the readings; not for the recording of a pack");
    c.add_option(
         "--out", o_.out,
         "CSV file to write: time_s, current_a, voltage_v, soc, and soc_ref with the same values, which the other "
         "commands read; of a pack also v_1 to v_N")
        ->required()
        ->type_name("FILE");
    add_part(c, o_.part);
    add_reading(c, o_.reading);
    add_output(c, o_.output);
    return &c;
  }

  int run() override {
    complete_reading(o_.reading);
    o_.output.set_own(o_.out);
    o_.output.protect({o_.cell, o_.input()});
    SimulationRun run = read(o_);
    if (o_.initial_soc_given->count() == 0) {
      const workflow::RecordingStart found = workflow::recording_start(run.recording, run.cell);
      o_.initial_soc = found.start.soc;
      if (!found.origin.empty()) print_note(o_.output, o_.input() + ": " + found.origin);
    }
    compute(o_, run);
    if (o_.interval) add_interval(o_, run);
    write(o_, run);
    return 0;
  }

 private:
  SimulateOptions o_;
};

}  // namespace

std::unique_ptr<Command> simulate_command() { return std::make_unique<SimulateCommand>(); }

}  // namespace bms::tool
