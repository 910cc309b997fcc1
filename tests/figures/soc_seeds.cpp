// The shipped shift with other seeds: another day of the truck and other errors of its instruments each time. Whether
// sigma is as wide as the errors are, with the cell file as it is and with lasting errors as states.
//
//   soc_seeds [N]      prints the table, of 50 seeds or of N
//   soc_seeds --write  writes it into docs/figures/soc_trials.md
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "experiments/experiment.hpp"
#include "files/cell_file.hpp"
#include "files/committed_figures.hpp"
#include "measurement/sample.hpp"
#include "measurement/statistics.hpp"
#include "plant/instruments.hpp"
#include "plant/truth_cell.hpp"
#include "replay/replay.hpp"
#include "tests/truth/forklift_shift.hpp"

namespace bms {
namespace {

struct Day {
  std::vector<measurement::Sample> samples;
  std::vector<double> soc;
};

/// As evidence/recordings/forklift_shift.csv, which has seed 1.
Day day_of(std::uint64_t seed) {
  plant::Cell cell({.capacity_ah = 6.03}, {.soc = 0.98, .v_rc_v = 0, .temperature_c = 18});
  plant::Instruments instruments({}, seed);
  const auto profile = experiments::experiment("forklift_shift", {.capacity_ah = 6, .seed = seed, .step_s = 1});
  Day day;
  for (const plant::RecordedRow& row :
       plant::record(profile.value(), cell, instruments, {.start_c = 18, .end_c = 22})) {
    day.samples.push_back(measurement::sample_of(row.time_s, row.current_a, row.voltage_v, row.temperature_c));
    day.soc.push_back(row.soc);
  }
  return day;
}

struct Row {
  const char* title;
  bool errors_are_states;
  std::optional<replay::SocPrior> prior;
  std::vector<double> rmse{}, inside{}, final_sigma{}, final_ratio{};

  void add(const files::CellFile& file, const Day& day) {
    files::CellFile cell = file;
    cell.parameters.noise.errors_are_states = errors_are_states;
    const replay::Track track = replay::run_on_host(cell, day.samples, replay::starting_point(prior),
                                                    replay::ScalarKind::float32, replay::Timing::none);
    double squares = 0, within = 0;
    for (std::size_t k = 0; k < track.rows.size(); ++k) {
      const replay::EstimateRow e = track.rows[k];
      squares += std::pow(e.soc - day.soc[k], 2);
      within += std::abs(e.soc - day.soc[k]) <= 2 * e.soc_sigma ? 1 : 0;
    }
    const auto n = static_cast<double>(track.rows.size());
    const replay::EstimateRow last = track.rows.back();
    rmse.push_back(std::sqrt(squares / n));
    inside.push_back(within / n);
    final_sigma.push_back(last.soc_sigma);
    final_ratio.push_back(std::abs(last.soc - day.soc.back()) / last.soc_sigma);
  }
  std::string text() const {
    return fmt::format("| {} | {} | {:.2f}, {:.2f} | {:.1f}, {:.0f} | {:.2f}, {:.2f} | {:.2f} |\n", title, rmse.size(),
                       100 * measurement::median(rmse), 100 * *std::ranges::max_element(rmse),
                       100 * measurement::mean(inside), 100 * *std::ranges::min_element(inside),
                       100 * measurement::median(final_sigma), 100 * *std::ranges::max_element(final_sigma),
                       measurement::median(final_ratio));
  }
};

std::string table(std::uint64_t seeds) {
  const files::CellFile cell = files::read_cell("table9");
  constexpr replay::SocPrior too_low{0.78, 0.2};
  std::vector<Row> rows{{"`table9`, started by itself", false, std::nullopt},
                        {"`table9`, started 20 % too low, sigma 20 %", false, too_low},
                        {"with `errors_are_states`, started by itself", true, std::nullopt},
                        {"with `errors_are_states`, started 20 % too low, sigma 20 %", true, too_low}};
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const Day day = day_of(seed);
    for (Row& row : rows) row.add(cell, day);
  }
  std::string text =
      "| cell file and start | seeds | SOC RMSE, median and worst, % | inside two sigma, mean and worst, % | sigma at "
      "the end, median and largest, % | median of error / sigma at the end |\n|---|---|---|---|---|---|\n";
  for (const Row& row : rows) text += row.text();
  return text;
}

}  // namespace
}  // namespace bms

int main(int argc, char** argv) {
  const std::string_view word = argc > 1 ? argv[1] : "";
  const bool write = word == "--write";
  const std::uint64_t seeds = write || word.empty() ? 50 : std::strtoull(argv[1], nullptr, 10);
  try {
    if (seeds == 0) throw std::invalid_argument("expected a number of seeds or --write");
    const std::string text = bms::table(seeds);
    if (write)
      bms::files::replace_figures(std::filesystem::path(BMS_SOURCE_DIR) / "docs/figures/soc_trials.md", "seeds", text);
    else
      fmt::print("{}", text);
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "soc_seeds: {}\n", e.what());
    return 2;
  }
}
