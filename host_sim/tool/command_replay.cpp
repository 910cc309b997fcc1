// bms replay: a recording through the estimator, on the host or on an emulated board.
#include <optional>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "files/text_file.hpp"
#include "images/emulator.hpp"
#include "images/firmware_image.hpp"
#include "measurement/recording_checks.hpp"
#include "replay/can_log.hpp"
#include "replay/capacity_estimate.hpp"
#include "replay/cuts.hpp"
#include "replay/judgement.hpp"
#include "replay/replay.hpp"
#include "replay/simulation.hpp"
#include "reports/json_replay.hpp"
#include "reports/report_page.hpp"
#include "tool/against.hpp"
#include "tool/commands.hpp"
#include "tool/options.hpp"
#include "tool/pack_cells.hpp"
#include "workflow/recording_start.hpp"

namespace bms::tool {

namespace {

struct ReplayOptions {
  std::string recording;
  std::string cell = "table9";
  std::string board_cell;  ///< cell file of the board's image; empty: the same
  std::string target = "host";
  std::string scalar = "float";
  std::optional<double> initial_soc;
  double initial_soc_sigma = 0.02;
  std::optional<std::size_t> run;  ///< of a CAN log, from 1; not given: the last
  bool verify = false;
  std::size_t cuts = 0;  ///< 0: no trials
  std::string trace;
  AgainstOptions against;  ///< without what it shares with a replay
  files::ReadOptions reading;
  Output output;
};

/// A replay under way: what was read, and what has been computed.
struct ReplayRun {
  const images::EmulatedBoard* board = nullptr;  ///< nullptr: the host
  std::optional<replay::CanLog> log;
  replay::Start start;
  std::size_t compared = 0;     ///< samples of the log whose estimates were compared
  std::vector<PackCell> cells;  ///< of a pack recording
  replay::ReplayResult result;
};

replay::ScalarKind scalar_of(const std::string& name) {
  if (name == "fixed") return replay::ScalarKind::fixed;
  if (name == "double") return replay::ScalarKind::float64;
  return replay::ScalarKind::float32;
}

const images::EmulatedBoard& board_named(const std::string& name) {
  std::string names;
  for (const images::EmulatedBoard& board : images::emulated_boards()) {
    if (board.name == name) return board;
    names += ", " + board.name;
  }
  throw files::BadInput(name, 1, "no such target, expected one of: host" + names);
}

replay::Track run_on(const images::EmulatedBoard& board, const files::CellFile& cell,
                     const std::vector<measurement::Sample>& samples,
                     const std::optional<measurement::StartingPoint>& start, replay::ScalarKind scalar) {
  if (scalar != board.scalar) {
    throw files::BadInput(board.name, 1,
                          fmt::format("computes in {}, expected --scalar {}", replay::name_of(board.scalar),
                                      replay::name_of(board.scalar)));
  }
  return images::run_on_board(board, cell, samples, start);
}

/// Ids of the mechanisms that the estimator leaves out. A shift of the initial SOC is not one of them: it moves the
/// prior.
std::string not_estimated(const files::CellFile& cell) {
  std::string ids;
  for (const model::MechanismSetting& m : cell.mechanisms) {
    const model::MechanismInfo& info = model::catalogue[m.index];
    if (!info.on_board && info.domain != model::Domain::start) ids += (ids.empty() ? "" : ", ") + std::string(info.id);
  }
  return ids;
}

std::string duration_text(const replay::CanLog& log) {
  return fmt::format("{:.2f} h", log.recording.duration_s() / 3'600);
}

/// Reads a CAN log and chooses one of its runs.
replay::CanLog read_log(const ReplayOptions& options, replay::ReplayResult& result) {
  std::vector<replay::CanLog> logs = replay::read_can_log(options.recording);
  result.runs = logs.size();
  result.run = options.run.value_or(logs.size());
  if (result.run > logs.size())
    throw files::BadInput(options.recording, 1,
                          fmt::format("no run {} of the firmware, expected --run 1 to {}", result.run, logs.size()));
  std::string durations;
  for (const replay::CanLog& log : logs) durations += (durations.empty() ? "" : ", ") + duration_text(log);
  replay::CanLog chosen = std::move(logs[result.run - 1]);
  if (result.runs > 1) {
    chosen.recording.warnings.insert(
        chosen.recording.warnings.begin(),
        {"several_runs", fmt::format("the firmware was restarted, or its time jumps: the log has {} runs ({}), this is "
                                     "the estimate of run {}; choose another one with --run",
                                     result.runs, durations, result.run)});
  }
  return chosen;
}

void add_warnings(const ReplayOptions& options, ReplayRun& run) {
  std::vector<measurement::Warning>& warnings = run.result.recording.warnings;
  if (const std::string ids = not_estimated(run.result.cell); !ids.empty()) {
    warnings.push_back(
        {"not_in_estimator", ids + ": in the cell file, but the estimator leaves it out (it would need future samples, "
                                   "or the times of the bursts)"});
  }
  if (run.log && run.log->cell_hash && *run.log->cell_hash != run.result.cell.hash) {
    warnings.push_back({"other_cell_file", fmt::format("the firmware that wrote the log has cell file {:08x}, this is "
                                                       "{:08x}",
                                                       *run.log->cell_hash, run.result.cell.hash)});
  }
  for (const measurement::Warning& warning : warnings) warn(options.recording + ": " + warning.text);
}

ReplayRun read(const ReplayOptions& options) {
  ReplayRun run;
  replay::ReplayResult& result = run.result;
  result.scalar = scalar_of(options.scalar);
  result.target = options.target;
  if (options.target != "host") run.board = &board_named(options.target);
  if (!options.board_cell.empty() && run.board == nullptr)
    throw files::BadInput("--board-cell", 1, "no board that uses it, expected --target with a board");
  if (options.verify && run.board == nullptr)
    throw files::BadInput("--verify", 1, "no board to compare the host with, expected --target with a board");
  result.cell = files::read_cell(options.cell);
  const bool foreign = !options.reading.dbc.empty() || !options.reading.format.empty();
  if (!foreign && replay::is_can_log(options.recording))
    run.log = read_log(options, result);
  else if (options.run)
    throw files::BadInput("--run", 1, "the recording is not a CAN log, expected no --run");
  result.recording = run.log
                         ? run.log->recording
                         : files::read_recording(options.recording, files::VoltageColumn::required, options.reading);
  print_read_as(options.output, result.recording);
  measurement::compare_with_cell(result.recording, result.cell.parameters);
  refuse_contradiction(result.recording);
  add_warnings(options, run);
  if (options.initial_soc) {
    result.prior = replay::SocPrior{*options.initial_soc, options.initial_soc_sigma};
    result.initial_soc = *options.initial_soc;
  }
  if (run.log && !options.initial_soc)
    run.start = run.log->start;
  else
    run.start =
        replay::starting_point(result.prior, replay::value_of(result.cell.mechanisms, model::InitialSoc::id, 0));
  return run;
}

/// An impossible estimate is an error, unless the question was whether a board computes the same.
void judge(const ReplayOptions& options, replay::ReplayResult& result) {
  replay::Judgement judgement = replay::judge(result);
  result.doubts = std::move(judgement.doubts);
  if (!judgement.impossible) return;
  if (!result.verified_against && !result.difference)
    throw files::BadInput(options.recording, 1, *judgement.impossible + "; expected a recording of this cell");
  result.doubts.insert(result.doubts.begin(), *judgement.impossible);
}

void compute(const ReplayOptions& options, ReplayRun& run) {
  replay::ReplayResult& result = run.result;
  if (run.board != nullptr && run.start.learned())
    throw files::BadInput(options.recording, 1, "the firmware had learned a capacity, expected --target host");
  if (run.board != nullptr) {
    const files::CellFile board_cell = options.board_cell.empty() ? result.cell : files::read_cell(options.board_cell);
    result.track = run_on(*run.board, board_cell, run.log ? run.log->samples : measurement::samples(result.recording),
                          run.start.soc, result.scalar);
  }
  if (run.board == nullptr || options.verify) {
    const measurement::SampleList samples =
        run.log ? measurement::SampleList(run.log->samples) : measurement::SampleList(result.recording);
    replay::Track host = replay::run_on_host(result.cell, samples, run.start, result.scalar);
    if (run.board == nullptr) {
      result.track = std::move(host);
    } else if (const auto d = replay::first_difference(host, result.track, result.scalar)) {
      const double at_s = d->sample < result.recording.rows() ? result.recording.time_s[d->sample] : 0;
      result.difference =
          fmt::format("host and {} differ first at sample {} (time {:g} s) in {}: host {:.9g}, board {:.9g}",
                      run.board->name, d->sample, at_s, d->field, d->host, d->board);
    } else {
      result.verified_against = run.board->name;
    }
  }
  if (run.log && !options.initial_soc && result.scalar != replay::ScalarKind::float64 && !result.difference) {
    result.difference = replay::difference_to_log(*run.log, result.track, run.compared);
    if (!result.difference && run.compared > 0) result.verified_against = "log";
  }
  if (!run.log)
    result.open_loop_soc = workflow::recording_start(result.recording, result.cell, options.initial_soc).start.soc;
  replay::evaluate(result);
  // a board counts with the capacity that it has
  if (run.board == nullptr && !run.log)
    replay::count_with_estimated_capacity(result, measurement::SampleList(result.recording), run.start.soc);
  judge(options, result);
  if (!result.recording.cell_voltage_v.empty()) run.cells = replay_cells(result, run.start.soc);
}

std::string voltage_text(const replay::VoltageFigures& v) {
  std::string text = v.prediction_rmse_v
                         ? fmt::format("One-step voltage prediction {:.2f} mV RMS", 1e3 * *v.prediction_rmse_v)
                         : std::string("No voltage was compared with its prediction");
  if (v.open_loop_rmse_v && v.open_loop_fit_percent)
    text += fmt::format("; open loop {:.2f} mV RMS, fit {:.1f} %", 1e3 * *v.open_loop_rmse_v, *v.open_loop_fit_percent);
  return text + ".";
}

std::string summary(const replay::ReplayResult& r) {
  return reports::statement(r) + fmt::format("\n{} {:.2f} million steps/s ({}, {}).", voltage_text(r.voltage),
                                             r.track.steps_per_second / 1e6, r.target, replay::name_of(r.scalar));
}

/// Writes the trace, if it is wanted, and returns its SHA-256.
std::string write_trace(const ReplayOptions& options, const replay::ReplayResult& result) {
  files::Sha256 hash;
  const auto produce = [&](const files::Sink& sink) {
    replay::write_trace(result, [&](std::string_view piece) {
      hash.add(piece);
      sink(piece);
    });
  };
  if (options.trace.empty())
    produce([](std::string_view) {});
  else
    write_output(options.trace, produce);
  return hash.hex();
}

/// Returns the exit code.
int write(const ReplayOptions& options, const ReplayRun& run) {
  const replay::ReplayResult& result = run.result;
  const bool needed = !options.trace.empty() || !options.output.json.empty();
  const std::string trace_sha256 = needed ? write_trace(options, result) : std::string();
  if (!options.output.report.empty()) write_output(options.output.report, reports::replay_report(result));
  if (!options.output.json.empty()) {
    const std::string json = reports::json_of(result, trace_sha256);
    write_output(options.output.json, run.cells.empty() ? json : with_cells(json, run.cells));
  }
  if (result.difference) {
    fmt::print(stderr, "{}: {}\n", options.recording, *result.difference);
    return 1;
  }
  print_summary(options.output, summary(result));
  if (!run.cells.empty()) print_summary(options.output, cells_text(run.cells));
  if (result.verified_against) {
    const bool log = run.compared > 0;
    print_summary(options.output,
                  fmt::format("Verified: {} estimates, every bit equal {}.",
                              log ? run.compared : result.track.rows.words().size(),
                              log ? "to what the firmware computed" : "on " + *result.verified_against));
  }
  if (!options.output.report.empty()) print_summary(options.output, "Report: " + options.output.report);
  return 0;
}

/// Returns the exit code.
int run_cut_trials(const ReplayOptions& options) {
  const files::CellFile cell = files::read_cell(options.cell);
  measurement::Recording recording = files::read_recording(options.recording);
  measurement::compare_with_cell(recording, cell.parameters);
  for (const measurement::Warning& warning : recording.warnings) warn(options.recording + ": " + warning.text);
  const replay::CutResult result = replay::run_cuts(cell, recording, options.cuts, scalar_of(options.scalar));
  if (!options.output.json.empty()) write_output(options.output.json, reports::json_of(result));
  std::string text = fmt::format("{} cuts of {}; the estimator starts again at each.\n", result.cuts, result.recording);
  for (const replay::CutFigures& f : result.starts) {
    text += fmt::format(
        "  {}: the median error of the state of charge is {:.2f} % RMS after half an hour, the largest {:.1f} %; "
        "{:.0f} % of the readings lie inside two sigma",
        f.start.title, 100 * f.median_rmse[1], 100 * f.largest[1], 100 * f.inside[1]);
    text += f.start.off > 0 || !f.start.known ? fmt::format("; {:.0f} % recover in time.\n", 100 * f.recovered) : ".\n";
  }
  print_summary(options.output, text + "More figures: --json FILE.");
  return 0;
}

class ReplayCommand final : public Command {
 public:
  explicit ReplayCommand(RunAgainst run_against) : run_against_(run_against) {}

  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand(
        "replay", "Run the state-of-charge estimator over a recording, on this computer or on an emulated board");
    c.footer(
        "Example: bms replay evidence/recordings/forklift_shift.csv --target netduinoplus2 --verify --report "
        "shift.html");
    c.add_option("recording", o_.recording,
                 "CSV file with time_s, current_a (> 0 charges), voltage_v and optionally temperature_c, soc_ref; or a "
                 "candump log of the firmware's frames, whose estimates are compared with the replay")
        ->required();
    c.add_option("--cell", o_.cell, cell_help())->capture_default_str();
    c.add_option("--initial-soc", o_.initial_soc,
                 "state of charge at the start, 0..1; estimated from the first voltage if not given")
        ->check(Within(0.0, 1.0));
    c.add_option("--initial-soc-sigma", o_.initial_soc_sigma, "standard deviation of --initial-soc")
        ->check(Within(1e-4, 1.0))
        ->capture_default_str();
    c.add_option("--run", o_.run,
                 "of a CAN log with several runs of the firmware: which one, from 1; the last if not given")
        ->check(CLI::PositiveNumber)
        ->type_name("N");
    c.add_option("--target", o_.target, "host, or an emulated board by its folder in boards/: netduinoplus2, microbit")
        ->capture_default_str();
    c.add_option("--scalar", o_.scalar, "arithmetic: float, fixed or double")
        ->check(CLI::IsMember({"float", "fixed", "double"}))
        ->capture_default_str();
    c.get_option("--initial-soc-sigma")->needs("--initial-soc");
    c.add_flag("--verify", o_.verify,
               "compute on host and board and compare every estimate bit by bit; exit code 1 if they differ");
    c.add_option("--board-cell", o_.board_cell,
                 "cell file for the board's firmware if it is not --cell; shows that --verify finds the difference")
        ->type_name("CELL");
    auto& cuts = *c.add_option("--cuts", o_.cuts,
                               "start at N places of a CSV file with soc_ref, each right, 20 and 30 % wrong, wrong and "
                               "confident, and unknown; print how fast and how honestly the estimate recovers")
                      ->check(CLI::Range(std::size_t{1}, std::size_t{1'000}))
                      ->type_name("N");
    for (const char* other : {"--initial-soc", "--run", "--target", "--verify", "--board-cell"}) cuts.excludes(other);
    CLI::Option& trace = *c.add_option("--trace", o_.trace, "write every estimate to a CSV file")->type_name("FILE");
    add_against(c, {"--run", "--target", "--scalar", "--verify", "--board-cell", "--cuts", "--initial-soc"})
        .excludes(&trace);
    add_reading(c, o_.reading);
    add_output(c, o_.output);
    for (const char* other : {"--trace", "--report"}) cuts.excludes(other);
    return &c;
  }

  int run() override {
    complete_reading(o_.reading);
    o_.output.set_own(o_.trace);
    o_.output.protect({o_.recording, o_.cell, o_.board_cell, o_.against.new_cell});
    if (!o_.against.firmware.empty()) return run_against_(against());
    if (o_.cuts > 0) return run_cut_trials(o_);
    ReplayRun run = read(o_);
    compute(o_, run);
    return write(o_, run);
  }

 private:
  /// others: options of a replay by one firmware.
  CLI::Option& add_against(CLI::App& c, const std::vector<const char*>& others) {
    AgainstOptions& a = o_.against;
    CLI::Option& against = *c.add_option("--against", a.firmware,
                                         "run the whole firmware of this image (*_hil.elf), checkout or commit over "
                                         "the log, and the present one; exit code 1 if what they publish differs")
                                ->check(not_empty())
                                ->type_name("FIRMWARE");
    for (const char* other : others) against.excludes(c.get_option(other));
    c.add_option("--base", a.base, "with --against: the firmware to compare with, if it is not the one of this tool")
        ->needs(&against)
        ->type_name("FIRMWARE");
    c.add_option("--against-cell", a.new_cell, "with --against: its cell file, if it is not --cell")
        ->needs(&against)
        ->type_name("CELL");
    c.add_option("--board", a.board, "with --against: folder in boards/")->needs(&against)->capture_default_str();
    c.add_option("--sample-s", a.sample_period_s, "with --against: sampling interval of the board in s")
        ->needs(&against)
        ->check(Within(0.01, 10.0))
        ->capture_default_str();
    return against;
  }

  AgainstOptions against() const {
    AgainstOptions a = o_.against;
    a.recording = o_.recording;
    a.cell = o_.cell;
    a.reading = o_.reading;
    a.output = o_.output;
    return a;
  }

  RunAgainst run_against_;
  ReplayOptions o_;
};

}  // namespace

std::unique_ptr<Command> replay_command(RunAgainst against) { return std::make_unique<ReplayCommand>(against); }

}  // namespace bms::tool
