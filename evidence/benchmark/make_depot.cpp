// Writes a synthetic depot (truth/depot.hpp) as files: recordings, a cell file for each truck, the manifest that
// `bms fleet run` reads, and the answer.
//
//   make_depot FOLDER --seed 1 [--trucks 50 --cells 16 --days 30 --hours 3 --step 2]
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "benchmark/truth/case_files.hpp"
#include "benchmark/truth/depot.hpp"

namespace {

using namespace bms::benchmark::truth;
namespace fs = std::filesystem;

constexpr std::time_t first_day_s = 1'772'690'400;  // 2026-03-05 06:00 UTC
constexpr std::time_t day_s = 86'400;

void write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream out(path, std::ios::binary);
  out << text;
  out.close();
  if (!out) throw std::runtime_error(path.string() + " cannot be written");
}

/// A log of the field has no reference of the state of charge.
std::string without_reference(const std::string& csv) {
  std::string text;
  for (std::size_t at = 0; at < csv.size();) {
    const std::size_t end = csv.find('\n', at), comma = csv.rfind(',', end);
    text += csv.substr(at, comma - at) + '\n';
    at = end + 1;
  }
  return text;
}

void make(const fs::path& folder, const DepotSize& size, std::uint64_t seed) {
  const Depot depot(size, seed);
  std::string manifest = "recording,cell,truck,cell_index,started_at\n";
  for (std::size_t t = 0; t < size.trucks; ++t) {
    const std::string truck = fmt::format("truck_{:02}", t + 1);
    write(folder / truck / "cell.toml", cell_toml(depot.cell_file(t), truck));
    for (std::size_t c = 0; c < size.cells; ++c) {
      for (std::size_t d = 0; d < size.days; ++d) {
        const std::string name = fmt::format("{0}/day_{1:02}_cell_{2:02}.csv", truck, d + 1, c + 1);
        write(folder / name, without_reference(csv_of(depot.recording(t, c, d))));
        manifest += fmt::format("{0},{1}/cell.toml,{1},{2},{3:%Y-%m-%dT%H:%M:%SZ}\n", name, truck, c + 1,
                                fmt::gmtime(first_day_s + day_s * static_cast<std::time_t>(d)));
      }
    }
  }
  std::string answer = "truck,cell_index,cause,onset\n";
  for (const PlantedFault& f : depot.faults())
    answer +=
        fmt::format("truck_{:02},{},{},{:%Y-%m-%d}\n", f.truck + 1, f.whole_truck ? "" : fmt::format("{}", f.cell + 1),
                    f.cause, fmt::gmtime(first_day_s + day_s * static_cast<std::time_t>(f.onset_day)));
  write(folder / "answer.csv", answer);
  write(folder / "manifest.csv", manifest);
}

}  // namespace

int main(int argc, char** argv) {
  std::string folder;
  DepotSize size;
  std::uint64_t seed = 1;
  CLI::App app{"Writes a synthetic depot: recordings, cell files, manifest.csv and answer.csv"};
  app.add_option("folder", folder, "where it is written")->required();
  app.add_option("--seed", seed, "of all random numbers")->capture_default_str();
  app.add_option("--trucks", size.trucks, "at least 5")->check(CLI::Range(5, 1'000))->capture_default_str();
  app.add_option("--cells", size.cells, "of each truck")->check(CLI::Range(1, 100))->capture_default_str();
  app.add_option("--days", size.days, "a shift each")->check(CLI::Range(1, 1'000))->capture_default_str();
  app.add_option("--hours", size.hours, "of a shift")->check(CLI::Range(0.2, 24.0))->capture_default_str();
  app.add_option("--step", size.step_s, "sampling step in s")->check(CLI::Range(0.5, 60.0))->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    make(folder, size, seed);
  } catch (const std::exception& error) {
    fmt::print(stderr, "make_depot: {}\n", error.what());
    return 3;
  }
  return 0;
}
