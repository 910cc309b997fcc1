// Runs the flashed image of the forklift board in the circuit of a truck: ./bms world [SCENARIO] [OPTIONS]
//
//   SCENARIO         starts, contacts, dips, faults, overloads, shift, charges, month or groups; all if not
//                    given
//   --count N        so many worlds or cases instead of all
//   --seed N         of the random worlds
//   --only TEXT      cases whose names contain TEXT, or one of several texts, separated by |
//   --minutes N      duration of the shift
//   --days N         of each truck of the month; --count is the number of trucks
//   --cells N        in series, of another number than 16; the chargers have 16
//   --jobs N         cases at a time
//   --continue       takes the good outcomes of earlier runs with this option, of the same image and seed
//   --from N         leaves the first N cases to other parts
//   --most N         runs at most N cases
//   --within N       starts no case after N minutes
//   --known          runs nothing, the table of the outcomes of earlier runs with --continue
//   --write          writes the tables to tests/firmware/world/README.md
//   --json FILE      writes the counts of the scenarios that were run as one JSON object; - for standard output
//   --quiet          prints no tables
//
// Exit code 1 if a case failed.
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "files/committed_figures.hpp"
#include "files/text_file.hpp"
#include "tests/firmware/world/scenarios.hpp"

namespace {

using namespace bms::world;

struct Scenario {
  const char* name;
  Result (*run)(const Extent&);
};
constexpr Scenario scenarios[] = {{"starts", run_starts},       {"contacts", run_contact_failures},
                                  {"dips", run_supply_dips},    {"faults", run_fault_matrix},
                                  {"overloads", run_overloads}, {"shift", run_shift},
                                  {"charges", run_charges},     {"month", run_month},
                                  {"groups", run_groups}};

struct Options {
  Extent extent;
  std::string scenario, json;
  bool write = false, quiet = false;
};

/// The counts of a scenario, under the names on which other programs rely.
void add_counts(const Result& r, nlohmann::ordered_json& json) {
  const std::size_t tried = r.outcomes.size(), failed = r.failed();
  if (r.name.starts_with("starts")) json["drives"] = {{"tried", tried}, {"drove", tried - failed}};
  if (r.name.starts_with("supply dips")) json["dips"] = {{"tried", tried}, {"unsafe", failed}};
  if (r.name.starts_with("fault matrix")) {
    double missed = 0, falsely = 0;
    for (const Outcome& o : r.outcomes) {
      missed += o.value("missed", 0);
      falsely += o.value("false", 0);
    }
    json["matrix"] = {{"cases", tried}, {"missed", missed}, {"false", falsely}, {"failed", failed}};
  }
  if (r.name.starts_with("overloads")) {
    json["overloads"] = nlohmann::ordered_json::array();
    for (const Outcome& o : r.outcomes) {
      const double opened_s = o.value("opened", -1);
      json["overloads"].push_back(
          {{"name", o.name},
           {"times_limit", o.value("times_limit", 0)},
           {"opened_after_s", opened_s < 0 ? nlohmann::ordered_json() : nlohmann::ordered_json(opened_s)},
           {"cause", o.text("published")}});
    }
  }
  json["failed"][r.name] = failed;
}

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
    } else if (words[k] == "--json") {
      options.json = value();
    } else if (words[k] == "--quiet") {
      options.quiet = true;
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
    } else if (words[k] == "--days") {
      options.extent.days = std::stoul(value());
    } else if (words[k] == "--cells") {
      options.extent.cells = std::stoul(value());
    } else if (words[k] == "--jobs") {
      options.extent.at_once = static_cast<unsigned>(std::stoul(value()));
    } else {
      options.scenario = words[k];
    }
  }
  if (options.extent.cells != Extent{}.cells &&
      (options.scenario.empty() || options.scenario == "charges" || options.scenario == "groups"))
    throw std::invalid_argument("--cells is for one scenario, and not for charges and groups");
  return options;
}

}  // namespace

int main(int count, char** words) {
  try {
    const Options options = read_options({words + 1, words + count});
    unsigned failed = 0, cases = 0;
    nlohmann::ordered_json json = {{"command", "world"}, {"seed", options.extent.seed}};
    for (const Scenario& scenario : scenarios) {
      if (!options.scenario.empty() && options.scenario != scenario.name) continue;
      const Result result = scenario.run(options.extent);
      failed += result.failed();
      cases += static_cast<unsigned>(result.outcomes.size());
      add_counts(result, json);
      if (!options.quiet)
        fmt::print("\n{}: {} cases, {} failed\n\n{}\n", result.name, result.outcomes.size(), result.failed(),
                   result.table);
      std::fflush(stdout);
      if (options.write) {
        bms::files::replace_figures(BMS_SOURCE_DIR "/tests/firmware/world/README.md", result.name, result.table);
      }
    }
    if (cases == 0) throw std::invalid_argument(fmt::format("no cases of '{}'", options.scenario));
    if (options.json == "-")
      fmt::print("{}\n", json.dump(1));
    else if (!options.json.empty())
      bms::files::write_file(options.json, json.dump(1) + "\n");
    return failed == 0 ? 0 : 1;
  } catch (const std::exception& e) {
    fmt::print(stderr, "world_matrix: {}\n", e.what());
    return 3;
  }
}
