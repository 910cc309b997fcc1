// The estimator of a pack of cells in series: the mean cell, and each cell's difference from it.
#pragma once

#include "estimator/pack_estimator.hpp"

namespace greybox {

using bms::estimator::mean_cell;     ///< the mean cell of a pack's sample: the input of one Estimator
using bms::estimator::PackCells;     ///< state of charge and resistance of each cell relative to the mean
using bms::measurement::PackSample;  ///< readings of all cells at one time, in micro-units

}  // namespace greybox
