// The cell file that a careful calibration of a healthy cell at 25 degrees C gives.
//
// OCV: straight lines between 10 to 20 uneven edges, fitted (0.4 to 1 mV RMS, 1.5 to 3 mV at most between 3 % and 97
// %), plus a smooth error with an RMS of share times the tolerance. R0, R1: lines between 6 to 11 nodes, fitted in
// proportion (2.5 % at most), plus a smooth error. C1 likewise within 5 %; capacity within 0.25 %.
#pragma once

#include "benchmark/truth/cases.hpp"
#include "benchmark/truth/concealed_cell.hpp"
#include "benchmark/truth/random_functions.hpp"

namespace bms::benchmark::truth {

/// share: RMS of the errors divided by the tolerances, 0 to 1. At 0 only the straight lines differ from the cell.
CalibratedCell calibrate(const HealthyCell& cell, double share, plant::Random& random);

}  // namespace bms::benchmark::truth
