#include "replay/cut_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>

#include <fmt/format.h>

#include "replay/cuts.hpp"

namespace bms::replay {

namespace {

/// The last group that begins at or below x.
template <std::size_t N>
std::size_t group_of(const std::array<double, N>& from, double x) {
  std::size_t group = 0;
  while (group + 1 < N && x >= from[group + 1]) ++group;
  return group;
}

template <std::size_t N>
std::string title_of(const std::array<double, N>& from, std::size_t k, const char* unit) {
  if (k + 1 == N) return fmt::format("from {:g} {}", from[k], unit);
  return k == 0 ? fmt::format("below {:g} {}", from[1], unit)
                : fmt::format("{:g} to {:g} {}", from[k], from[k + 1], unit);
}

std::string title_of(std::size_t group) {
  if (group < calibration_from_min.size()) return title_of(calibration_from_min, group, "min since the start");
  group -= calibration_from_min.size();
  if (group < calibration_from_c.size()) return title_of(calibration_from_c, group, "°C");
  return title_of(calibration_from_c_rate, group - calibration_from_c.size(), "C");
}

/// Shares in %, the mean over the recordings that have the group.
struct Shares {
  std::array<double, 4> quarters{};
  double within_2_sigma = 0;
  std::size_t recordings = 0;

  void add(const Calibration& c) {
    if (!(c.count() > 0)) return;
    for (std::size_t q = 0; q < quarters.size(); ++q) quarters[q] += 100 * c.quarters[q] / c.count();
    within_2_sigma += 100 * c.within_2_sigma / c.count();
    ++recordings;
  }
  std::string cells() const {
    if (recordings == 0) return " - | - |";
    const auto n = static_cast<double>(recordings);
    return fmt::format(" {:.0f}, {:.0f}, {:.0f}, {:.0f} | {:.0f} |", quarters[0] / n, quarters[1] / n, quarters[2] / n,
                       quarters[3] / n, within_2_sigma / n);
  }
};

constexpr std::array<std::string_view, 2> shown = {"drawn", "unknown"};

const CutFigures* start_of(const CutResult& result, std::string_view id) {
  const auto found =
      std::ranges::find(result.starts, id, [](const CutFigures& f) { return std::string_view(f.start.id); });
  return found == result.starts.end() ? nullptr : &*found;
}

/// The groups of all starts that are shown, as one row. of(figures): the Calibration of a recording.
template <class Of>
std::string row(const std::string& title, std::span<const CutResult> results, Of of) {
  std::string text = fmt::format("| {} |", title);
  for (const std::string_view id : shown) {
    Shares shares;
    for (const CutResult& result : results) {
      if (const CutFigures* figures = start_of(result, id)) shares.add(of(*figures));
    }
    text += shares.cells();
  }
  return text + "\n";
}

/// All estimates of a recording: the groups by time have each once.
Calibration all_of(const CutFigures& figures) {
  Calibration all;
  for (std::size_t k = 0; k < calibration_from_min.size(); ++k) {
    const Calibration& c = figures.calibration[k];
    for (std::size_t q = 0; q < all.quarters.size(); ++q) all.quarters[q] += c.quarters[q];
    all.within_2_sigma += c.within_2_sigma;
  }
  return all;
}

}  // namespace

void Calibration::add(double error, double sigma) {
  const double below = 0.5 * std::erfc(error / sigma / std::numbers::sqrt2);  // of the truth in what is stated
  quarters[std::min<std::size_t>(3, static_cast<std::size_t>(4 * below))] += 1;
  within_2_sigma += std::abs(error) <= 2 * sigma ? 1 : 0;
}

void add_to_groups(Calibrations& groups, const measurement::Recording& r, std::size_t row, double since_start_s,
                   double error, double sigma, double capacity_ah) {
  constexpr double without_thermometer_c = 25;
  const double c =
      r.temperature_c.empty() || std::isnan(r.temperature_c[row]) ? without_thermometer_c : r.temperature_c[row];
  const double c_rate = std::isnan(r.current_a[row]) ? 0 : std::abs(r.current_a[row]) / capacity_ah;
  std::size_t first = 0;
  groups[group_of(calibration_from_min, since_start_s / 60)].add(error, sigma);
  first += calibration_from_min.size();
  groups[first + group_of(calibration_from_c, c)].add(error, sigma);
  first += calibration_from_c.size();
  groups[first + group_of(calibration_from_c_rate, c_rate)].add(error, sigma);
}

std::string calibration_table(std::span<const CutResult> results) {
  std::string text =
      "| estimates | drawn from sigma 2 %: quarters, % | inside two sigma, % | unknown: quarters, % | inside two "
      "sigma, % |\n|---|---|---|---|---|\n";
  text += row("all", results, all_of);
  for (std::size_t k = 0; k < calibration_groups; ++k)
    text += row(title_of(k), results, [k](const CutFigures& figures) { return figures.calibration[k]; });
  std::vector<std::string> cells;
  for (const CutResult& result : results) {
    if (std::ranges::find(cells, result.cell) == cells.end()) cells.push_back(result.cell);
  }
  for (const std::string& cell : cells) {
    std::vector<CutResult> of_cell;
    std::ranges::copy_if(results, std::back_inserter(of_cell), [&](const CutResult& r) { return r.cell == cell; });
    text += row(fmt::format("`{}`", cell), of_cell, all_of);
  }
  return text;
}

}  // namespace bms::replay
