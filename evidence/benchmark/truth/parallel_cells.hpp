// Two unequal cells in parallel: the effect `parallel_imbalance`.
#pragma once

#include "benchmark/truth/concealed_cell.hpp"

namespace bms::benchmark::truth {

/// Same arguments as run_cell(). Of the effects only `parallel` counts. v1_v is the mean of both cells.
CellTrace run_parallel_cells(const HealthyCell& cell, const Parallel& parallel, const Stimulus& stimulus,
                             double start_soc);

}  // namespace bms::benchmark::truth
