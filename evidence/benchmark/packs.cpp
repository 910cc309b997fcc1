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

#include "benchmark/pack_score.hpp"
#include "benchmark/truth/case_files.hpp"
#include "benchmark/truth/packs.hpp"
#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/committed_figures.hpp"
#include "files/text_file.hpp"
#include "workflow/pack_diagnosis.hpp"

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

bms::measurement::Recording recording_of(const truth::PackSeries& s) {
  bms::measurement::Recording r;
  r.time_s = s.time_s;
  r.current_a = s.current_a;
  for (const auto& v : s.cell_v) r.cell_voltage_v.emplace_back(v);
  for (const auto& t : s.sensor_c) r.cell_temperature_c.emplace_back(t);
  if (!s.pack_v.empty()) r.pack_voltage_v = s.pack_v;
  return r;
}

PackOutcome run_pack(const truth::PackCase& c, bool shared) {
  bms::workflow::PackOptions options;
  options.shared = shared;
  options.initial_soc = c.given_initial_soc;
  const auto cell = bms::files::parse_cell(truth::cell_toml(c.cell, "pack"), "pack");
  const bms::workflow::PackResult r = bms::workflow::diagnose_pack(cell, recording_of(c.recording), options);
  PackOutcome o = bms::benchmark::score_pack(c, r.diagnosis);
  o.wall_s = r.wall_s;
  return o;
}

const char* word_for(const bms::benchmark::PlantedOutcome& p) {
  if (p.named) return "right ";
  return p.listed ? "listed" : "missed";
}

void print(const PackOutcome& o) {
  fmt::print("{} ({} cells, {:.0f} h, {:.0f} s): {}\n", o.name, o.cells, o.hours, o.wall_s, o.verdict);
  for (const auto& p : o.planted)
    fmt::print("  {} {} {} {:.4g} (limit {:.4g}){}\n", word_for(p), p.fault.id,
               p.fault.cell ? fmt::format("{}", *p.fault.cell + 1) : "-", p.fault.size, p.limit,
               p.named ? fmt::format(", found {:.4g}, {:+.1f} sigma", p.found, p.pull) : "  " + p.instead);
  for (const std::string& text : o.wrong) fmt::print("  wrong {}\n", text);
  std::fflush(stdout);
}

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

/// Rows of `rows_s`: voltages and temperatures of their last moment, the mean of the current.
void slow_down(truth::PackSeries& s, double rows_s) {
  truth::PackSeries slow = s;
  const auto of_rows = [&](const std::vector<double>& column, bool mean) {
    std::vector<double> values;
    double sum = 0, count = 0, since_s = s.time_s.front();
    for (std::size_t k = 0; k < column.size(); ++k) {
      sum += column[k];
      ++count;
      if (s.time_s[k] - since_s < rows_s && k > 0) continue;
      values.push_back(mean ? sum / count : column[k]);
      sum = count = 0;
      since_s = s.time_s[k];
    }
    return values;
  };
  slow.time_s = of_rows(s.time_s, false);
  slow.current_a = of_rows(s.current_a, true);
  for (auto* columns : {&slow.cell_v, &slow.sensor_c})
    for (auto& column : *columns) column = of_rows(column, false);
  slow.pack_v = of_rows(s.pack_v, false);
  s = std::move(slow);
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
      if (o.rows_s > 0) slow_down(c.recording, o.rows_s);
      if (!o.write.empty()) write_case(o.write, index, c);
      outcomes[k] = run_pack(c, !o.no_shared);
      const std::scoped_lock lock(printing);
      print(outcomes[k]);
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
  CLI11_PARSE(app, argc, argv);
  try {
    run(o);
    return 0;
  } catch (const bms::files::BadInput& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "packs: {}\n", error.what());
    return 3;
  }
}
