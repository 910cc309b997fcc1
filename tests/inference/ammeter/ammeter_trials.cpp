// bms ammeter on real recordings into which known errors of the current sensor are put.
//
//   ammeter_trials          prints the tables
//   ammeter_trials NAME...  of the recordings whose file name contains a NAME
//   ammeter_trials --write  writes them into docs/figures/ammeter_trials.md
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "ammeter/ammeter.hpp"
#include "files/committed_figures.hpp"
#include "files/recording.hpp"

namespace bms {
namespace {

using ammeter::Ammeter;
using ammeter::SensorFinding;

const std::filesystem::path source = BMS_SOURCE_DIR, data = BMS_DATA_DIR;
constexpr double most_sigmas = 3;  ///< an answer that is further off is wrong

struct Case {
  std::filesystem::path recording;
  std::string cell;
  const char* remark;
};

std::vector<Case> cases() {
  std::vector<Case> all;
  const auto add = [&](const char* folder, const char* cell, const char* remark, std::vector<const char*> names) {
    for (const char* name : names) all.push_back({data / folder / (std::string(name) + ".csv"), cell, remark});
  };
  add("a123_26650", "a123_26650_extended", "A002, in the file",
      {"dyn10_N15_A002", "dyn10_P05_A002", "dyn20_P25_A002", "dyn10_P45_A002", "pulse_P25_A002"});
  add("a123_26650", "a123_26650_extended", "A002, new", {"dyn10_P15_A002", "udds_P25_A002"});
  add("a123_26650", "a123_26650_extended", "A004, new", {"fsae_P25_A004", "hwycol_P25_A004"});
  add("a123_26650", "a123_26650", "A002, base file", {"dyn20_P25_A002"});
  add("a123_esctoolbox", "a123_esctoolbox_extended", "2.05 Ah, in the file", {"dyn30_N05", "dyn45_P05", "dyn50_P25"});
  add("a123_esctoolbox", "a123_26650_extended", "file of another cell", {"dyn45_P05", "dyn50_P25"});
  return all;
}

/// What is put into the readings. offset_c: in capacities per hour.
struct Planted {
  const char* name;
  double offset_c = 0, gain = 0, dead_band_share = 0, largest_share = 1;
};
constexpr Planted planted[] = {{"none"},
                               {"offset -C/25", -0.04},
                               {"offset -C/100", -0.01},
                               {"offset C/100", 0.01},
                               {"offset C/25", 0.04},
                               {"gain 3 %", 0, 0.03},
                               {"clipped at 60 %", 0, 0, 0, 0.6},
                               {"0 below 5 %", 0, 0, 0.05}};

measurement::Recording with(const measurement::Recording& clean, const Planted& p, double capacity_ah) {
  measurement::Recording r = clean;
  double largest_a = 0;
  for (const double a : clean.current_a) largest_a = std::max(largest_a, std::abs(a));
  for (double& a : r.current_a.edit()) {
    a = std::abs(a) < p.dead_band_share * largest_a ? 0 : (1 + p.gain) * a + p.offset_c * capacity_ah;
    a = std::clamp(a, -p.largest_share * largest_a, p.largest_share * largest_a);
  }
  return r;
}

struct Tally {
  int right = 0, silent = 0, wrong = 0;
};

/// Counts an answer about the offset; returns how it looks.
std::string judge(const SensorFinding& found, double truth_a, Tally& tally) {
  if (!found.value) {
    ++tally.silent;
    return "-";
  }
  const double error_a = found.value->value - truth_a;
  const bool right = std::abs(error_a) <= most_sigmas * found.value->std;
  ++(right ? tally.right : tally.wrong);
  return fmt::format("{}{:+.0f} ± {:.0f}", right ? "" : "**wrong** ", 1e3 * found.value->value, 1e3 * found.value->std);
}

/// Counts what is said about clipping or a dead band; "none" is an answer, too, and wrong if the error is there.
std::string mark(const SensorFinding& found, bool there, Tally& tally) {
  const bool denied = !found.value && found.why.starts_with("none");
  if (!found.value && !denied) {
    ++tally.silent;
    return "-";
  }
  const bool right = there != denied;
  ++(right ? tally.right : tally.wrong);
  return fmt::format("{}{}", right ? "" : "**wrong** ", denied ? "none" : "found");
}

std::string row_of(const std::string& name, const Tally& t) {
  return fmt::format("| {} | {} | {} | {} |\n", name, t.right, t.silent, t.wrong);
}

struct Tables {
  std::string offsets, summary;
};

Tables tables_of(const std::vector<std::string>& names, bool print) {
  Tables out;
  out.offsets = "| recording | cell file | planted | offset [mA] | clipping | dead band |\n|---|---|---|---|---|---|\n";
  Tally offsets[std::size(planted)], clipping[2], dead_band[2];
  for (const Case& c : cases()) {
    const std::string name = c.recording.stem().string();
    const bool chosen = names.empty() || std::any_of(names.begin(), names.end(), [&](const std::string& part) {
                          return name.find(part) != std::string::npos;
                        });
    if (!chosen) continue;
    if (!std::filesystem::exists(c.recording)) throw std::runtime_error("no recording " + c.recording.string());
    const files::CellFile cell = files::read_cell(c.cell);
    const measurement::Recording clean = files::read_recording(c.recording.string());
    for (std::size_t k = 0; k < std::size(planted); ++k) {
      const Planted& p = planted[k];
      const double capacity_ah = cell.parameters.capacity_ah;
      const Ammeter a = ammeter::examine_ammeter(with(clean, p, capacity_ah), cell, {});
      const bool clipped = p.largest_share < 1;
      const bool banded = p.dead_band_share > 0;
      const std::string row =
          fmt::format("| {} | {} ({}) | {} | {} | {} | {} |\n", name, c.cell, c.remark, p.name,
                      judge(a.balance_a.value ? a.balance_a : a.offset_a, p.offset_c * capacity_ah, offsets[k]),
                      mark(a.clipping_a, clipped, clipping[clipped ? 1 : 0]),
                      mark(a.dead_band_a, banded, dead_band[banded ? 1 : 0]));
      out.offsets += row;
      if (print) fmt::print("{}", row);
      std::fflush(stdout);
    }
  }
  out.summary = "| question, planted | right | no answer | wrong |\n|---|---|---|---|\n";
  for (std::size_t k = 0; k < std::size(planted); ++k)
    out.summary += row_of(fmt::format("offset, {}", planted[k].name), offsets[k]);
  out.summary += row_of("clipping, clipped at 60 %", clipping[1]) + row_of("clipping, not clipped", clipping[0]);
  out.summary += row_of("dead band, 0 below 5 %", dead_band[1]) + row_of("dead band, none", dead_band[0]);
  return out;
}

int run(const std::vector<std::string>& names, bool write) {
  if (write && !names.empty()) throw std::runtime_error("--write takes no names: the page has all recordings");
  const Tables tables = tables_of(names, !write);
  if (!write) {
    fmt::print("\n{}", tables.summary);
    return 0;
  }
  const auto page = source / "docs/figures/ammeter_trials.md";
  files::replace_figures(page, "ammeter trials", tables.offsets);
  files::replace_figures(page, "ammeter summary", tables.summary);
  return 0;
}

}  // namespace
}  // namespace bms

int main(int argc, char** argv) {
  std::vector<std::string> names;
  bool write = false;
  for (int k = 1; k < argc; ++k) {
    const std::string_view word = argv[k];
    if (word == "--write")
      write = true;
    else
      names.emplace_back(word);
  }
  try {
    return bms::run(names, write);
  } catch (const std::exception& e) {
    fmt::print(stderr, "ammeter_trials: {}\n", e.what());
    return 2;
  }
}
