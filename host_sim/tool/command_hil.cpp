// bms hil: firmware in the loop with a simulated pack or a recording.
#include <cmath>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "hil/session.hpp"
#include "images/firmware_image.hpp"
#include "measurement/recording_checks.hpp"
#include "monitor/candump_line.hpp"
#include "reports/report_page.hpp"
#include "tool/commands.hpp"
#include "tool/key_file.hpp"
#include "tool/options.hpp"

namespace bms::tool {

namespace {

using Json = nlohmann::ordered_json;

struct HilOptions {
  std::string board = "netduinoplus2";
  std::string port;  ///< of a real board; empty: emulated
  std::string cell = "table9", board_cell;
  std::size_t cells = 0;           ///< in series; 0: the board's own number
  std::string profile, recording;  ///< one of the two
  double initial_soc = 0.9;
  std::optional<double> announced_soc;
  double sample_period_s = 0.1;
  unsigned seed = 1;
  std::vector<std::string> faults;
  std::string candump, key;
  files::ReadOptions reading;
  Output output;
};

std::string json_of(const HilOptions& options, const hil::SessionPlan& plan, const hil::SessionResult& r) {
  Json faults = Json::array(), injection_results = Json::array(), warnings = Json::array();
  for (const hil::FaultEvent& f : r.faults)
    faults.push_back({{"name", f.name},
                      {"raised_at_s", f.raised_at_s},
                      {"cleared_at_s", f.cleared_at_s ? Json(*f.cleared_at_s) : Json()}});
  for (const hil::InjectionResult& x : r.injection_results) {
    injection_results.push_back({{"fault", x.injection.text},
                                 {"expected", x.injection.expected.empty() ? Json() : Json(x.injection.expected)},
                                 {"within_s", x.injection.expected.empty() ? Json() : Json(x.injection.within_s)},
                                 {"after_s", x.after_s ? Json(*x.after_s) : Json()},
                                 {"in_time", x.in_time}});
  }
  for (const measurement::Warning& w : plan.profile.warnings) warnings.push_back(w.id + ": " + w.text);
  return Json{{"command", "hil"},
              {"board", options.board},
              {"cell", plan.cell.name},
              {"cells", plan.cells},
              {"duration_s", r.duration_s},
              {"speedup", r.speedup},
              {"samples", r.samples},
              {"frames", r.frames},
              {"lost", r.lost},
              {"crc_errors", r.crc_errors},
              {"unanswered", r.unanswered},
              {"driving_after_s", r.driving_after_s ? Json(*r.driving_after_s) : Json()},
              {"cut_off_at_s", r.cut_off_at_s ? Json(*r.cut_off_at_s) : Json()},
              {"soc",
               {{"rmse", r.soc_rmse},
                {"max_error", r.soc_max_error},
                {"within_2_sigma", r.within_2_sigma},
                {"median_sigma", r.median_sigma},
                {"told", r.soc_published},
                {"wrong_told_as_valid", r.soc_wrong}}},
              {"faults", faults},
              {"reactions", injection_results},
              {"warnings", warnings}}
             .dump(1) +
         "\n";
}

files::PageTable fault_table(const hil::SessionResult& r) {
  files::PageTable table{"faults", "Faults that the board reported", {"fault", "from, s", "to, s"}, {}, ""};
  for (const hil::FaultEvent& f : r.faults) {
    table.rows.push_back(
        {files::text_cell(f.name), files::text_cell(fmt::format("{:.1f}", f.raised_at_s)),
         files::text_cell(f.cleared_at_s ? fmt::format("{:.1f}", *f.cleared_at_s) : "active at the end")});
  }
  return table;
}

/// "2.4", "not reported", or nothing if no fault is expected.
std::string reaction_time(const hil::InjectionResult& x) {
  if (x.after_s) return fmt::format("{:.1f}", *x.after_s);
  return x.injection.expected.empty() ? "" : "not reported";
}

files::PageTable reaction_table(const hil::SessionResult& r) {
  files::PageTable table{
      "reactions", "Injected faults", {"injected", "expected fault", "within, s", "reported after, s"}, {}, ""};
  for (const hil::InjectionResult& x : r.injection_results) {
    const std::string& expected = x.injection.expected;
    table.rows.push_back({files::text_cell(x.injection.text),
                          files::text_cell(expected.empty() ? "no fault" : expected),
                          files::text_cell(expected.empty() ? "" : fmt::format("{:.1f}", x.injection.within_s)),
                          files::text_cell(reaction_time(x))});
  }
  return table;
}

std::string report_of(const HilOptions& options, const hil::SessionPlan& plan, const hil::SessionResult& r,
                      const std::string& statement) {
  files::PageChart soc{"State of charge", {"estimate with two sigma, %", "true, %"}, {}, {{}, {}}, {{}, {}}};
  files::PageChart current{"Current, > 0 charges", {"measured, A"}, {}, {{}}};
  files::PageChart volts{"Cell voltages", {"lowest, V", "highest, V"}, {}, {{}, {}}};
  for (const hil::TracePoint& p : r.trace) {
    for (files::PageChart* c : {&soc, &current, &volts}) c->time_s.push_back(p.time_s);
    soc.columns[0].push_back(100 * p.soc);
    soc.half_band[0].push_back(200 * p.soc_sigma);
    soc.columns[1].push_back(100 * p.soc_true);
    current.columns[0].push_back(p.current_a);
    volts.columns[0].push_back(p.lowest_v);
    volts.columns[1].push_back(p.highest_v);
  }
  files::PageContent page{
      (options.port.empty() ? "Emulated board in the loop: " : "Hardware in the loop: ") + options.board,
      statement,
      {},
      {},
      {soc, current, volts}};
  for (const measurement::Warning& w : plan.profile.warnings) page.warnings.push_back(w.text);
  for (const files::PageTable& table : {fault_table(r), reaction_table(r)}) {
    if (!table.rows.empty()) page.tables.push_back(table);
  }
  return reports::page_of(page);
}

/// Whether the contactors closed; if not, the fault that came first.
std::string contactors_text(const hil::SessionResult& r) {
  if (r.driving_after_s) return fmt::format("contactors closed after {:.1f} s", *r.driving_after_s);
  if (r.faults.empty()) return "contactors never closed";
  return fmt::format("contactors never closed; the first fault was {} at {:.1f} s", r.faults.front().name,
                     r.faults.front().raised_at_s);
}

std::string statement_of(const hil::SessionResult& r) {
  std::string text = fmt::format("{:.2f} h in the loop, {:.0f} times real time: {} samples, {} frames, {}. ",
                                 r.duration_s / 3'600, r.speedup, r.samples, r.frames, contactors_text(r));
  text += fmt::format(
      "Error of the published state of charge: {:.2f} % RMS, {:.2f} % at most; the true value is within two sigma for "
      "{:.1f} % of the time.",
      100 * r.soc_rmse, 100 * r.soc_max_error, 100 * r.within_2_sigma);
  if (r.cut_off_at_s) {
    text += fmt::format(
        " At {:.1f} s the contactors opened while current flowed in the recording. The state of charge is not judged "
        "after that.",
        *r.cut_off_at_s);
  }
  std::size_t missed = 0;
  for (const hil::InjectionResult& x : r.injection_results) missed += x.in_time ? 0 : 1;
  if (!r.injection_results.empty() && missed == 0) {
    text += fmt::format(" The board reported every injected fault in time{}.",
                        r.driving_after_s ? "" : ", with its contactors open");
  }
  if (missed > 0) {
    text +=
        fmt::format(" The board did not report {} of {} injected faults in time.", missed, r.injection_results.size());
  }
  if (r.soc_wrong > 0) text += fmt::format(" It published a wrong state of charge as valid {} times.", r.soc_wrong);
  return text;
}

/// Samples that are too far apart for the board: it publishes SamplesMissing (firmware/protection/table.hpp) and never
/// drives.
void check_sample_period(const HilOptions& options, measurement::Recording& profile) {
  constexpr double missing_after_periods = 5;
  const double board_s = std::stod(images::board_setting(options.board, "BMS_SAMPLE_PERIOD_S"));
  if (options.sample_period_s <= missing_after_periods * board_s) return;
  profile.warnings.push_back(
      {"sample_period",
       fmt::format(
           "a sample every {:g} s, but {} is built for one every {:g} s: for the board samples are missing, and "
           "its contactors stay open, expected --sample-s {:g}",
           options.sample_period_s, options.board, board_s, board_s)});
}

hil::SessionPlan read(const HilOptions& options) {
  if (options.profile.empty() == options.recording.empty())
    throw files::BadInput("bms hil", 1, "one input needed, expected --profile or --recording");
  hil::SessionPlan plan;
  plan.cell = files::read_cell(options.cell);
  plan.replayed = options.profile.empty();
  const std::string& input = plan.replayed ? options.recording : options.profile;
  plan.profile = files::read_recording(
      input, plan.replayed ? files::VoltageColumn::required : files::VoltageColumn::optional, options.reading);
  print_read_as(options.output, plan.profile);
  measurement::compare_with_cell(plan.profile, plan.cell.parameters);
  check_sample_period(options, plan.profile);
  for (const measurement::Warning& w : plan.profile.warnings) warn(input + ": " + w.text);
  plan.cells = options.cells != 0 ? options.cells : images::board_cells(options.board);
  plan.initial_soc = options.initial_soc;
  plan.announced_soc = options.announced_soc;
  plan.sample_period_s = options.sample_period_s;
  plan.spread.seed = options.seed;
  for (const std::string& text : options.faults) plan.injections.push_back(hil::parse_injection(text, plan.cells));
  return plan;
}

/// dump: takes the board's frames in candump format if the options ask for them.
hil::SessionResult compute(const HilOptions& options, const hil::SessionPlan& plan, std::string& dump) {
  const files::CellFile board_cell = options.board_cell.empty() ? plan.cell : files::read_cell(options.board_cell);
  if (options.port.empty()) set_stage("building the firmware");
  const auto link = options.port.empty()
                        ? hil::emulated_link(
                              options.board,
                              images::firmware_image(options.board, board_cell, images::Image::hil, "none", plan.cells))
                        : hil::serial_link(options.port);
  const auto record = [&](double time_s, const can::Frame& f) {
    if (options.candump.empty()) return;
    monitor::append_dump_line(dump, monitor::to_bus_frame(f, std::llround(1e6 * time_s)), "can0");
  };
  const auto show = progress_on_stderr(1, [](double done, double left_s, const std::string&) {
    return fmt::format("in the loop: {:.0f} %, {:.0f} s left", 100 * done, std::isfinite(left_s) ? left_s : 0);
  });
  return hil::run_session(*link, plan, record, [&](double done) {
    if (show) show(done, "");
  });
}

/// Returns the exit code: 1 if a fault was not reported in time, or a wrong state of charge was published as valid.
int write(const HilOptions& options, const hil::SessionPlan& plan, const hil::SessionResult& result) {
  const Output& output = options.output;
  const std::string statement = statement_of(result);
  if (!output.json.empty()) write_output(output.json, json_of(options, plan, result));
  if (!output.report.empty()) write_output(output.report, report_of(options, plan, result, statement));
  print_summary(output, statement);
  for (const hil::FaultEvent& f : result.faults) {
    print_summary(output, fmt::format("  {:>9.1f} s  {}{}", f.raised_at_s, f.name,
                                      f.cleared_at_s ? fmt::format(", until {:.1f} s", *f.cleared_at_s) : ""));
  }
  if (!output.report.empty()) print_summary(output, "Report: " + output.report);
  bool good = result.soc_wrong == 0;
  for (const hil::InjectionResult& x : result.injection_results) {
    if (x.in_time) continue;
    good = false;
    fmt::print(
        stderr, "{}: expected {} within {:.1f} s, {}\n", x.injection.text, x.injection.expected, x.injection.within_s,
        x.after_s ? fmt::format("the board reported it after {:.1f} s", *x.after_s) : "the board did not report it");
  }
  return good ? 0 : 1;
}

class HilCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand(
        "hil",
        "Run the firmware in the loop with a simulated pack or a recording, and compare its CAN messages with the "
        "true values");
    c.footer(
        "Faults: drop=P corrupt=P delay=P (fraction P of the frames to the board), cell_stuck=K cell_open=K "
        "sense_wire=K cell_high=K cell_low=K (cell K),\n"
        "current_stuck current_open temperature_open temperature_stuck overcurrent welded precharge_open silence; each "
        "@START or @START-END in seconds\n"
        "Example: bms hil --board stm32f405_forklift --cell table9 --profile shift.csv --fault cell_open=3@600-660 "
        "--report loop.html");
    c.add_option("--board", o_.board, "folder in boards/; it is emulated unless --port names a real one")
        ->capture_default_str();
    c.add_option("--port", o_.port, "serial port of a board that speaks SLCAN")->type_name("DEVICE");
    c.add_option("--cell", o_.cell, cell_help("cells of the simulated pack"))->capture_default_str();
    c.add_option("--cells", o_.cells, "cells in series; the board's own number if not given")
        ->check(Within(1, hil::max_cells));
    c.add_option("--board-cell", o_.board_cell, "cell file for the board's firmware if it is not --cell")
        ->type_name("CELL");
    c.add_option("--profile", o_.profile, "current of the load: time_s, current_a, optionally temperature_c")
        ->type_name("FILE");
    c.add_option("--recording", o_.recording,
                 "recording whose voltages are the cell voltages; its current flows while the contactors are closed")
        ->type_name("FILE");
    c.add_option("--initial-soc", o_.initial_soc, "state of charge of the pack at the start, 0..1")
        ->check(Within(0.0, 1.0))
        ->capture_default_str();
    c.add_option("--announced-soc,--told-soc", o_.announced_soc,
                 "initial state of charge that is sent to the board; not sent if not given")
        ->check(Within(0.0, 1.0));
    c.add_option("--sample-s", o_.sample_period_s, "sampling interval in s")
        ->check(Within(0.01, 10.0))
        ->capture_default_str();
    c.add_option("--seed", o_.seed, "seed of the cells' spread and of the sensor noise")->capture_default_str();
    c.add_option("--fault", o_.faults, "fault to inject; may be repeated")->type_name("NAME[=VALUE]@START[-END]");
    c.add_option("--key", o_.key, "device key of the board, 32 hexadecimal digits; needed if it has one")
        ->check(not_empty())
        ->type_name("FILE");
    c.add_option("--candump", o_.candump, "write the board's frames in the format of candump -L")->type_name("FILE");
    add_reading(c, o_.reading);
    add_output(c, o_.output);
    return &c;
  }

  int run() override {
    complete_reading(o_.reading);
    o_.output.set_own(o_.candump);
    o_.output.protect({o_.recording, o_.profile, o_.cell, o_.board_cell});
    hil::SessionPlan plan = read(o_);
    if (!o_.key.empty()) plan.key = read_key(o_.key);
    std::string dump;
    const hil::SessionResult result = compute(o_, plan, dump);
    if (!o_.candump.empty()) write_output(o_.candump, dump);
    return write(o_, plan, result);
  }

 private:
  HilOptions o_;
};

}  // namespace

std::unique_ptr<Command> hil_command() { return std::make_unique<HilCommand>(); }

}  // namespace bms::tool
