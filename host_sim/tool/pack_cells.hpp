// The cells of a pack recording, each through the estimator of its own.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "replay/replay.hpp"

namespace bms::tool {

struct PackCell {
  std::size_t number = 0;                   ///< from 1
  double soc = 0, soc_sigma = 0;            ///< at the end
  std::optional<double> prediction_rmse_v;  ///< one step ahead
};

/// Replays every cell with the current of the pack on the host. mean: the replay of the mean cell.
std::vector<PackCell> replay_cells(const replay::ReplayResult& mean,
                                   const std::optional<measurement::StartingPoint>& start);

/// "Cells at the end: 71.2 % (cell 7) to 74.0 % (cell 3)."
std::string cells_text(const std::vector<PackCell>& cells);

/// The JSON of a replay with the list "cells" added.
std::string with_cells(const std::string& json, const std::vector<PackCell>& cells);

/// One cell of a pack recording in open loop.
struct SimulatedCell {
  std::size_t number = 0;  ///< from 1
  double initial_soc = 0;  ///< that of the estimator at the end, less the charge that was counted
  double rmse_v = 0;       ///< measured minus simulated voltage
  std::vector<double> voltage_v;
};

/// Simulates every cell with the current of the pack.
std::vector<SimulatedCell> simulate_cells(const files::CellFile& cell, const measurement::Recording& pack);

/// "Cells: 1.2 mV RMS (cell 3) to 4.0 mV RMS (cell 7)."
std::string cells_text(const std::vector<SimulatedCell>& cells);

/// The JSON of a simulation with the list "cells" added.
std::string with_cells(const std::string& json, const std::vector<SimulatedCell>& cells);

}  // namespace bms::tool
