// Diagnoses simulated packs of 3 to 24 cells whose logs have rows of 1 to 30 s, under four kinds of load, and scores
// the answers.
//
//   slow_packs SEED [--sets 1] [--first 0] [--rows S] [--load NAME] [--only FAULT] [--json FILE] [--figures FILE]
//              [--write FOLDER]
//
// A set has for each of five intervals and four loads five packs with one fault each and five healthy ones: 200. In
// half of them the current of a row is a single reading, not the mean of the row: of each fault, load and interval.
#include <array>
#include <atomic>
#include <cmath>
#include <mutex>
#include <thread>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "benchmark/pack_run.hpp"
#include "benchmark/truth/case_files.hpp"
#include "files/committed_figures.hpp"
#include "files/run_program.hpp"
#include "files/text_file.hpp"
#include "measurement/statistics.hpp"

namespace {

namespace truth = bms::benchmark::truth;
using bms::benchmark::PackOutcome;

constexpr std::array<double, 5> intervals_s = {1, 2, 5, 10, 30};
constexpr std::array<std::array<const char*, 2>, 5> faults = {{{"joint_resistance", "joint_resistance"},
                                                               {"capacity_change", "capacity_change"},
                                                               {"charge_imbalance", "charge_imbalance"},
                                                               {"sense_wire", "sense_wire"},
                                                               {"voltage_offset", "voltage_gain"}}};

struct Options {
  std::uint64_t seed = 1;
  std::size_t sets = 1, first = 0;
  unsigned jobs = 1;
  double rows_s = 0;
  std::string load, only, json, figures, write;
};

struct Case {
  std::size_t index = 0;
  truth::SlowLog log;
  std::string fault;  ///< empty: healthy
  PackOutcome outcome;
};

/// Slow rows need a day for as many changes of the current as rows of 1 s have in hours.
double hours_for(double rows_s) {
  if (rows_s > 10) return 24;
  return rows_s > 2 ? 8 : 3;
}

/// What a pack of a set is, by the numbers of its interval, load and fault. The kind of the current and the variant of
/// the fault change with different digits of them: of each fault, each load and each interval, about half a set has
/// either kind, and of each kind either variant; four sets have all of each pack.
struct Place {
  std::size_t set, interval, load, fault;

  bool samples_current() const { return (set + interval + load + fault) % 2 == 1; }
  std::size_t variant() const { return (set / 2 + interval / 2 + load / 2) % 2; }
};

std::vector<Case> cases_of(const Options& o) {
  std::vector<Case> cases;
  std::size_t index = o.first * intervals_s.size() * truth::all_pack_loads.size() * faults.size();
  for (std::size_t set = o.first; set < o.first + o.sets; ++set) {
    for (std::size_t interval = 0; interval < intervals_s.size(); ++interval) {
      for (std::size_t of_load = 0; of_load < truth::all_pack_loads.size(); ++of_load) {
        for (std::size_t fault = 0; fault < faults.size(); ++fault) {
          const std::size_t now = index++;
          const Place place{set, interval, of_load, fault};
          const double rows_s = intervals_s[interval];
          const truth::PackLoad load = truth::all_pack_loads[of_load];
          const std::string wanted = faults[fault][place.variant()];
          if ((o.rows_s > 0 && o.rows_s != rows_s) || (!o.load.empty() && o.load != name_of(load))) continue;
          if (!o.only.empty() && o.only != wanted && o.only != "healthy") continue;
          const truth::SlowLog log{
              .load = load, .rows_s = rows_s, .hours = hours_for(rows_s), .samples_current = place.samples_current()};
          if (o.only != "healthy") cases.push_back({now, log, wanted, {}});
          if (o.only.empty() || o.only == "healthy") cases.push_back({now, log, "", {}});
        }
      }
    }
  }
  return cases;
}

void diagnose(const Options& o, Case& c) {
  truth::PackCase pack = truth::make_slow_pack(o.seed, c.index, c.fault.empty(), c.fault, c.log);
  pack.name += fmt::format(", rows of {:g} s, {}, {}", c.log.rows_s, name_of(c.log.load),
                           c.log.samples_current ? "readings" : "means");
  if (!o.write.empty()) {
    const std::string place = fmt::format("{}/{}_{}", o.write, c.index + 1, c.fault.empty() ? "healthy" : c.fault);
    bms::files::write_file(place + ".csv", truth::csv_of(pack.recording));
    bms::files::write_file(place + ".toml", truth::cell_toml(pack.cell, "pack"));
  }
  c.outcome = bms::benchmark::run_pack(pack, false);
}

struct Count {
  std::size_t packs = 0, wrong = 0, healthy = 0, in_peace = 0, above = 0, right = 0, listed = 0, below = 0, sized = 0;
  std::vector<double> ratios, pulls;

  void add(const Case& c) {
    const PackOutcome& o = c.outcome;
    ++packs;
    wrong += o.wrong.empty() ? 0 : 1;
    if (c.fault.empty()) {
      ++healthy;
      in_peace += o.wrong.empty() ? 1 : 0;
    }
    for (const auto& p : o.planted) {
      if (p.fault.id != c.fault) continue;
      (p.below ? below : above) += 1;
      right += p.named ? 1 : 0;
      listed += p.listed ? 1 : 0;
      if (!p.named) continue;
      sized += std::abs(p.pull) <= 2 ? 1 : 0;
      ratios.push_back(p.found / p.fault.size);
      pulls.push_back(p.pull * p.pull);
    }
  }

  std::string row(const std::string& name) const {
    const bool any = !ratios.empty();
    return fmt::format("| {} | {} | {} | {} of {} | {} + {} of {} | {} | {} of {} | {} | {} |\n", name, packs, wrong,
                       in_peace, healthy, right, listed, above, below, sized, ratios.size(),
                       any ? fmt::format("{:.2f}", bms::measurement::median(ratios)) : "",
                       any ? fmt::format("{:.1f}", std::sqrt(bms::measurement::mean(pulls))) : "");
  }
};

std::string table_of(const std::vector<Case>& cases, std::uint64_t seed) {
  std::string text = fmt::format("Seed {}.\n\n", seed) +
                     "| packs | number | something wrong named | healthy, in peace | right + listed, of faults above "
                     "the stated limit or found | below the limit, not found | size within 2 sigma | found over "
                     "planted, median | RMS of (found - planted) / sigma |\n|---|---|---|---|---|---|---|---|---|\n";
  const auto add = [&](const std::string& name, auto belongs) {
    Count count;
    for (const Case& c : cases) {
      if (belongs(c)) count.add(c);
    }
    if (count.packs > 0) text += count.row(name);
  };
  for (const double s : intervals_s)
    add(fmt::format("rows of {:g} s", s), [&](const Case& c) { return c.log.rows_s == s; });
  for (const truth::PackLoad load : truth::all_pack_loads)
    add(fmt::format("{}", name_of(load)), [&](const Case& c) { return c.log.load == load; });
  for (const auto& pair : faults) {
    for (std::size_t k = 0; k < 2; ++k) {
      if (k == 0 || pair[0] != std::string_view(pair[1]))
        add(fmt::format("`{}`", pair[k]), [&](const Case& c) { return c.fault == pair[k]; });
    }
  }
  add("current: means of the rows", [](const Case& c) { return !c.log.samples_current; });
  add("current: single readings", [](const Case& c) { return c.log.samples_current; });
  add("3 to 7 cells", [](const Case& c) { return c.outcome.cells < 8; });
  add("**all**", [](const Case&) { return true; });
  return text;
}

void run(const Options& o) {
  std::vector<Case> cases = cases_of(o);
  std::atomic<std::size_t> next = 0;
  std::mutex printing;
  const auto work = [&] {
    for (std::size_t k = next++; k < cases.size(); k = next++) {
      diagnose(o, cases[k]);
      const std::scoped_lock lock(printing);
      bms::benchmark::print(cases[k].outcome);
    }
  };
  std::vector<std::thread> threads;
  for (unsigned k = 0; k < o.jobs; ++k) threads.emplace_back(work);
  for (std::thread& t : threads) t.join();
  const std::string table = table_of(cases, o.seed);
  fmt::print("\n{}", table);
  std::vector<PackOutcome> outcomes;
  for (const Case& c : cases) outcomes.push_back(c.outcome);
  if (!o.json.empty()) bms::files::write_file(o.json, bms::benchmark::pack_json(outcomes));
  if (!o.figures.empty()) bms::files::replace_figures(o.figures, "slow_packs", table);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Diagnoses simulated packs whose logs have slow rows, and scores the answers"};
  app.name("slow_packs");
  app.footer("Example: slow_packs 1 --json slow_packs.json");
  Options o;
  app.add_option("seed", o.seed, "seed of the packs")->required()->type_name("SEED");
  app.add_option("--sets", o.sets, "sets of 200 packs")->capture_default_str();
  app.add_option("--first", o.first, "number of the first set")->capture_default_str();
  app.add_option("--rows", o.rows_s, "only rows of so many seconds")->type_name("SECONDS");
  app.add_option("--load", o.load, "only this load: shift, road, appliances, pump")->type_name("NAME");
  app.add_option("--only", o.only, "only packs with this fault, or only healthy ones: healthy")->type_name("FAULT");
  app.add_option("--jobs", o.jobs, "packs at the same time")->check(CLI::Range(1, 64))->capture_default_str();
  app.add_option("--json", o.json, "write every outcome to FILE")->type_name("FILE");
  app.add_option("--figures", o.figures, "write the table between '<!-- figures: slow_packs -->' and its end")
      ->type_name("FILE");
  app.add_option("--write", o.write, "write recordings and cell files to FOLDER")->type_name("FOLDER");
  return bms::files::run_program(app, argc, argv, [&] { run(o); });
}
