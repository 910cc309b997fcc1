// The bms tool: command line in, one command run, exit code out.
//
//   0 done; 1 ran, and the answer is no; 2 bad usage or bad input; 3 a fault of ours
#include <cstdio>
#include <exception>
#include <functional>

#include <CLI/CLI.hpp>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "tool/command_diagnose.hpp"
#include "tool/command_experiment.hpp"
#include "tool/command_flash.hpp"
#include "tool/command_hil.hpp"
#include "tool/command_identify.hpp"
#include "tool/command_monitor.hpp"
#include "tool/command_proof.hpp"
#include "tool/command_replay.hpp"
#include "tool/command_simulate.hpp"
#include "tool/command_study.hpp"

namespace {

/// A number within both ends. CLI::Range lets nan through.
struct Within : CLI::Validator {
  Within(double low, double high) {
    name_ = "from " + CLI::detail::to_string(low) + " to " + CLI::detail::to_string(high);
    func_ = [low, high, range = name_](std::string& input) -> std::string {
      double value = 0;
      const bool inside = CLI::detail::lexical_cast(input, value) && value >= low && value <= high;
      return inside ? "" : "'" + input + "' is not acceptable, expected a number " + range;
    };
  }
};

const CLI::Validator not_empty(
    [](std::string& name) { return name.empty() ? std::string("an empty name, expected a file") : std::string(); },
    "FILE");

void add_output(CLI::App& command, bms::tool::Output& output) {
  command.add_option("--json", output.json, "write the result as one JSON object to FILE, '-' for standard output")
      ->check(not_empty)
      ->type_name("FILE");
  command.add_option("--report", output.report, "write a page with plots to FILE.html")
      ->check(not_empty)
      ->type_name("FILE");
  command.add_flag("--quiet", output.quiet, "no summary");
}

void add_replay(CLI::App& app, bms::tool::ReplayOptions& o) {
  CLI::App& c = *app.add_subcommand(
      "replay", "Run the state-of-charge estimator over a recording, on this machine or on an emulated board");
  c.footer("Example: bms replay recordings/forklift_shift.csv --target netduinoplus2 --verify --report shift.html");
  c.add_option("recording", o.recording,
               "CSV with time_s, current_a (> 0 charges), voltage_v, and maybe temperature_c, soc_ref; or a candump "
               "log of the firmware's frames, which is compared with what the firmware computed")
      ->required();
  c.add_option("--cell", o.cell, "cell file, or the name of a built-in cell: " + bms::files::cell_names())
      ->capture_default_str();
  c.add_option("--initial-soc", o.initial_soc,
               "state of charge believed at the start, 0..1; without it the first voltage tells")
      ->check(Within(0.0, 1.0));
  c.add_option("--initial-soc-sigma", o.initial_soc_sigma, "how far that is to be believed (standard deviation)")
      ->check(Within(1e-4, 1.0))
      ->capture_default_str();
  c.add_option("--target", o.target, "host, or an emulated board by its folder in boards/: netduinoplus2")
      ->capture_default_str();
  c.add_option("--scalar", o.scalar, "arithmetic: float, fixed or double")
      ->check(CLI::IsMember({"float", "fixed", "double"}))
      ->capture_default_str();
  c.get_option("--initial-soc-sigma")->needs("--initial-soc");
  c.add_flag("--verify", o.verify,
             "run host and board and compare every estimate bit by bit; exit 1 where they differ");
  c.add_option("--board-cell", o.board_cell,
               "cell file for the board's firmware when it is not the host's: shows what --verify finds")
      ->type_name("CELL");
  c.add_option("--trace", o.trace, "write every estimate to a CSV file")->type_name("FILE");
  add_output(c, o.output);
}

void add_simulate(CLI::App& app, bms::tool::SimulateOptions& o) {
  CLI::App& c = *app.add_subcommand("simulate", "Run a current through the model, open loop");
  c.footer("Example: bms simulate --cell table9 --profile shift.csv --initial-soc 0.9 --out simulated.csv");
  c.add_option("--cell", o.cell, "cell file, or the name of a built-in cell: " + bms::files::cell_names())->required();
  auto* recording = c.add_option("--recording", o.recording, "recording whose current is used")->type_name("FILE");
  c.add_option("--profile", o.profile, "current profile: a recording without voltage_v")
      ->type_name("FILE")
      ->excludes(recording);
  c.add_option("--initial-soc", o.initial_soc, "state of charge at the start")
      ->check(Within(0.0, 1.0))
      ->capture_default_str();
  c.add_option("--with", o.with,
               "mechanism to add to the cell's, or to put in its place, as in ocv_hysteresis:half_gap_v=0.01,decay=40; "
               "may be repeated")
      ->type_name("ID:param=value,...")
      ->expected(1)
      ->take_all();
  c.add_option("--noise-v", o.noise_v, "standard deviation of noise added to the voltage")->check(Within(0.0, 1e6));
  c.add_option("--noise-a", o.noise_a, "standard deviation of noise added to the current that is written")
      ->check(Within(0.0, 1e6));
  c.add_option("--seed", o.seed, "of the noise")->capture_default_str();
  c.add_option("--out", o.out, "CSV file to write: time_s, current_a, voltage_v, soc")->required()->type_name("FILE");
  add_output(c, o.output);
}

void add_experiment(CLI::App& app, bms::tool::ExperimentCommandOptions& o) {
  CLI::App& c = *app.add_subcommand("experiment", "Write a current profile");
  c.footer("Experiments:\n" + bms::tool::experiment_list() +
           "\nExample: bms experiment forklift_shift --out shift.csv");
  c.add_option("name", o.name, "which one")->required();
  c.add_option("--capacity-ah", o.capacity_ah, "of the cell; currents scale with it")
      ->check(Within(0.01, 1000.0))
      ->capture_default_str();
  c.add_option("--high-c", o.high_c_rate, "height of the pulses, in multiples of the 1C current")
      ->check(Within(0.01, 1.0))
      ->capture_default_str();
  c.add_option("--low-c", o.low_c_rate, "what LOW means in high_*_low_*")
      ->check(Within(0.0, 1.0))
      ->capture_default_str();
  c.add_option("--step-s", o.step_s, "sampling interval; as the design wants it if not given, mostly 1")
      ->check(Within(0.001, 60.0));
  c.add_option("--seed", o.seed, "of what is random in it")->capture_default_str();
  c.add_option("--out", o.out,
               "CSV file to write: time_s, current_a; temperature_c of a climate chamber, current_ref_a where the "
               "contactor is open, voltage_ref_v of a source where the design wants them")
      ->required()
      ->type_name("FILE");
  add_output(c, o.output);
}

void add_identify(CLI::App& app, bms::tool::IdentifyOptions& o) {
  CLI::App& c =
      *app.add_subcommand("identify", "Find a cell's parameters, and how far they can be believed, from recordings");
  c.footer(
      "Example: bms identify --ocv slow_discharge.csv --ocv slow_charge.csv --recording pulses.csv --validate "
      "shift.csv --start table9 --out my_cell.toml");
  c.add_option("--recording", o.recordings, "recordings to identify from")->required()->type_name("FILE");
  c.add_option("--ocv", o.ocv, "slow charge and discharge (C/10 or slower) to take OCV and capacity from")
      ->type_name("FILE");
  c.add_option("--model", o.model,
               "nlgr: nonlinear grey box; tf: transfer function; oe: output error; hw: Hammerstein-Wiener")
      ->check(CLI::IsMember({"nlgr", "tf", "oe", "hw"}))
      ->capture_default_str();
  c.add_option("--optimizer", o.optimizer,
               "gn, agn: (adaptive) subspace Gauss-Newton; lm: Levenberg-Marquardt; sd: steepest descent; nls: trust "
               "region, reflective")
      ->capture_default_str();
  c.add_option("--start", o.start, "cell file to begin from: limits, first values, and what is not identified")
      ->capture_default_str();
  c.add_option("--initial-soc", o.initial_soc,
               "state of charge at the start, or 'estimate'; without it soc_ref if there is one")
      ->type_name("X");
  c.add_option("--window", o.window, "state of charge that counts, as in 0.8:0.5")->type_name("HI:LO");
  c.add_option("--validate", o.validate, "recordings to judge the result by; nothing is identified from them")
      ->type_name("FILE");
  c.add_option("--validate-window", o.validate_window, "the same for those; as --window if not given")
      ->type_name("HI:LO");
  c.add_option("--nodes", o.nodes,
               "state of charge at which R0, R1, C1 are identified, as in 0.2,0.5,0.8; linear in between")
      ->delimiter(',')
      ->check(Within(0.0, 1.0));
  c.add_flag("--extend", o.extend,
             "what an estimator needs beyond the circuit, from the same recordings: hysteresis between slow charge and "
             "discharge, resistances that follow the temperature, lasting errors as states of the filter");
  c.add_option("--lean", o.ocv_branch,
               "where the OCV lies between slow discharge (-1) and charge (1); identified if not given")
      ->check(Within(-1.0, 1.0));
  c.add_option("--ocv-error-v", o.ocv_error_v, "largest error of the OCV's straight pieces")
      ->check(Within(0.0002, 0.05))
      ->capture_default_str();
  c.add_option("--filter-hz", o.filter_hz,
               "Butterworth low-pass of second order on the current, forward and backward; none if not given")
      ->check(Within(1e-4, 1e3));
  c.add_flag("--remove-offset", o.remove_offset, "subtract what the current reads at rest");
  c.add_option("--capacity-ah", o.capacity_ah, "capacity; of the OCV recordings if not given")
      ->check(Within(0.01, 1000.0));
  c.add_option("--name", o.name, "of the cell; that of the file if not given");
  c.add_option("--out", o.out, "cell file to write")->required()->type_name("C.toml");
  add_output(c, o.output);
}

void add_study(CLI::App& app, bms::tool::StudyOptions& o) {
  CLI::App& c =
      *app.add_subcommand("study", "Compare models, optimisers and experiments as the paper does (Tables 4 to 9)");
  c.footer("Example: bms study --out study");
  c.add_option("--recordings", o.recordings, "folder with recordings; without it the simulated plant is studied")
      ->type_name("DIR");
  c.add_option("--cell", o.cell,
               "OCV, capacity and start values: cell file, or the name of a built-in cell: " + bms::files::cell_names())
      ->capture_default_str();
  c.add_option("--seed", o.seed, "of the plant's noise")->capture_default_str();
  c.add_option("--out", o.out, "folder to write tables (CSV, JSON) and the page to")->required()->type_name("DIR");
  add_output(c, o.output);
}

void add_diagnose(CLI::App& app, bms::tool::DiagnoseOptions& o) {
  CLI::App& c = *app.add_subcommand(
      "diagnose",
      "Say where recordings and the calibrated cell part, and which physics or fault of an instrument does it");
  c.footer(
      "Example: bms diagnose --cell my_cell.toml --recording monday.csv --holdout tuesday.csv --initial-soc 0.95 --out "
      "extended.toml --report monday.html");
  c.add_option("--cell", o.cell, "calibrated cell: a file, or the name of a built-in cell: " + bms::files::cell_names())
      ->required();
  c.add_option("--recording", o.recordings, "recordings to diagnose, the earliest first")
      ->required()
      ->type_name("FILE");
  c.add_option(
       "--holdout", o.holdouts,
       "later recordings of the same cell and instruments: their voltage is compared with at the end, nothing else")
      ->type_name("FILE");
  c.add_option("--initial-soc", o.initial_soc,
               "state of charge believed at the start, of all recordings or one for each; without it soc_ref's first "
               "value, else the first voltage tells")
      ->check(Within(0.0, 1.0));
  c.add_option("--out", o.out, "cell file to write, with what was found")->type_name("EXTENDED.toml");
  add_output(c, o.output);
}

void add_hil(CLI::App& app, bms::tool::HilOptions& o) {
  CLI::App& c = *app.add_subcommand("hil",
                                    "Run the firmware in the loop with a simulated pack or a recording, and set what "
                                    "it says on CAN beside the truth");
  c.footer(
      "Example: bms hil --board netduinoplus2 --cell table9 --profile shift.csv --fault cell_open=3@600-660 --report "
      "loop.html\n"
      "Faults: drop=P corrupt=P delay=P (part of the frames to the board), cell_stuck=K cell_open=K sense_wire=K "
      "cell_high=K cell_low=K (cell K), current_stuck current_open temperature_open\n"
      "temperature_stuck overcurrent welded precharge_open silence; each @START or @START-END in seconds");
  c.add_option("--board", o.board, "folder in boards/; it is emulated unless --port names a real one")
      ->capture_default_str();
  c.add_option("--port", o.port, "serial port of a board that speaks SLCAN")->type_name("DEVICE");
  c.add_option("--cell", o.cell,
               "the pack's cells: cell file, or the name of a built-in cell: " + bms::files::cell_names())
      ->capture_default_str();
  c.add_option("--board-cell", o.board_cell, "the firmware's cell file, when it believes in another")
      ->type_name("CELL");
  c.add_option("--profile", o.profile, "what the load takes: time_s, current_a, maybe temperature_c")
      ->type_name("FILE");
  c.add_option("--recording", o.recording,
               "a recording whose voltages the cells read; its current flows while the contactors are closed")
      ->type_name("FILE");
  c.add_option("--initial-soc", o.initial_soc, "state of charge of the pack")
      ->check(Within(0.0, 1.0))
      ->capture_default_str();
  c.add_option("--told-soc", o.announced_soc, "what the board is told of it; nothing, if not given")
      ->check(Within(0.0, 1.0));
  c.add_option("--sample-s", o.sample_period_s, "between samples")->check(Within(0.01, 10.0))->capture_default_str();
  c.add_option("--seed", o.seed, "of the cells' spread and the sensors' noise")->capture_default_str();
  c.add_option("--fault", o.faults, "what to break")->type_name("NAME[=VALUE]@START[-END]");
  c.add_option("--candump", o.candump, "keep the board's frames as candump writes them")->type_name("FILE");
  add_output(c, o.output);
}

void add_flash(CLI::App& app, bms::tool::FlashOptions& o) {
  CLI::App& c = *app.add_subcommand(
      "flash",
      "Build a board's firmware and write it onto the chip with OpenOCD, compare, reset; the stored records stay");
  c.footer("Example: bms flash --board stm32f405_forklift --cell my_cell.toml");
  c.add_option("--board", o.board, "folder in boards/")->capture_default_str();
  c.add_option("--cell", o.cell, "cell file, or the name of a built-in cell; the board's own if not given")
      ->type_name("CELL");
  c.add_option("--probe", o.probe,
               "debug probe: stlink, cmsis-dap, jlink... (OpenOCD's interface/); the board's own if not given");
  c.add_option("--serial", o.serial, "serial number of the probe, where there are several");
  c.add_flag("--dry-run", o.dry_run, "build, and print OpenOCD's command instead of running it");
}

void add_proof(CLI::App& app, bms::tool::ProofOptions& o) {
  CLI::App& c = *app.add_subcommand(
      "proof", "Set what the diagnosis says of real recordings beside measurements that it did not see; takes minutes");
  c.footer("Experiments: " + bms::tool::proof_list_text() +
           "\nExample: bms proof --data recordings_of_a123 --report proof.html");
  c.add_option("--data", o.data, "folder with the recordings in a123_26650 and a123_esctoolbox")
      ->required()
      ->type_name("DIR");
  c.add_option("--only", o.only, "one experiment")->type_name("NAME");
  add_output(c, o.output);
}

void add_monitor(CLI::App& app, bms::tool::MonitorOptions& o) {
  CLI::App& c = *app.add_subcommand(
      "monitor", "Show and log what the BMS says on CAN: a live screen on a terminal, a line a second elsewhere");
  c.footer("Example: bms monitor can0 --record monday.log    then: bms monitor file:monday.log --csv monday.csv");
  c.add_option("source", o.source,
               "can0, vcan0: SocketCAN; slcan:/dev/ttyACM0: a serial adapter; file:DUMP.log: a log of candump -L, "
               "maybe gzip, - for standard input")
      ->required();
  c.add_flag("--once", o.once, "end after the first complete picture; exit 1 if it never came");
  c.add_option("--duration", o.duration_s, "end after so many seconds")->check(Within(0.01, 1e9))->type_name("S");
  c.add_option("--csv", o.csv, "write a row with every signal for each Status message, which ends each sample")
      ->check(not_empty)
      ->type_name("FILE");
  c.add_option("--record", o.record, "write every frame as candump -L does")->check(not_empty)->type_name("FILE");
  c.add_option("--serve", o.serve_port,
               "a page with live plots on 127.0.0.1, at this port or any that is free; prints its address")
      ->expected(0, 1)
      ->check(Within(0, 65'535))
      ->type_name("PORT");
  c.add_option("--json", o.output.json, "write the last picture as one JSON object to FILE, '-' for standard output")
      ->check(not_empty)
      ->type_name("FILE");
  c.add_flag("--quiet", o.output.quiet, "no screen, no lines");
}

/// own_file: what the command writes beside JSON and report.
template <class Options>
int run(Options& options, const std::string& own_file) {
  bms::tool::Output& output = options.output;
  output.main = own_file;
  if ((output.json == "-") + (output.report == "-") + (output.main == "-") > 1)
    throw bms::files::BadInput("-", 1, "more than one result for standard output, expected one");
  return bms::tool::run(options);
}

/// A usage error in one line.
int usage(const CLI::App& app, const CLI::ParseError& error) {
  if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
  std::fprintf(stderr, "bms: %s (see bms --help)\n", error.what());
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"greybox-bms: a battery model inside a battery management system, and the same model over recordings"};
  app.name("bms");
  app.require_subcommand(1);
  app.set_version_flag("--version", BMS_VERSION);
  app.footer("bms COMMAND --help tells more. Conventions: current > 0 charges; state of charge is a fraction 0..1.");

  bms::tool::ReplayOptions replay;
  bms::tool::SimulateOptions simulate;
  bms::tool::ExperimentCommandOptions experiment;
  add_replay(app, replay);
  add_simulate(app, simulate);
  add_experiment(app, experiment);
  bms::tool::IdentifyOptions identify;
  add_identify(app, identify);
  bms::tool::StudyOptions study;
  add_study(app, study);
  bms::tool::DiagnoseOptions diagnose;
  add_diagnose(app, diagnose);
  bms::tool::FlashOptions flash;
  add_flash(app, flash);
  bms::tool::ProofOptions proof;
  add_proof(app, proof);
  bms::tool::HilOptions hil;
  add_hil(app, hil);
  bms::tool::MonitorOptions monitor;
  add_monitor(app, monitor);
  try {
    app.parse(argc, argv);
    if (app.got_subcommand("replay")) return run(replay, replay.trace);
    if (app.got_subcommand("simulate")) return run(simulate, simulate.out);
    if (app.got_subcommand("identify")) return run(identify, identify.out);
    if (app.got_subcommand("diagnose")) return run(diagnose, diagnose.out);
    if (app.got_subcommand("flash")) return bms::tool::run(flash);
    if (app.got_subcommand("proof")) return run(proof, "");
    if (app.got_subcommand("hil")) return run(hil, hil.candump);
    if (app.got_subcommand("monitor")) {
      if (app.get_subcommand("monitor")->count("--serve") > 0 && !monitor.serve_port) monitor.serve_port = 0;
      return run(monitor, monitor.csv);
    }
    if (app.got_subcommand("study")) return run(study, "");
    return run(experiment, experiment.out);
  } catch (const CLI::ParseError& error) {
    return usage(app, error);
  } catch (const bms::files::BadInput& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bms: %s\n", error.what());
    return 3;
  }
}
