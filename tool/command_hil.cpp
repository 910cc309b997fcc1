#include "tool/command_hil.hpp"

#include <cmath>
#include <cstdio>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "hil/session.hpp"
#include "images/firmware_image.hpp"
#include "measurement/recording_checks.hpp"
#include "monitor/candump_line.hpp"
#include "reports/report_page.hpp"

namespace bms::tool {

namespace {

using Json = nlohmann::ordered_json;

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

std::string report_of(const HilOptions& options, const hil::SessionPlan& plan, const hil::SessionResult& r,
                      const std::string& statement) {
  files::PageTable faults{"faults", "Faults that the board told", {"fault", "from, s", "to, s"}, {}, ""},
      injection_results{
          "reactions", "What was broken on purpose", {"what", "expected", "within, s", "after, s"}, {}, ""};
  for (const hil::FaultEvent& f : r.faults)
    faults.rows.push_back({{f.name, {}, {}},
                           {fmt::format("{:.1f}", f.raised_at_s), {}, {}},
                           {f.cleared_at_s ? fmt::format("{:.1f}", *f.cleared_at_s) : "stays", {}, {}}});
  for (const hil::InjectionResult& x : r.injection_results) {
    injection_results.rows.push_back(
        {{x.injection.text, {}, {}},
         {x.injection.expected.empty() ? "no fault" : x.injection.expected, {}, {}},
         {x.injection.expected.empty() ? "" : fmt::format("{:.1f}", x.injection.within_s), {}, {}},
         {x.after_s                      ? fmt::format("{:.1f}", *x.after_s)
          : x.injection.expected.empty() ? ""
                                         : "not told",
          {},
          {}}});
  }
  files::PageChart soc{
      "State of charge", {"told, %", "told + two sigma", "told - two sigma", "true, %"}, {}, {{}, {}, {}, {}}},
      current{"Current, charging up", {"A"}, {}, {{}}}, volts{"Cells", {"lowest, V", "highest, V"}, {}, {{}, {}}};
  for (const hil::TracePoint& p : r.trace) {
    for (files::PageChart* c : {&soc, &current, &volts}) c->time_s.push_back(p.time_s);
    soc.columns[0].push_back(100 * p.soc);
    soc.columns[1].push_back(100 * (p.soc + 2 * p.soc_sigma));
    soc.columns[2].push_back(100 * (p.soc - 2 * p.soc_sigma));
    soc.columns[3].push_back(100 * p.soc_true);
    current.columns[0].push_back(p.current_a);
    volts.columns[0].push_back(p.lowest_v);
    volts.columns[1].push_back(p.highest_v);
  }
  files::PageContent page{"In the loop: " + options.board, statement, {}, {}, {soc, current, volts}};
  for (const measurement::Warning& w : plan.profile.warnings) page.warnings.push_back(w.text);
  if (!faults.rows.empty()) page.tables.push_back(faults);
  if (!injection_results.rows.empty()) page.tables.push_back(injection_results);
  return reports::page_of(page);
}

std::string statement_of(const hil::SessionResult& r) {
  std::string text = fmt::format("{:.2f} h in the loop, {:.0f} times as fast as real: {} samples, {} frames",
                                 r.duration_s / 3'600, r.speedup, r.samples, r.frames);
  text += r.driving_after_s ? fmt::format(", contactors closed after {:.1f} s. ", *r.driving_after_s)
                            : ", contactors never closed. ";
  text += fmt::format("State of charge told: {:.2f} % RMS, {:.2f} % at most, {:.1f} % of the time within two sigma.",
                      100 * r.soc_rmse, 100 * r.soc_max_error, 100 * r.within_2_sigma);
  if (r.cut_off_at_s)
    text += fmt::format(
        " From {:.1f} s on the contactors were open while current flowed in the recording: what was told of the state "
        "of charge since then is not judged.",
        *r.cut_off_at_s);
  std::size_t missed = 0;
  for (const hil::InjectionResult& x : r.injection_results) missed += x.in_time ? 0 : 1;
  if (!r.injection_results.empty())
    text += missed == 0 ? " Every fault that was put in was told in its time."
                        : fmt::format(" {} of {} faults that were put in were not told in their time.", missed,
                                      r.injection_results.size());
  if (r.soc_wrong > 0) text += fmt::format(" {} times a wrong state of charge was told as valid.", r.soc_wrong);
  return text;
}

}  // namespace

int run(const HilOptions& options) {
  if (options.profile.empty() == options.recording.empty())
    throw files::BadInput("bms hil", 1, "one input needed, expected --profile or --recording");
  hil::SessionPlan plan;
  plan.cell = files::read_cell(options.cell);
  plan.replayed = options.profile.empty();
  const std::string& input = plan.replayed ? options.recording : options.profile;
  plan.profile =
      files::read_recording(input, plan.replayed ? files::VoltageColumn::required : files::VoltageColumn::optional);
  measurement::compare_with_cell(plan.profile, plan.cell.parameters);
  for (const measurement::Warning& w : plan.profile.warnings) warn(input + ": " + w.text);
  plan.cells = images::board_cells(options.board);
  plan.initial_soc = options.initial_soc;
  plan.announced_soc = options.announced_soc;
  plan.sample_period_s = options.sample_period_s;
  plan.spread.seed = options.seed;
  for (const std::string& text : options.faults) plan.injections.push_back(hil::injection(text, plan.cells));

  const files::CellFile board_cell = options.board_cell.empty() ? plan.cell : files::read_cell(options.board_cell);
  const auto link =
      options.port.empty()
          ? hil::emulated_link(options.board, images::firmware_image(options.board, board_cell, images::Image::hil))
          : hil::serial_link(options.port);
  std::string dump;
  const auto keep = [&](double time_s, const can::Frame& f) {
    if (options.candump.empty()) return;
    monitor::append_dump_line(dump, monitor::to_bus_frame(f, std::llround(1e6 * time_s)), "can0");
  };
  const auto show = progress_on_terminal(1, [](double done, double left_s, const std::string&) {
    return fmt::format("in the loop: {:.0f} %, {:.0f} s left", 100 * done, std::isfinite(left_s) ? left_s : 0);
  });
  const auto result = hil::run_session(*link, plan, keep, [&](double done) {
    if (show) show(done, "");
  });

  if (!options.candump.empty()) write_output(options.candump, dump);
  const std::string statement = statement_of(result);
  if (!options.output.json.empty()) write_output(options.output.json, json_of(options, plan, result));
  if (!options.output.report.empty()) write_output(options.output.report, report_of(options, plan, result, statement));
  print_summary(options.output, statement);
  for (const hil::FaultEvent& f : result.faults)
    print_summary(options.output, fmt::format("  {:>9.1f} s  {}{}", f.raised_at_s, f.name,
                                              f.cleared_at_s ? fmt::format(", until {:.1f} s", *f.cleared_at_s) : ""));
  if (!options.output.report.empty()) print_summary(options.output, "Report: " + options.output.report);
  bool good = result.soc_wrong == 0;
  for (const hil::InjectionResult& x : result.injection_results) {
    if (x.in_time) continue;
    good = false;
    fmt::print(stderr, "{}: expected {} within {:.1f} s, {}\n", x.injection.text, x.injection.expected,
               x.injection.within_s, x.after_s ? fmt::format("it came after {:.1f} s", *x.after_s) : "it did not come");
  }
  return good ? 0 : 1;
}

}  // namespace bms::tool
