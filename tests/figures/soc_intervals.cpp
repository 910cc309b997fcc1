// Real recordings as logs with other intervals: what a row hides. Each recording becomes a log with a row every 0.1 to
// 60 s that has the mean of the current since the row before, or the last current, and the last voltage.
//
//   soc_intervals               prints the tables
//   soc_intervals NAME...       of the recordings whose file name contains a NAME
//   soc_intervals --cell FILE NAME...   with another cell file
//   soc_intervals --write       writes the tables of all recordings into docs/figures/soc_trials.md
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "files/cell_file.hpp"
#include "files/committed_figures.hpp"
#include "files/recording.hpp"
#include "measurement/recording.hpp"
#include "measurement/statistics.hpp"
#include "replay/replay.hpp"

namespace bms {
namespace {

const std::filesystem::path source = BMS_SOURCE_DIR, data = BMS_DATA_DIR;

struct Case {
  std::filesystem::path recording;
  std::string cell;
};

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const char* name : {"dyn10_N15_A002", "dyn10_N05_A002", "dyn10_P05_A002", "dyn10_P15_A002", "dyn20_P25_A002",
                           "dyn10_P45_A002", "udds_P25_A002", "fsae_P25_A004", "hwycol_P25_A004"})
    all.push_back({data / "a123_26650" / (std::string(name) + ".csv"), "a123_26650_extended"});
  for (const char* name : {"dyn30_N05", "dyn45_P05", "dyn50_P25"})
    all.push_back({data / "a123_esctoolbox" / (std::string(name) + ".csv"), "a123_esctoolbox_extended"});
  all.push_back({source / "evidence/recordings/forklift_shift.csv", "table9"});
  return all;
}

/// What a row says of the current since the row before.
enum class Current { mean, last };

struct Interval {
  double row_s;
  Current current;
};
constexpr std::array intervals{Interval{0.1, Current::mean}, Interval{1, Current::mean},  Interval{5, Current::mean},
                               Interval{5, Current::last},   Interval{10, Current::mean}, Interval{10, Current::last},
                               Interval{30, Current::mean},  Interval{30, Current::last}, Interval{60, Current::mean},
                               Interval{60, Current::last}};

struct Start {
  const char* title;
  double off, sigma;
};
constexpr std::array starts{Start{"right, sigma 2 %", 0, 0.02}, Start{"30 % wrong, sigma 30 %", 0.3, 0.3},
                            Start{"20 % wrong, sigma 2 %", 0.2, 0.02}};

struct Log {
  std::vector<measurement::Sample> samples;
  std::vector<double> soc_ref;

  void add(const measurement::Recording& r, std::size_t row, double time_s, double current_a, double voltage_v,
           double soc) {
    const double temperature_c = r.temperature_c.empty() ? 25 : r.temperature_c[row];
    samples.push_back(measurement::sample_of(time_s - r.time_s.front(), current_a, voltage_v, temperature_c));
    soc_ref.push_back(soc);
  }
};

/// Rows in between: the same current, voltage and reference on a straight line.
Log finer(const measurement::Recording& r, double row_s) {
  constexpr double longest_s = 20;  // what is longer stays a gap
  Log log;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const double step_s = r.time_s[k] - r.time_s[k - 1];
    const int parts = step_s > longest_s ? 1 : std::max(1, static_cast<int>(std::lround(step_s / row_s)));
    for (int part = 1; part <= parts; ++part) {
      const double share = static_cast<double>(part) / parts;
      const auto between = [&](const auto& column) { return column[k - 1] + share * (column[k] - column[k - 1]); };
      log.add(r, k, between(r.time_s), r.current_a[k], between(r.voltage_v), between(r.soc_ref));
    }
  }
  return log;
}

Log rarer(const measurement::Recording& r, const Interval& interval) {
  Log log;
  log.add(r, 0, r.time_s[0], r.current_a[0], r.voltage_v[0], r.soc_ref[0]);
  double charge_as = 0, since_s = 0, next_s = r.time_s[0] + interval.row_s;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const double step_s = r.time_s[k] - r.time_s[k - 1];
    charge_as += r.current_a[k] * step_s;
    since_s += step_s;
    if (r.time_s[k] + 1e-6 < next_s || since_s == 0) continue;
    log.add(r, k, r.time_s[k], interval.current == Current::last ? r.current_a[k] : charge_as / since_s, r.voltage_v[k],
            r.soc_ref[k]);
    charge_as = since_s = 0;
    while (next_s <= r.time_s[k] + 1e-6) next_s += interval.row_s;
  }
  return log;
}

struct Run {
  std::string name;
  double rmse = 0, inside = 0;
};

struct Figures {
  std::vector<Run> runs;
  std::vector<double> ratios, sigmas;
};

void add(Figures& figures, const Case& c, const files::CellFile& cell, const Log& log, const Start& start) {
  const double first = log.soc_ref.front(), off = first + start.off > 1 ? -start.off : start.off;
  const replay::Track track =
      replay::run_on_host(cell, log.samples, replay::starting_point(replay::SocPrior{first + off, start.sigma}),
                          replay::ScalarKind::float32, replay::Timing::none);
  Run run{c.recording.stem().string()};
  double rows = 0;
  for (std::size_t k = 0; k < track.rows.size(); ++k) {
    if (std::isnan(log.soc_ref[k])) continue;
    const replay::EstimateRow e = track.rows[k];
    const double error = std::abs(e.soc - log.soc_ref[k]);
    run.rmse += error * error;
    run.inside += error <= 2 * e.soc_sigma ? 1 : 0;
    figures.ratios.push_back(error / e.soc_sigma);
    figures.sigmas.push_back(e.soc_sigma);
    rows += 1;
  }
  run.rmse = std::sqrt(run.rmse / rows);
  run.inside /= rows;
  figures.runs.push_back(run);
}

/// Names of the recordings that are off by more than 1.5 %, or with less than 90 % of the rows inside two sigma.
std::string failing(const std::vector<Run>& runs) {
  std::string names;
  for (const Run& run : runs) {
    if (run.rmse <= 0.015 && run.inside >= 0.9) continue;
    names +=
        fmt::format("{}{} {:.1f} % ({:.0f} %)", names.empty() ? "" : ", ", run.name, 100 * run.rmse, 100 * run.inside);
  }
  return names.empty() ? "-" : names;
}

std::string row(const Interval& interval, const Start& start, Figures& f) {
  std::vector<double> rmse;
  double inside = 0, worst = 0, least = 1;
  for (const Run& run : f.runs) {
    rmse.push_back(run.rmse);
    worst = std::max(worst, run.rmse);
    inside += run.inside / static_cast<double>(f.runs.size());
    least = std::min(least, run.inside);
  }
  return fmt::format("| {:g} s, {} | {} | {:.2f}, {:.1f} | {:.0f}, {:.0f} | {:.2f} | {:.2f} | {} |\n", interval.row_s,
                     interval.current == Current::last ? "last" : "mean", start.title, 100 * measurement::median(rmse),
                     100 * worst, 100 * inside, 100 * least, measurement::median(f.ratios),
                     100 * measurement::median(f.sigmas), failing(f.runs));
}

std::string table(const std::vector<std::string>& names, const std::string& other_cell) {
  std::string text =
      "| row, current | start | SOC RMSE, median and worst, % | inside two sigma, mean and worst, % | median of error "
      "/ "
      "sigma | median sigma, % | off by more than 1.5 %, or less than 90 % inside: RMSE (inside) "
      "|\n|---|---|---|---|---|---|---|\n";
  for (const Interval& interval : intervals) {
    std::array<Figures, starts.size()> figures;
    for (const Case& c : cases()) {
      const auto has = [&](const std::string& n) { return c.recording.string().find(n) != std::string::npos; };
      if (!std::filesystem::exists(c.recording) || (!names.empty() && std::ranges::none_of(names, has))) continue;
      const files::CellFile cell = files::read_cell(other_cell.empty() ? c.cell : other_cell);
      const measurement::Recording r = files::read_recording(c.recording.string());
      const Log log = interval.row_s < 1 ? finer(r, interval.row_s) : rarer(r, interval);
      for (std::size_t s = 0; s < starts.size(); ++s) add(figures[s], c, cell, log, starts[s]);
    }
    for (std::size_t s = 0; s < starts.size(); ++s) text += row(interval, starts[s], figures[s]);
  }
  return text;
}

}  // namespace
}  // namespace bms

int main(int argc, char** argv) {
  std::vector<std::string> names;
  std::string cell;
  bool write = false;
  for (int k = 1; k < argc; ++k) {
    const std::string_view word = argv[k];
    if (word == "--write")
      write = true;
    else if (word == "--cell" && k + 1 < argc)
      cell = argv[++k];
    else
      names.emplace_back(argv[k]);
  }
  try {
    const std::string text = bms::table(names, cell);
    if (write)
      bms::files::replace_figures(bms::source / "docs/figures/soc_trials.md", "intervals", text);
    else
      fmt::print("{}", text);
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "soc_intervals: {}\n", e.what());
    return 2;
  }
}
