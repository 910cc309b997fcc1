#include "tool/pack_cells.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace bms::tool {

std::vector<PackCell> replay_cells(const host_sim::ReplayResult& mean,
                                   const std::optional<measurement::StartingPoint>& start) {
  std::vector<PackCell> cells;
  for (std::size_t k = 0; k < mean.recording.cell_voltage_v.size(); ++k) {
    host_sim::ReplayResult one;
    one.recording = measurement::cell(mean.recording, k);
    one.cell = mean.cell;
    one.scalar = mean.scalar;
    one.prior = mean.prior;
    one.initial_soc = mean.initial_soc;
    one.track = host_sim::run_on_host(one.cell, measurement::samples(one.recording), start, one.scalar);
    host_sim::evaluate(one);
    cells.push_back({k + 1, one.soc.final, one.soc.final_sigma, one.voltage.prediction_rmse_v});
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

}  // namespace bms::tool
