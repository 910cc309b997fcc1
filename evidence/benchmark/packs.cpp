// Diagnoses simulated packs (truth/packs.hpp) and scores the answers.
//
//   packs SEED [--faulty 60] [--healthy 60] [--first 0] [--only FAULT] [--rows S] [--reversed] [--json FILE]
//              [--readme FILE] [--write FOLDER]
#include <atomic>
#include <filesystem>
#include <mutex>
#include <thread>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "benchmark/pack_run.hpp"
#include "benchmark/pack_score.hpp"
#include "benchmark/truth/case_files.hpp"
#include "benchmark/truth/packs.hpp"
#include "files/committed_figures.hpp"
#include "files/run_program.hpp"
#include "files/text_file.hpp"

namespace {

namespace truth = bms::benchmark::truth;
using bms::benchmark::PackOutcome;

struct Options {
  std::uint64_t seed = 1;
  std::size_t faulty = 60, healthy = 60, first = 0;
  unsigned jobs = 1;
  double rows_s = 0;
  bool no_shared = false, reversed = false;
  std::string json, only, readme, write;
};

void write_case(const std::filesystem::path& folder, std::size_t k, const truth::PackCase& c) {
  const std::string name = fmt::format("{}_{}", c.name.ends_with("healthy") ? "healthy" : "pack", k + 1);
  bms::files::write_file((folder / (name + ".csv")).string(), truth::csv_of(c.recording));
  bms::files::write_file((folder / (name + ".toml")).string(), truth::cell_toml(c.cell, name));
}

/// Its current sensor is connected the wrong way round, in addition to its other faults.
void reverse(truth::PackCase& c) {
  for (double& a : c.recording.current_a) a = -a;
  c.faults.push_back({.id = "current_sign", .cell = {}, .size = 1});
}

void run(const Options& o) {
  const std::size_t count = o.faulty + o.healthy;
  std::vector<PackOutcome> outcomes(count);
  std::atomic<std::size_t> next = 0;
  std::mutex printing;
  const auto work = [&] {
    for (std::size_t k = next++; k < count; k = next++) {
      const bool healthy = k >= o.faulty;
      const std::size_t index = o.first + (healthy ? k - o.faulty : k);
      truth::PackCase c = truth::make_pack(o.seed, index, healthy, o.only);
      if (o.reversed) reverse(c);
      if (o.rows_s > 0) truth::slow_down(c.recording, o.rows_s);
      if (!o.write.empty()) write_case(o.write, index, c);
      outcomes[k] = bms::benchmark::run_pack(c, !o.no_shared);
      const std::scoped_lock lock(printing);
      bms::benchmark::print(outcomes[k]);
    }
  };
  std::vector<std::thread> threads;
  for (unsigned k = 0; k < o.jobs; ++k) threads.emplace_back(work);
  for (std::thread& t : threads) t.join();
  const std::string table = fmt::format("Seed {}.\n\n", o.seed) + bms::benchmark::pack_table(outcomes);
  fmt::print("\n{}", table);
  if (!o.json.empty()) bms::files::write_file(o.json, bms::benchmark::pack_json(outcomes));
  if (!o.readme.empty()) bms::files::replace_figures(o.readme, "packs", table);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Diagnoses simulated packs with planted faults, and healthy ones, and scores the answers"};
  app.name("packs");
  app.footer("Example: packs 1 --faulty 60 --healthy 60 --json packs.json");
  Options o;
  app.add_option("seed", o.seed, "seed of the packs")->required()->type_name("SEED");
  app.add_option("--faulty", o.faulty, "packs with one to three faults")->capture_default_str();
  app.add_option("--healthy", o.healthy, "packs without")->capture_default_str();
  app.add_option("--first", o.first, "index of the first pack")->capture_default_str();
  app.add_option("--only", o.only, "plant a single fault with this id in each pack")->type_name("FAULT");
  app.add_option("--jobs", o.jobs, "packs at the same time")->check(CLI::Range(1, 64))->capture_default_str();
  app.add_flag("--no-shared", o.no_shared, "do not diagnose the mean of the cells: faster");
  app.add_flag("--reversed", o.reversed, "reverse the sign of every current sensor");
  app.add_option("--rows", o.rows_s, "take a row every so many seconds; 0: as recorded")->type_name("SECONDS");
  app.add_option("--json", o.json, "write every outcome to FILE")->type_name("FILE");
  app.add_option("--readme", o.readme, "write the table between '<!-- figures: packs -->' and its end")
      ->type_name("FILE");
  app.add_option("--write", o.write, "write recordings and cell files to FOLDER")->type_name("FOLDER");
  return bms::files::run_program(app, argc, argv, [&] { run(o); });
}
