// The concealed benchmark: runs the diagnosis and simpler rules on every case of a split, prints a line per case and
// then the tables.
//
// Exit code: 0 done; 2 bad usage; 3 internal error
#include <cstdio>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "benchmark/baselines.hpp"
#include "benchmark/tables.hpp"
#include "files/bad_input.hpp"
#include "files/committed_figures.hpp"
#include "files/run_program.hpp"
#include "files/text_file.hpp"
#include "numerics/in_parallel.hpp"

namespace {

namespace truth = bms::benchmark::truth;
using bms::benchmark::Column;
using bms::benchmark::Outcome;

struct Options {
  std::string split;
  std::uint64_t seed = 1;
  std::size_t first = 0;
  std::optional<std::size_t> count;
  bool no_baselines = false, no_experiments = false;
  std::string kind;
  std::string json, readme;
};

std::string joined(const std::vector<std::string>& ids, const char* by) {
  std::string text;
  for (const std::string& id : ids) text += (text.empty() ? "" : by) + id;
  return text;
}

std::string joined_sets(const std::vector<std::vector<std::string>>& sets) {
  std::string text;
  for (const auto& set : sets) text += (text.empty() ? "" : " + ") + joined(set, "~");
  return text;
}

std::string line_of(std::size_t index, const Outcome& o) {
  std::string line = fmt::format(
      "{:3} {:10} {:40} x{:<5.1f} {:16} -> {:13} {:50} iou {:.2f} hold {:.1f}->{:.1f} ({:.1f}) mV {:.1f} s  {}\n",
      index, truth::name_of(o.answer.kind), joined(o.answer.ids, "+"), o.answer.strength, o.answer.profile,
      bms::diagnosis::name_of(o.verdict), joined_sets(o.sets), o.overlap, 1e3 * o.holdout_before_v,
      1e3 * o.holdout_after_v, 1e3 * o.holdout_floor_v, o.wall_s, o.figures);
  if (o.next) {
    for (const bms::benchmark::Round& r : o.next->rounds)
      line += fmt::format("{:3} {:10} {:40} next: {} ({:.1f} h, gain {:.0f}, planned in {:.1f} s) -> {} {}\n", index,
                          "", joined(o.answer.ids, "+"), r.profile, r.duration_s / 3'600, r.expected_gain,
                          r.plan_wall_s, bms::diagnosis::name_of(r.verdict), joined_sets(r.sets));
    line += fmt::format("{:3} {:10} {:40} end: {}{}\n", index, "", joined(o.answer.ids, "+"),
                        bms::benchmark::end_of(*o.next),
                        o.next->separated ? "" : "; the first experiment has not separated");
  }
  return line;
}

nlohmann::ordered_json json_of(const bms::benchmark::FollowUp& up) {
  nlohmann::ordered_json rounds = nlohmann::ordered_json::array();
  for (const bms::benchmark::Round& r : up.rounds) {
    rounds.push_back({{"profile", r.profile},
                      {"duration_s", r.duration_s},
                      {"expected_gain", r.expected_gain},
                      {"verdict", bms::diagnosis::name_of(r.verdict)},
                      {"sets", r.sets}});
  }
  return {{"rounds", rounds},
          {"end", bms::benchmark::end_of(up)},
          {"separated", up.separated},
          {"decided_at_once", up.decided_at_once},
          {"right_at_once", up.right_at_once},
          {"decided", up.decided},
          {"right", up.right},
          {"nothing_more", up.nothing_more}};
}

std::string json_of(const Options& options, const std::vector<Column>& columns) {
  using Json = nlohmann::ordered_json;
  Json json;
  json["split"] = options.split;
  json["seed"] = options.seed;
  json["first"] = options.first;
  const bool all = options.kind.empty() && !options.no_experiments &&
                   columns.front().outcomes.size() ==
                       truth::case_count(options.split == "final" ? truth::Split::final : truth::Split::development);
  if (all) json["on"] = fmt::format("{} {}", options.split, options.seed);
  for (const bms::benchmark::Figure& f : bms::benchmark::figures_of(bms::benchmark::score(columns.front().outcomes))) {
    Json figure = {{"name", f.name}};
    if (f.share.of > 0)
      figure.update({{"hits", f.share.hits}, {"of", f.share.of}});
    else
      figure["value"] = f.value;
    json["figures"].push_back(figure);
  }
  for (const Column& c : columns) {
    Json& list = json["methods"][c.method] = Json::array();
    for (const Outcome& o : c.outcomes) {
      Json after;
      if (o.next) after = json_of(*o.next);
      list.push_back({{"kind", truth::name_of(o.answer.kind)},
                      {"ids", o.answer.ids},
                      {"strength", o.answer.strength},
                      {"profile", o.answer.profile},
                      {"verdict", bms::diagnosis::name_of(o.verdict)},
                      {"found", o.found},
                      {"sets", o.sets},
                      {"probability", o.probability},
                      {"overlap", o.overlap},
                      {"holdout_before_v", o.holdout_before_v},
                      {"holdout_after_v", o.holdout_after_v},
                      {"holdout_floor_v", o.holdout_floor_v},
                      {"wall_s", o.wall_s},
                      {"figures", o.figures},
                      {"experiments", after}});
    }
  }
  return json.dump(1) + "\n";
}

void run(const Options& options) {
  const truth::Split split = options.split == "final" ? truth::Split::final : truth::Split::development;
  const std::size_t cases = truth::case_count(split);
  if (options.first >= cases) throw bms::files::BadInput("--first", 1, fmt::format("there are {} cases", cases));
  const std::size_t count = std::min(options.count.value_or(cases), cases - options.first);
  // a run takes long: check first that the file has a place for the tables
  if (!options.readme.empty()) bms::files::CommittedFigures(options.readme, options.split);

  std::vector<Column> columns;
  for (const auto& method : bms::benchmark::methods) {
    columns.push_back({method.name, std::vector<Outcome>(count)});
    if (options.no_baselines) break;
  }
  std::mutex printing;
  bms::numerics::in_parallel(count, [&](std::size_t k) {
    const truth::Case c = truth::make_case(split, options.seed, options.first + k);
    if (!options.kind.empty() && options.kind != truth::name_of(c.answer.kind)) return;
    for (std::size_t m = 0; m < columns.size(); ++m) {
      const bool alone = m == 0 && options.no_experiments;
      columns[m].outcomes[k] = alone ? bms::benchmark::run_case_alone(c) : bms::benchmark::methods[m].run(c);
    }
    const std::scoped_lock lock(printing);
    fmt::print("{}", line_of(options.first + k, columns.front().outcomes[k]));
    std::fflush(stdout);
  });

  for (Column& c : columns) std::erase_if(c.outcomes, [](const Outcome& o) { return o.name.empty(); });
  const std::string report = bms::benchmark::report(options.split, options.seed, columns);
  fmt::print("\n{}", report);
  if (!options.json.empty()) bms::files::write_file(options.json, json_of(options, columns));
  if (!options.readme.empty()) bms::files::replace_figures(options.readme, options.split, report);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Run the diagnosis and simpler rules on concealed cases and score their answers"};
  app.name("benchmark");
  app.footer("Example: benchmark development 1 --readme docs/figures/benchmark.md");
  Options o;
  app.add_option("split", o.split, "development: cases for development; final: cases that are run once")
      ->required()
      ->check(CLI::IsMember({"development", "final"}));
  app.add_option("seed", o.seed, "seed of the cases")->required()->type_name("SEED");
  app.add_option("--first", o.first, "index of the first case")->capture_default_str();
  app.add_option("--count", o.count, "number of cases; default: all from the first on")->check(CLI::PositiveNumber);
  app.add_option("--kind", o.kind, "run only cases of this kind")
      ->check(CLI::IsMember(std::vector<std::string>(truth::case_kinds.begin(), truth::case_kinds.end())));
  app.add_flag("--no-baselines", o.no_baselines, "run only the diagnosis");
  app.add_flag("--no-experiments", o.no_experiments,
               "run none of the experiments that an ambiguous diagnosis proposes");
  app.add_option("--json", o.json, "write every outcome to FILE")->type_name("FILE");
  app.add_option("--readme", o.readme,
                 "write the tables to FILE, between '<!-- figures: SPLIT -->' and '<!-- end of figures -->'")
      ->type_name("FILE");
  return bms::files::run_program(app, argc, argv, [&] { run(o); });
}
