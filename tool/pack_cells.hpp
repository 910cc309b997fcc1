// The cells of a pack recording, each through the estimator of its own.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host_sim/replay.hpp"

namespace bms::tool {

struct PackCell {
  std::size_t number = 0;                   ///< from 1
  double soc = 0, soc_sigma = 0;            ///< at the end
  std::optional<double> prediction_rmse_v;  ///< one step ahead
};

/// Replays every cell with the current of the pack on the host. mean: the replay of the mean cell.
std::vector<PackCell> replay_cells(const host_sim::ReplayResult& mean,
                                   const std::optional<measurement::StartingPoint>& start);

/// "Cells at the end: 71.2 % (cell 7) to 74.0 % (cell 3)."
std::string cells_text(const std::vector<PackCell>& cells);

/// The JSON of a replay with the list "cells" added.
std::string with_cells(const std::string& json, const std::vector<PackCell>& cells);

}  // namespace bms::tool
