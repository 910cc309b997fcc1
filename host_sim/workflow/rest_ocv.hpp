// Open-circuit voltage from the ends of rests: of a pulse test (HPPC), where no slow charge or discharge was measured.
#pragma once

#include <string>
#include <vector>

#include "files/cell_file.hpp"
#include "measurement/recording.hpp"

namespace bms::workflow {

/// A voltage at the end of a rest.
struct RestedPoint {
  double soc = 0, voltage_v = 0, rest_s = 0;
};

/// The rests of a recording of ten minutes or more, with the state of charge counted from `initial_soc`.
std::vector<RestedPoint> rested_points(const measurement::Recording& recording, double initial_soc, double capacity_ah);

struct RestedOcv {
  std::size_t points = 0;
  double soc_min = 0, soc_max = 0;  ///< that the rests cover
  double error_v = 0;               ///< between the points: the largest error with which its neighbours predict a point
};

/// Moves the OCV of the cell to the points: between them the shape of the cell's own curve, bent linearly; beyond them
/// the curve shifted as at the nearest point. Throws std::invalid_argument with fewer than four points, with points
/// over less than 40 % of the state of charge, or if the result does not rise.
RestedOcv move_ocv_to(std::vector<RestedPoint> points, files::CellFile& cell);

}  // namespace bms::workflow
