// Runs the flashed image of the forklift board in the circuit of a truck: ./bms world [SCENARIO] [OPTIONS]
//
//   SCENARIO         starts, contacts, dips, faults, overloads or shift; all of them if not given
//   --count N        so many worlds or cases instead of all
//   --seed N         of the random worlds
//   --only TEXT      cases whose names contain TEXT, or one of several texts, separated by |
//   --minutes N      duration of the shift
//   --cells N        in series, for the starts: another number than 16
//   --jobs N         cases at a time
//   --continue       takes the good outcomes of earlier runs with this option, of the same image and seed
//   --from N         leaves the first N cases to other parts
//   --most N         runs at most N cases
//   --within N       starts no case after N minutes
//   --known          runs nothing, the table of the outcomes of earlier runs with --continue
//   --write          writes the tables to tests/firmware/world/README.md
//
// Exit code 1 if a case failed.
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "files/committed_figures.hpp"
#include "tests/firmware/world/scenarios.hpp"

namespace {

using namespace bms::world;

struct Scenario {
  const char* name;
  Result (*run)(const Extent&);
};
constexpr Scenario scenarios[] = {{"starts", run_starts},       {"contacts", run_contact_failures},
                                  {"dips", run_supply_dips},    {"faults", run_fault_matrix},
                                  {"overloads", run_overloads}, {"shift", run_shift}};

struct Options {
  Extent extent;
  std::string scenario;
  bool write = false;
};

Options read_options(const std::vector<std::string>& words) {
  Options options;
  options.extent.at_once = processors();
  for (std::size_t k = 0; k < words.size(); ++k) {
    const auto value = [&] {
      if (k + 1 == words.size()) throw std::invalid_argument(fmt::format("{} needs a value", words[k]));
      return words[++k];
    };
    if (words[k] == "--write") {
      options.write = true;
    } else if (words[k] == "--continue") {
      options.extent.continues = true;
    } else if (words[k] == "--known") {
      options.extent.only_kept = true;
    } else if (words[k] == "--from") {
      options.extent.from = std::stoul(value());
    } else if (words[k] == "--most") {
      options.extent.most = std::stoul(value());
    } else if (words[k] == "--within") {
      options.extent.within_minutes = std::stod(value());
    } else if (words[k] == "--count") {
      options.extent.count = std::stoul(value());
    } else if (words[k] == "--seed") {
      options.extent.seed = std::stoul(value());
    } else if (words[k] == "--only") {
      options.extent.only = value();
    } else if (words[k] == "--minutes") {
      options.extent.minutes = std::stod(value());
    } else if (words[k] == "--cells") {
      options.extent.cells = std::stoul(value());
    } else if (words[k] == "--jobs") {
      options.extent.at_once = static_cast<unsigned>(std::stoul(value()));
    } else {
      options.scenario = words[k];
    }
  }
  if (options.extent.cells != Extent{}.cells && options.scenario != "starts")
    throw std::invalid_argument("--cells is for the starts");
  return options;
}

}  // namespace

int main(int count, char** words) {
  try {
    const Options options = read_options({words + 1, words + count});
    unsigned failed = 0, cases = 0;
    for (const Scenario& scenario : scenarios) {
      if (!options.scenario.empty() && options.scenario != scenario.name) continue;
      const Result result = scenario.run(options.extent);
      failed += result.failed();
      cases += static_cast<unsigned>(result.outcomes.size());
      fmt::print("\n{}: {} cases, {} failed\n\n{}\n", result.name, result.outcomes.size(), result.failed(),
                 result.table);
      std::fflush(stdout);
      if (options.write) {
        bms::files::replace_figures(BMS_SOURCE_DIR "/tests/firmware/world/README.md", result.name, result.table);
      }
    }
    if (cases == 0) throw std::invalid_argument(fmt::format("no cases of '{}'", options.scenario));
    return failed == 0 ? 0 : 1;
  } catch (const std::exception& e) {
    fmt::print(stderr, "world_matrix: {}\n", e.what());
    return 3;
  }
}
