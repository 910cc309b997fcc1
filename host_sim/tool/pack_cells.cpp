#include "tool/pack_cells.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "replay/capacity_estimate.hpp"
#include "replay/lanes.hpp"
#include "replay/simulation.hpp"

namespace bms::tool {

namespace {

/// Estimates of one cell after the other.
std::vector<replay::Track> tracks_of(const std::vector<measurement::Recording>& cells, const replay::ReplayResult& mean,
                                     const std::optional<measurement::StartingPoint>& start) {
  const files::CellFile cell = replay::counted_cell(mean);
  std::vector<replay::LaneInput> inputs;
  for (const measurement::Recording& one : cells) inputs.push_back({cell, measurement::SampleList(one), start});
  if (mean.scalar == replay::ScalarKind::float32) return replay::run_in_lanes(inputs).tracks;
  std::vector<replay::Track> tracks;
  for (const replay::LaneInput& in : inputs)
    tracks.push_back(replay::run_on_host(in.cell, in.samples, start, mean.scalar, replay::Timing::none));
  return tracks;
}

}  // namespace

std::vector<PackCell> replay_cells(const replay::ReplayResult& mean,
                                   const std::optional<measurement::StartingPoint>& start) {
  std::vector<PackCell> cells;
  const std::size_t count = mean.recording.cell_voltage_v.size();
  while (cells.size() < count) {  // a group at a time: the estimates of all cells may be larger than the memory
    std::vector<measurement::Recording> group;
    for (std::size_t k = cells.size(); k < count && group.size() < replay::lane_count(); ++k)
      group.push_back(measurement::cell(mean.recording, k));
    std::vector<replay::Track> tracks = tracks_of(group, mean, start);
    for (std::size_t k = 0; k < group.size(); ++k) {
      replay::ReplayResult one;
      one.recording = std::move(group[k]);
      one.cell = mean.cell;
      one.scalar = mean.scalar;
      one.prior = mean.prior;
      one.initial_soc = mean.initial_soc;
      one.track = std::move(tracks[k]);
      replay::evaluate(one);
      cells.push_back({cells.size() + 1, one.soc.final, one.soc.final_sigma, one.voltage.prediction_rmse_v});
    }
  }
  return cells;
}

std::string cells_text(const std::vector<PackCell>& cells) {
  const auto [low, high] =
      std::minmax_element(cells.begin(), cells.end(), [](const auto& a, const auto& b) { return a.soc < b.soc; });
  return fmt::format("Cells at the end: {:.1f} % (cell {}) to {:.1f} % (cell {}).", 100 * low->soc, low->number,
                     100 * high->soc, high->number);
}

std::string with_cells(const std::string& json, const std::vector<PackCell>& cells) {
  auto all = nlohmann::ordered_json::parse(json);
  auto list = nlohmann::ordered_json::array();
  for (const PackCell& c : cells) {
    nlohmann::ordered_json one = {{"cell", c.number}, {"soc", c.soc}, {"soc_sigma", c.soc_sigma}};
    one["prediction_rmse_v"] = c.prediction_rmse_v ? nlohmann::ordered_json(*c.prediction_rmse_v) : nullptr;
    list.push_back(one);
  }
  all["cells"] = list;
  return all.dump(1) + "\n";
}

namespace {

/// Charge of the recording in capacities, as the simulation counts it.
double counted_soc(const measurement::Recording& r, double capacity_ah) {
  double sum_as = 0, last_a = 0;
  for (std::size_t k = 0; k < r.rows(); ++k) {
    if (std::isfinite(r.current_a[k])) last_a = r.current_a[k];
    if (k > 0) sum_as += last_a * (r.time_s[k] - r.time_s[k - 1]);
  }
  return sum_as / 3'600 / capacity_ah;
}

}  // namespace

std::vector<SimulatedCell> simulate_cells(const files::CellFile& cell, const measurement::Recording& pack) {
  const auto tables = model::prepare<double, model::max_intervals>(cell.parameters);
  const double counted = counted_soc(pack, cell.parameters.capacity_ah);
  std::vector<SimulatedCell> cells;
  for (std::size_t k = 0; k < pack.cell_voltage_v.size(); ++k) {
    const measurement::Recording one = measurement::cell(pack, k);
    const auto track = replay::run_on_host(cell, measurement::SampleList(one), {}, replay::ScalarKind::float64);
    SimulatedCell found{k + 1, std::clamp(track.rows.back().soc - counted, 0.0, 1.0), 0, {}};
    double squares = 0, count = 0;
    for (const replay::SimulatedRow& row : replay::simulate({.cell = tables,
                                           .capacity_ah = cell.parameters.capacity_ah,
                                           .mechanisms = cell.mechanisms,
                                           .time_s = one.time_s,
                                           .current_a = one.current_a,
                                           .temperature_c = one.temperature_c,
                                           .initial_soc = found.initial_soc})) {
      const double error_v = one.voltage_v[found.voltage_v.size()] - row.voltage_v;
      if (std::isfinite(error_v)) {
        squares += error_v * error_v;
        ++count;
      }
      found.voltage_v.push_back(row.voltage_v);
    }
    found.rmse_v = count > 0 ? std::sqrt(squares / count) : std::nan("");
    cells.push_back(std::move(found));
  }
  return cells;
}

std::string cells_text(const std::vector<SimulatedCell>& cells) {
  const auto [best, worst] =
      std::minmax_element(cells.begin(), cells.end(), [](const auto& a, const auto& b) { return a.rmse_v < b.rmse_v; });
  return fmt::format("Cells: {:.2f} mV RMS (cell {}) to {:.2f} mV RMS (cell {}).", 1e3 * best->rmse_v, best->number,
                     1e3 * worst->rmse_v, worst->number);
}

std::string with_cells(const std::string& json, const std::vector<SimulatedCell>& cells) {
  auto all = nlohmann::ordered_json::parse(json);
  auto list = nlohmann::ordered_json::array();
  for (const SimulatedCell& c : cells)
    list.push_back({{"cell", c.number}, {"initial_soc", c.initial_soc}, {"rmse_v", c.rmse_v}});
  all["cells"] = list;
  return all.dump(1) + "\n";
}

}  // namespace bms::tool
