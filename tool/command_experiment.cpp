#include "tool/command_experiment.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "experiments/experiment.hpp"
#include "files/bad_input.hpp"
#include "reports/json_results.hpp"
#include "reports/report_page.hpp"

namespace bms::tool {

std::string experiment_list() {
  std::string list;
  for (const experiments::Experiment& e : experiments::experiments())
    list += fmt::format("  {:<18} {}\n", e.name, e.description);
  return list;
}

int run(const ExperimentCommandOptions& options) {
  const experiments::Experiment* design = experiments::find_experiment(options.name);
  const double wanted_step_s = design != nullptr ? design->step_s : 1;
  const auto rows =
      experiments::experiment(options.name, {.capacity_ah = options.capacity_ah,
                                             .seed = options.seed,
                                             .step_s = options.step_s > 0 ? options.step_s : wanted_step_s,
                                             .high_c_rate = options.high_c_rate,
                                             .low_c_rate = options.low_c_rate});
  if (!rows) {
    std::string names;
    for (const experiments::Experiment& e : experiments::experiments())
      names += (names.empty() ? "" : ", ") + std::string(e.name);
    throw files::BadInput(options.name, 1, "no such experiment, expected one of: " + names);
  }

  const auto any = [&](auto&& says) { return std::any_of(rows->begin(), rows->end(), says); };
  const bool chamber = any([](const experiments::ProfileRow& r) { return std::isfinite(r.temperature_c); });
  const bool referred = any([](const experiments::ProfileRow&r) { return std::isfinite(r.current_ref_a()); }),
             voltages = any([](const experiments::ProfileRow&r) { return r.voltmeter || std::isfinite(r.source_v); });
  const auto field = [](bool there, double value) { return there ? fmt::format(",{}", value) : std::string(","); };

  std::string csv = fmt::format("time_s,current_a{}{}{}\n", chamber ? ",temperature_c" : "",
                                referred ? ",current_ref_a" : "", voltages ? ",voltage_ref_v" : "");
  reports::ExperimentResult result{options.name, options.out, rows->size(), rows->back().time_s - rows->front().time_s};
  double before_s = rows->front().time_s;
  for (const experiments::ProfileRow& row : *rows) {
    fmt::format_to(std::back_inserter(csv), "{},{}", row.time_s, row.current_a);
    if (chamber) csv += field(true, row.temperature_c);
    if (referred) csv += field(std::isfinite(row.current_ref_a()), row.current_ref_a());
    if (voltages) csv += field(row.voltmeter || std::isfinite(row.source_v), row.source_v);  // nan: to be read
    csv += '\n';
    (row.current_a > 0 ? result.charged_ah : result.discharged_ah) +=
        std::abs(row.current_a) * (row.time_s - before_s) / 3'600;
    result.largest_current_a = std::max(result.largest_current_a, std::abs(row.current_a));
    before_s = row.time_s;
  }
  write_output(options.out, csv);
  if (!options.output.json.empty()) write_output(options.output.json, reports::json_of(result));
  if (!options.output.report.empty()) {
    files::PageChart current{"Current, charging up", {"A"}, {}, {{}}};
    for (const experiments::ProfileRow& row : *rows) {
      current.time_s.push_back(row.time_s);
      current.columns[0].push_back(row.current_a);
    }
    write_output(options.output.report, reports::page_of({"Experiment " + options.name, "", {}, {}, {current}}));
  }
  if (options.out != "-") {
    const std::string_view instruction = design->instruction;
    print_summary(
        options.output,
        fmt::format("{} rows in {}: {:.2f} h, {:.2f} Ah charged, {:.2f} Ah discharged, {:.2f} A at most.{}{}",
                    result.samples, options.out, result.duration_s / 3'600, result.charged_ah, result.discharged_ah,
                    result.largest_current_a, instruction.empty() ? "" : "\n", instruction));
  }
  return 0;
}

}  // namespace bms::tool
