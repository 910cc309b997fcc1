// The slow charges and discharges in one recording, as testers write them into one file.
#pragma once

#include <cstddef>
#include <vector>

#include "identification/ocv_curve.hpp"
#include "measurement/recording.hpp"

namespace bms::workflow {

/// Rows of a recording.
struct RowRange {
  std::size_t first = 0, count = 0;
};

/// The parts whose current has one direction, each with the rests around it. A part that moves less than half of the
/// charge of the largest is left out: a top-up before the test. The whole recording if that leaves out more than a
/// fifth of the charge: a load, not slow runs.
std::vector<RowRange> one_direction(const measurement::Recording& recording);

/// These parts as slow runs.
std::vector<identification::SlowRun> runs_of(const measurement::Recording& recording);

}  // namespace bms::workflow
