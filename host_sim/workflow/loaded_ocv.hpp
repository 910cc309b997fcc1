// Open-circuit voltage from discharges under load, where neither a slow run nor rests on the way were measured: the
// voltage under load plus the drop over the resistance that the steps of the current show.
#pragma once

#include <vector>

#include "files/cell_file.hpp"
#include "measurement/recording.hpp"

namespace bms::workflow {

/// A recording and the state of charge at its start.
struct LoadedRecording {
  const measurement::Recording* recording = nullptr;
  double initial_soc = 1;
};

struct LoadedOcv {
  double soc_min = 0, soc_max = 0;  ///< that the load covers
  double resistance_ohm = 0;        ///< median of the steps' resistances
  double error_v = 0;               ///< of the curve: between recordings, and by the resistance
  std::size_t steps = 0;            ///< of the current, whose resistance was used
};

/// Replaces the OCV of the cell. Beyond the range that the load covers the curve continues straight. Throws
/// std::invalid_argument without a step of the current from rest to load, or if the load covers less than 40 % of the
/// state of charge.
LoadedOcv take_ocv_from_load(const std::vector<LoadedRecording>& recordings, files::CellFile& cell);

}  // namespace bms::workflow
