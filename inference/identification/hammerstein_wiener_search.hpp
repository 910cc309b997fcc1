// Where the corners of a Hammerstein-Wiener model lie: each place, and each linear block to begin with, leads to a
// minimum of its own. Many short searches with the corners at their best, then longer ones of the best of them.
#pragma once

#include "identification/hammerstein_wiener.hpp"

namespace bms::identification {

/// The best model found. linear: output error model of the data, with this structure. soc: at the middle of the data.
/// Long recordings are thinned, so the end is near a minimum of all samples and not exactly there.
HammersteinWiener find_hammerstein_wiener(const DiscreteModel& linear, const Structure& structure,
                                          const model::OcvTable<double>& ocv, const Data& data, double soc);

}  // namespace bms::identification
