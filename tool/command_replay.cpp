#include "tool/command_replay.hpp"

#include <cstdio>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "files/text_file.hpp"
#include "host_sim/can_log.hpp"
#include "host_sim/simulation.hpp"
#include "images/emulator.hpp"
#include "images/firmware_image.hpp"
#include "measurement/recording_checks.hpp"
#include "reports/json_results.hpp"
#include "reports/report_page.hpp"

namespace bms::tool {

namespace {

host_sim::ScalarKind scalar_of(const std::string& name) {
  if (name == "fixed") return host_sim::ScalarKind::fixed;
  if (name == "double") return host_sim::ScalarKind::float64;
  return host_sim::ScalarKind::float32;
}

const images::EmulatedBoard& board_named(const std::string& name) {
  std::string names;
  for (const images::EmulatedBoard& board : images::emulated_boards()) {
    if (board.name == name) return board;
    names += ", " + board.name;
  }
  throw files::BadInput(name, 1, "no such target, expected one of: host" + names);
}

host_sim::Track run_on(const images::EmulatedBoard& board, const files::CellFile& cell,
                       const std::vector<measurement::Sample>& samples,
                       const std::optional<measurement::StartingPoint>& start, host_sim::ScalarKind scalar) {
  if (scalar != board.scalar) {
    throw files::BadInput(board.name, 1,
                          fmt::format("computes in {}, expected --scalar {}", host_sim::name_of(board.scalar),
                                      host_sim::name_of(board.scalar)));
  }
  return images::run_on_board(board, cell, samples, start);
}

/// Mechanisms that do not act in the estimator; a shift of the start does, through what it is told.
std::string not_estimated(const files::CellFile& cell) {
  std::string ids;
  for (const model::MechanismSetting& m : cell.mechanisms) {
    const model::MechanismInfo& info = model::catalogue[m.index];
    if (!info.on_board && info.domain != model::Domain::start) ids += (ids.empty() ? "" : ", ") + std::string(info.id);
  }
  return ids;
}

std::string summary(const host_sim::ReplayResult& r) {
  std::string text = reports::statement(r);
  text += fmt::format(
      "\nOne-step voltage prediction {:.2f} mV RMS; open loop {:.2f} mV RMS, fit {:.1f} %. {:.2f} million steps/s ({}, "
      "{}).",
      1e3 * r.voltage.prediction_rmse_v.value_or(0), 1e3 * r.voltage.open_loop_rmse_v.value_or(0),
      r.voltage.open_loop_fit_percent.value_or(0), r.track.steps_per_second / 1e6, r.target,
      host_sim::name_of(r.scalar));
  return text;
}

}  // namespace

int run(const ReplayOptions& options) {
  host_sim::ReplayResult result;
  result.scalar = scalar_of(options.scalar);
  result.target = options.target;
  const images::EmulatedBoard* board = options.target == "host" ? nullptr : &board_named(options.target);
  if (!options.board_cell.empty() && board == nullptr)
    throw files::BadInput("--board-cell", 1, "no board to flash it to, expected --target with a board");
  if (options.verify && board == nullptr)
    throw files::BadInput("--verify", 1, "nothing to compare the host with, expected --target with a board");
  result.cell = files::read_cell(options.cell);
  std::optional<host_sim::CanLog> log;
  if (host_sim::is_can_log(options.recording)) log = host_sim::read_can_log(options.recording);
  result.recording = log ? log->recording : files::read_recording(options.recording);
  measurement::compare_with_cell(result.recording, result.cell.parameters);
  if (const std::string ids = not_estimated(result.cell); !ids.empty()) {
    result.recording.warnings.push_back(
        {"not_in_estimator",
         ids + ": in the cell file, but the estimator does without (it sees no readings to come and no bursts)"});
  }
  for (const measurement::Warning& warning : result.recording.warnings) warn(options.recording + ": " + warning.text);

  if (log && log->cell_hash && *log->cell_hash != result.cell.hash) {
    result.recording.warnings.push_back(
        {"other_cell_file", fmt::format("the firmware that wrote the log has cell file {:08x}, this is {:08x}",
                                        *log->cell_hash, result.cell.hash)});
    warn(options.recording + ": " + result.recording.warnings.back().text);
  }
  const auto samples = log ? log->samples : bms::measurement::samples(result.recording);
  if (options.initial_soc) {
    result.prior = host_sim::SocPrior{*options.initial_soc, options.initial_soc_sigma};
    result.initial_soc = *options.initial_soc;
  }
  const auto start = log && !options.initial_soc
                         ? log->start
                         : host_sim::starting_point(
                               result.prior, host_sim::value_of(result.cell.mechanisms, model::InitialSoc::id, 0));

  if (board != nullptr) {
    const files::CellFile board_cell = options.board_cell.empty() ? result.cell : files::read_cell(options.board_cell);
    result.track = run_on(*board, board_cell, samples, start, result.scalar);
  }
  if (board == nullptr || options.verify) {
    host_sim::Track host = host_sim::run_on_host(result.cell, samples, start, result.scalar);
    if (board == nullptr) {
      result.track = std::move(host);
    } else if (const auto d = host_sim::first_difference(host, result.track, result.scalar)) {
      const double at_s = d->sample < result.recording.rows() ? result.recording.time_s[d->sample] : 0;
      result.difference =
          fmt::format("host and {} differ first at sample {} (time {:g} s) in {}: host {:.9g}, board {:.9g}",
                      board->name, d->sample, at_s, d->field, d->host, d->board);
    } else {
      result.verified_against = board->name;
    }
  }
  std::size_t compared = 0;
  if (log && !options.initial_soc && result.scalar != host_sim::ScalarKind::float64 && !result.difference) {
    result.difference = host_sim::difference_to_log(*log, result.track, compared);
    if (!result.difference && compared > 0) result.verified_against = "log";
  }
  host_sim::evaluate(result);

  const std::string trace = host_sim::trace_csv(result);
  if (!options.trace.empty()) write_output(options.trace, trace);
  if (!options.output.report.empty()) write_output(options.output.report, reports::replay_report(result));
  if (!options.output.json.empty()) write_output(options.output.json, reports::json_of(result, files::sha256(trace)));
  if (result.difference) {
    fmt::print(stderr, "{}: {}\n", options.recording, *result.difference);
    return 1;
  }
  print_summary(options.output, summary(result));
  if (result.verified_against)
    print_summary(
        options.output,
        fmt::format("Verified: {} estimates, every bit equal {}.", compared > 0 ? compared : result.track.words.size(),
                    compared > 0 ? "to what the firmware computed" : "on " + *result.verified_against));
  if (!options.output.report.empty()) print_summary(options.output, "Report: " + options.output.report);
  return 0;
}

}  // namespace bms::tool
