// Replay of several cells at once in float: the cells of a pack, or many recordings. Each estimate has the bits of
// run_on_host().
//
// Ordinary steps are computed for all cells of a group together, a cell in each lane of a vector; the others by the
// estimator of the cell (host_sim/replay/lane_run.hpp). A cell file with mechanisms, or with sensor errors as states,
// is replayed by run_on_host().
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "files/cell_file.hpp"
#include "measurement/recording.hpp"
#include "replay/replay.hpp"

namespace bms::replay {

/// One cell and what was measured of it.
struct LaneInput {
  const files::CellFile& cell;
  measurement::SampleList samples;
  std::optional<measurement::StartingPoint> start = std::nullopt;
};

struct LaneTracks {
  std::vector<Track> tracks;    ///< in the order of the inputs
  std::size_t steps = 0;        ///< of all cells in lanes
  std::size_t alone = 0;        ///< of these, those that the estimator of one cell computed
  double steps_per_second = 0;  ///< of processor time; of one cell, all cells in lanes together
};

/// Number of cells whose steps are computed together.
std::size_t lane_count();

/// Runs the estimators of all inputs. Cells of a group of lane_count() inputs have the same number of samples at best.
LaneTracks run_in_lanes(std::span<const LaneInput> inputs);

}  // namespace bms::replay
