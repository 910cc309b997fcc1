#include "host_sim/command_experiment.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "host_sim/bad_input.hpp"
#include "host_sim/experiment.hpp"
#include "host_sim/json_results.hpp"
#include "host_sim/report_page.hpp"

namespace bms {

std::string experiment_list() {
  std::string list;
  for (const Experiment& e : experiments()) list += fmt::format("  {:<18} {}\n", e.name, e.description);
  return list;
}

int run(const ExperimentCommandOptions& options) {
  const auto rows = experiment(options.name, {options.capacity_ah, options.seed, options.step_s, options.high_c_rate, options.low_c_rate});
  if (!rows) {
    std::string names;
    for (const Experiment& e : experiments()) names += (names.empty() ? "" : ", ") + std::string(e.name);
    throw BadInput(options.name, 1, "no such experiment, expected one of: " + names);
  }

  std::string csv = "time_s,current_a\n";
  ExperimentResult result{options.name, options.out, rows->size(), rows->back().time_s - rows->front().time_s};
  double before_s = rows->front().time_s;
  for (const ProfileRow& row : *rows) {
    fmt::format_to(std::back_inserter(csv), "{},{}\n", row.time_s, row.current_a);
    (row.current_a > 0 ? result.charged_ah : result.discharged_ah) += std::abs(row.current_a) * (row.time_s - before_s) / 3'600;
    result.largest_current_a = std::max(result.largest_current_a, std::abs(row.current_a));
    before_s = row.time_s;
  }
  put(options.out, csv);
  if (!options.output.json.empty()) put(options.output.json, json_of(result));
  if (!options.output.report.empty()) {
    PageChart current{"Current, charging up", {"A"}, {}, {{}}};
    for (const ProfileRow& row : *rows) {
      current.time_s.push_back(row.time_s);
      current.columns[0].push_back(row.current_a);
    }
    put(options.output.report, page_of({"Experiment " + options.name, "", {}, {}, {current}}));
  }
  if (options.out != "-") {
    tell(options.output, fmt::format("{} rows in {}: {:.2f} h, {:.2f} Ah charged, {:.2f} Ah discharged, {:.2f} A at most.", result.samples, options.out,
                                     result.duration_s / 3'600, result.charged_ah, result.discharged_ah, result.largest_current_a));
  }
  return 0;
}

}  // namespace bms
