// bms experiment: a current profile by name, as CSV.
#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "experiments/experiment.hpp"
#include "experiments/profile_figures.hpp"
#include "files/bad_input.hpp"
#include "reports/json_replay.hpp"
#include "reports/report_page.hpp"
#include "tool/commands.hpp"
#include "tool/options.hpp"

namespace bms::tool {

namespace {

using experiments::ProfileRow;

struct ExperimentCommandOptions {
  std::string name;
  double capacity_ah = 6;
  unsigned long seed = 1;
  double step_s = 0;       ///< 0: as the experiment requires, mostly 1
  double high_c_rate = 1;  ///< of pulses, in multiples of the 1C current
  double low_c_rate = 0.25;
  std::string out;
  Output output;
};

std::string experiment_list() {
  std::string list;
  for (const experiments::Experiment& e : experiments::experiments())
    list += fmt::format("  {:<18} {}\n", e.name, e.description);
  return list;
}

const experiments::Experiment& experiment_named(const std::string& name) {
  if (const experiments::Experiment* design = experiments::find_experiment(name)) return *design;
  std::string names;
  for (const experiments::Experiment& e : experiments::experiments())
    names += (names.empty() ? "" : ", ") + std::string(e.name);
  throw files::BadInput(name, 1, "no such experiment, expected one of: " + names);
}

/// Optional columns are written only if a row has a value for them. voltage_ref_v is nan where it is to be measured.
std::string csv_of(const std::vector<ProfileRow>& rows) {
  const auto any = [&](auto&& condition) { return std::any_of(rows.begin(), rows.end(), condition); };
  const auto has_voltage = [](const ProfileRow& r) { return r.voltmeter || std::isfinite(r.source_v); };
  const bool temperatures = any([](const ProfileRow& r) { return std::isfinite(r.temperature_c); });
  const bool currents = any([](const ProfileRow& r) { return std::isfinite(r.current_ref_a()); });
  const bool voltages = any(has_voltage);
  const auto field = [](bool there, double value) { return there ? fmt::format(",{}", value) : std::string(","); };
  std::string csv = fmt::format("time_s,current_a{}{}{}\n", temperatures ? ",temperature_c" : "",
                                currents ? ",current_ref_a" : "", voltages ? ",voltage_ref_v" : "");
  for (const ProfileRow& row : rows) {
    fmt::format_to(std::back_inserter(csv), "{},{}", row.time_s, row.current_a);
    if (temperatures) csv += field(true, row.temperature_c);
    if (currents) csv += field(std::isfinite(row.current_ref_a()), row.current_ref_a());
    if (voltages) csv += field(has_voltage(row), row.source_v);
    csv += '\n';
  }
  return csv;
}

std::string page_of_profile(const std::string& name, const std::vector<ProfileRow>& rows) {
  files::PageChart current{"Current, > 0 charges", {"A"}, {}, {{}}};
  for (const ProfileRow& row : rows) {
    current.time_s.push_back(row.time_s);
    current.columns[0].push_back(row.current_a);
  }
  return reports::page_of({"Experiment " + name, "", {}, {}, {current}});
}

std::string summary(const std::string& out, const experiments::ProfileFigures& f, std::string_view instruction) {
  return fmt::format("{} rows in {}: {:.2f} h, {:.2f} Ah charged, {:.2f} Ah discharged, {:.2f} A at most.{}{}",
                     f.samples, out, f.duration_s / 3'600, f.charged_ah, f.discharged_ah, f.largest_current_a,
                     instruction.empty() ? "" : "\n", instruction);
}

class ExperimentCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand("experiment", "Write the current profile of an experiment");
    c.footer("Experiments:\n" + experiment_list() + "\nExample: bms experiment forklift_shift --out shift.csv");
    c.add_option("name", o_.name, "name of the experiment")->required();
    c.add_option("--capacity-ah", o_.capacity_ah, "capacity of the cell in Ah; the currents scale with it")
        ->check(Within(0.01, 1000.0))
        ->capture_default_str();
    c.add_option("--high-c", o_.high_c_rate, "C-rate of the pulses")->check(Within(0.01, 1.0))->capture_default_str();
    c.add_option("--low-c", o_.low_c_rate, "C-rate of LOW in high_*_low_*")
        ->check(Within(0.0, 1.0))
        ->capture_default_str();
    c.add_option("--step-s", o_.step_s,
                 "sampling interval in s; as the experiment requires if not given, in most cases 1")
        ->check(Within(0.001, 60.0));
    c.add_option("--seed", o_.seed, "seed of the random parts")->capture_default_str();
    c.add_option(
         "--out", o_.out,
         "CSV file to write: time_s, current_a; where the experiment needs them also temperature_c of a climate "
         "chamber, current_ref_a while the contactor is open, voltage_ref_v of a reference source")
        ->required()
        ->type_name("FILE");
    add_output(c, o_.output);
    return &c;
  }

  int run() override {
    o_.output.set_own(o_.out);
    o_.output.protect({});
    const experiments::Experiment& design = experiment_named(o_.name);
    const auto rows = *experiments::experiment(o_.name, {.capacity_ah = o_.capacity_ah,
                                                         .seed = o_.seed,
                                                         .step_s = o_.step_s > 0 ? o_.step_s : design.step_s,
                                                         .high_c_rate = o_.high_c_rate,
                                                         .low_c_rate = o_.low_c_rate});
    const experiments::ProfileFigures figures = experiments::figures_of(rows);
    write_output(o_.out, csv_of(rows));
    if (!o_.output.json.empty()) write_output(o_.output.json, reports::json_of(o_.name, o_.out, figures));
    if (!o_.output.report.empty()) write_output(o_.output.report, page_of_profile(o_.name, rows));
    if (o_.out != "-") print_summary(o_.output, summary(o_.out, figures, design.instruction));
    return 0;
  }

 private:
  ExperimentCommandOptions o_;
};

}  // namespace

std::unique_ptr<Command> experiment_command() { return std::make_unique<ExperimentCommand>(); }

}  // namespace bms::tool
