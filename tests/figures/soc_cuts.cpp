// The estimator started at 30 places of each real recording: right, wrong and unknown (host_sim/replay/cuts.hpp).
//
//   soc_cuts                    prints the tables of all recordings
//   soc_cuts NAME...            of the recordings whose file name contains a NAME; "shift" is the shipped one
//   soc_cuts --cell FILE NAME   with another cell file
//   soc_cuts --write            writes the tables of all recordings into docs/figures/soc_trials.md
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "files/cell_file.hpp"
#include "files/committed_figures.hpp"
#include "files/recording.hpp"
#include "measurement/recording.hpp"
#include "replay/cuts.hpp"

namespace bms {
namespace {

constexpr std::size_t cuts = 30;
const std::filesystem::path source = BMS_SOURCE_DIR, data = BMS_DATA_DIR;

struct Case {
  std::filesystem::path recording;
  std::string cell;
  bool ends_empty = false;  ///< with a rest, which is a second reference
};

/// From cold to hot; then those of 25 degrees C that no cell file was identified from.
std::vector<Case> cases() {
  std::vector<Case> all;
  for (const char* name : {"dyn10_N15_A002", "dyn10_N05_A002", "dyn10_P05_A002", "dyn10_P15_A002", "dyn20_P25_A002",
                           "dyn10_P45_A002", "udds_P25_A002", "fsae_P25_A004", "hwycol_P25_A004"})
    all.push_back({data / "a123_26650" / (std::string(name) + ".csv"), "a123_26650_extended",
                   std::string_view(name).ends_with("A004")});
  for (const char* name : {"dyn30_N05", "dyn45_P05", "dyn50_P25"})
    all.push_back({data / "a123_esctoolbox" / (std::string(name) + ".csv"), "a123_esctoolbox_extended"});
  all.push_back({source / "evidence/recordings/forklift_shift.csv", "table9"});
  return all;
}

bool chosen(const Case& c, const std::vector<std::string>& names) {
  if (names.empty()) return true;
  for (const std::string& name : names) {
    if (c.recording.filename().string().find(name) != std::string::npos) return true;
  }
  return false;
}

/// The SOC at which a slow discharge had this voltage.
double soc_on(const measurement::Recording& slow_discharge, double voltage_v) {
  std::size_t row = 0;
  while (row + 1 < slow_discharge.rows() && slow_discharge.voltage_v[row] > voltage_v) ++row;
  return slow_discharge.soc_ref[row];
}

/// The reference of `fsae` and `hwycol` takes a capacity of 2.55 Ah for another specimen than that of the other
/// recordings (README of the recordings). Both end with an hour of rest near empty, where the OCV is steep: the slow
/// discharge has that voltage at another SOC. This scales the charge that was counted, so that it ends there.
measurement::Recording ending_at_its_last_rest(measurement::Recording r) {
  const double end = soc_on(files::read_recording((data / "a123_26650/ocv_P25_dis.csv").string()), r.voltage_v.back()),
               scale = (1 - end) / (1 - r.soc_ref.back());
  for (double& soc : r.soc_ref.edit()) soc = 1 - scale * (1 - soc);
  r.path = std::filesystem::path(r.path).replace_extension().string() + " (last rest).csv";
  return r;
}

struct Options {
  bool write = false;
  std::string cell;
  std::vector<std::string> names;
};

int run(const Options& options) {
  std::vector<replay::CutResult> results, by_last_rest;
  std::string table = replay::cut_heading();
  if (!options.write) fmt::print("{}", table);
  for (const Case& c : cases()) {
    if (!std::filesystem::exists(c.recording) || !chosen(c, options.names)) continue;
    const files::CellFile cell = files::read_cell(options.cell.empty() ? c.cell : options.cell);
    const measurement::Recording recording = files::read_recording(c.recording.string());
    results.push_back(replay::run_cuts(cell, recording, cuts));
    std::string rows = replay::cut_rows(results.back());
    by_last_rest.push_back(c.ends_empty ? replay::run_cuts(cell, ending_at_its_last_rest(recording), cuts)
                                        : results.back());
    if (c.ends_empty) rows += replay::cut_rows(by_last_rest.back());
    table += rows;
    if (!options.write) fmt::print("{}", rows);
    std::fflush(stdout);
  }
  if (results.empty()) {
    fmt::print(stderr, "soc_cuts: no recording, expected {} or another name\n", data.string());
    return 2;
  }
  const std::string summary = replay::cut_summary(results), better = replay::cut_summary(by_last_rest),
                    calibration = replay::calibration_table(by_last_rest);
  if (options.write) {
    const auto page = source / "docs/figures/soc_trials.md";
    files::replace_figures(page, "cuts", table);
    files::replace_figures(page, "all cuts", summary);
    files::replace_figures(page, "all cuts by last rest", better);
    files::replace_figures(page, "calibration", calibration);
  } else {
    fmt::print("\n{}\nby the last rest:\n{}\n{}", summary, better, calibration);
  }
  return 0;
}

}  // namespace
}  // namespace bms

int main(int argc, char** argv) {
  bms::Options options;
  for (int k = 1; k < argc; ++k) {
    const std::string_view word = argv[k];
    if (word == "--write")
      options.write = true;
    else if (word == "--cell" && k + 1 < argc)
      options.cell = argv[++k];
    else
      options.names.emplace_back(word);
  }
  try {
    return bms::run(options);
  } catch (const std::exception& e) {
    fmt::print(stderr, "soc_cuts: {}\n", e.what());
    return 2;
  }
}
