// bms identify on simulated cells (identify_trial.hpp): is the truth within the stated standard deviations?
//
//   identify_trials                 prints the table
//   identify_trials --cells A-B     of these cells only, with a line for each trial
//   identify_trials --family N      of other cells
//   identify_trials --write         writes the table into inference/identification/README.md
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "files/committed_figures.hpp"
#include "files/temporary_folder.hpp"
#include "numerics/in_parallel.hpp"
#include "tests/host_sim/workflow/identify_trial.hpp"

namespace bms::workflow {
namespace {

struct Tally {
  int inside = 0, count = 0;
  std::vector<double> errors;

  void add(const Judged& j) {
    ++count;
    if (std::abs(j.sigmas()) <= 2) ++inside;
    errors.push_back(std::abs(j.relative()));
  }
  double median() {
    if (errors.empty()) return 0;
    std::nth_element(errors.begin(), errors.begin() + static_cast<long>(errors.size() / 2), errors.end());
    return errors[errors.size() / 2];
  }
};

struct Row {
  std::map<std::string, Tally> by_name;
  int fits = 0, worse_than_truth = 0;
  std::size_t not_claimed = 0;

  void add(const TrialResult& result) {
    ++fits;
    not_claimed += result.not_claimed;
    if (result.cost > result.truth_cost) ++worse_than_truth;
    for (const Judged& j : result.judged) by_name[j.name].add(j);
  }
  std::string text(const std::string& name) {
    std::string line = fmt::format("| {} | {} |", name, fits);
    for (const char* parameter : {"r0_ohm", "r1_ohm", "c1_f"}) {
      Tally& t = by_name[parameter];
      line += fmt::format(" {:.1f} %, {:.2f} % |", 100.0 * t.inside / std::max(1, t.count), 100 * t.median());
    }
    return line + fmt::format(" {} | {} |\n", not_claimed, worse_than_truth);
  }
};

void print_details(const plant::SimulatedCell& cell, const Trial& trial, const TrialResult& result) {
  fmt::print("cell {} {:.1f} Ah {}{} {} {:.2f}..{:.2f} {}: {:.2f} mV, truth {:.2f} mV, cost {:.4g} of {:.4g}\n",
             cell.number, cell.parameters.capacity_ah, cell.nmc ? "NMC" : "LFP", cell.half_gap_v > 0 ? " hyst" : "",
             trial.experiment, trial.from_soc, trial.to_soc, trial.ocv == OcvSource::rests ? "rests" : "slow",
             1e3 * result.rmse_v, 1e3 * result.truth_rmse_v, result.cost, result.truth_cost);
  for (const Judged& j : result.judged) {
    fmt::print("   {:7} {:3.0f} % {:11.5g} +- {:9.2g} truth {:11.5g} {:+7.2f} % {:+6.1f} sigma{}\n", j.name,
               100 * j.soc, j.value, j.std, j.truth, 100 * j.relative(), j.sigmas(),
               std::abs(j.sigmas()) > 2 ? " *" : "");
  }
  std::fflush(stdout);
}

std::string kind_of(const Trial& trial) {
  if (!trial.experiment.starts_with("ocv")) return trial.experiment;
  return fmt::format("{}, {}", trial.experiment,
                     trial.to_soc > 0 ? fmt::format("to {:.0f} %", 100 * trial.to_soc) : "to empty");
}

std::string table_of(int from, int to, std::uint64_t family, bool details) {
  struct Case {
    plant::SimulatedCell cell;
    Trial trial;
    TrialResult result;
  };
  std::vector<Case> cases;
  for (int number = from; number < to; ++number) {
    const plant::SimulatedCell cell = plant::simulated_cell(number, family);
    for (const Trial& trial : trials_of(cell)) cases.push_back({cell, trial, {}});
  }
  numerics::in_parallel(cases.size(), [&](std::size_t k) {
    const files::TemporaryFolder folder;
    cases[k].result = run_trial(cases[k].cell, cases[k].trial, folder.path());
  });
  std::vector<std::string> order;
  std::map<std::string, Row> rows;
  Row all;
  for (const Case& c : cases) {
    const std::string kind = kind_of(c.trial);
    if (!rows.contains(kind)) order.push_back(kind);
    if (details) print_details(c.cell, c.trial, c.result);
    rows[kind].add(c.result);
    all.add(c.result);
  }
  std::string table =
      "| experiment | fits | R0 | R1 | C1 | not claimed | worse than the truth |\n|---|---|---|---|---|---|---|\n";
  for (const std::string& kind : order) table += rows[kind].text(kind);
  return table + all.text("all");
}

int run(std::string_view range, std::uint64_t family, bool write) {
  constexpr int cells = 40;
  int from = 0, to = cells;
  if (!range.empty()) {
    const std::size_t dash = range.find('-');
    from = std::stoi(std::string(range.substr(0, dash)));
    to = dash == std::string_view::npos ? from + 1 : std::stoi(std::string(range.substr(dash + 1))) + 1;
  }
  const std::string table = table_of(from, to, family, !range.empty());
  if (write)
    files::replace_figures(std::filesystem::path(BMS_SOURCE_DIR) / "inference/identification/README.md", "trials",
                           table);
  else
    fmt::print("{}", table);
  return 0;
}

}  // namespace
}  // namespace bms::workflow

int main(int argc, char** argv) {
  std::string_view range;
  bool write = false;
  std::uint64_t family = 1;
  for (int k = 1; k < argc; ++k) {
    const std::string_view word = argv[k];
    if (word == "--write") write = true;
    if (word == "--family" && k + 1 < argc) family = std::stoull(argv[++k]);
    if (word == "--cells" && k + 1 < argc) range = argv[++k];
  }
  try {
    return bms::workflow::run(range, family, write);
  } catch (const std::exception& e) {
    fmt::print(stderr, "identify_trials: {}\n", e.what());
    return 2;
  }
}
