// Effects that no catalogue contains, at twice the detection limit and above: what is said of the law that they act on,
// and what the term that is learned for it is worth on a hold-out.
//
// Exit code: 0 done; 2 bad usage; 3 internal error
#include <cstdio>
#include <mutex>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "benchmark/law_score.hpp"
#include "files/run_program.hpp"
#include "files/text_file.hpp"
#include "numerics/in_parallel.hpp"

namespace {

namespace truth = bms::benchmark::truth;
using bms::benchmark::Outcome;

struct Options {
  std::string split, only, json;
  std::uint64_t seed = 1;
  std::size_t cases = 42, first = 0;
};

std::string line_of(std::size_t index, const Outcome& o) {
  std::string found, laws;
  for (const std::string& id : o.found) found += (found.empty() ? "" : " + ") + id;
  for (const std::string& law : o.answer.laws) laws += (laws.empty() ? "" : "/") + law;
  return fmt::format(
      "{:3} {:22} x{:<4.1f} {:14} {:11} {:24} law {:10} ({}){} hold {:.1f}->{:.1f} ({:.1f}{}) mV{} {:.0f} s  {}\n",
      index, o.answer.ids.front(), o.answer.strength, o.answer.profile, bms::diagnosis::name_of(o.verdict), found,
      o.law.empty() ? "-" : o.law, laws, o.law.empty() || bms::benchmark::names_right_law(o) ? "" : " WRONG",
      1e3 * o.holdout_before_v, 1e3 * o.holdout_after_v, 1e3 * o.holdout_floor_v,
      bms::benchmark::shows_in_holdout(o) ? ", shows" : "", bms::benchmark::cuts_holdout(o) ? " CUT" : "", o.wall_s,
      o.figures);
}

std::string json_of(const Options& options, const std::vector<Outcome>& outcomes) {
  const bms::benchmark::LawScore s = bms::benchmark::law_score(outcomes);
  const auto figure = [](const char* name, const bms::benchmark::Share& share) -> nlohmann::ordered_json {
    return {{"name", name}, {"hits", share.hits}, {"of", share.of}};
  };
  const char* const part = options.first > 0 || !options.only.empty() ? ", a part" : "";
  const nlohmann::ordered_json json = {
      {"on", fmt::format("outside {} {}, {} cases{}", options.split, options.seed, options.cases, part)},
      {"figures",
       {figure("law of an unknown cause right", s.law),
        figure("hold-out error above the floor halved by a learned term", s.cut)}}};
  return json.dump(1) + "\n";
}

void run(const Options& options) {
  const truth::Split split = options.split == "final" ? truth::Split::final : truth::Split::development;
  std::vector<Outcome> outcomes(options.cases);
  std::mutex printing;
  bms::numerics::in_parallel(options.cases, [&](std::size_t k) {
    const truth::Case c = truth::make_outside_case(split, options.seed, options.first + k);
    if (c.answer.ids.front().find(options.only) == std::string::npos || c.answer.strength < 2) return;
    outcomes[k] = bms::benchmark::run_case_with_experiments(c);
    const std::scoped_lock lock(printing);
    fmt::print("{}", line_of(options.first + k, outcomes[k]));
    std::fflush(stdout);
  });
  std::erase_if(outcomes, [](const Outcome& o) { return o.name.empty(); });
  fmt::print("\n{} split, seed {}, {} cases. In brackets: Wilson's 95 % interval.\n\n{}", options.split, options.seed,
             outcomes.size(), bms::benchmark::law_table(outcomes));
  if (!options.json.empty()) bms::files::write_file(options.json, json_of(options, outcomes));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Diagnose effects that no catalogue contains, and score the law that is named and the term for it"};
  app.name("outside");
  app.footer("Example: outside development 5");
  Options o;
  app.add_option("split", o.split, "development or final")->required()->check(CLI::IsMember({"development", "final"}));
  app.add_option("seed", o.seed, "seed of the cases")->required();
  app.add_option("--cases", o.cases, "number of cases; effects follow each other in turn")->capture_default_str();
  app.add_option("--first", o.first, "index of the first case")->capture_default_str();
  app.add_option("--only", o.only, "run only effects whose name contains TEXT")->type_name("TEXT");
  app.add_option("--json", o.json, "write the figures that have a target to FILE")->type_name("FILE");
  return bms::files::run_program(app, argc, argv, [&] { run(o); });
}
