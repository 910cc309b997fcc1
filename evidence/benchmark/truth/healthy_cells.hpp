// Random healthy cells: LiFePO4 of 2 to 280 Ah, similar to Table 9 of the paper.
#pragma once

#include "benchmark/truth/concealed_cell.hpp"
#include "benchmark/truth/random_functions.hpp"

namespace bms::benchmark::truth {

/// Resistances scale with 6 Ah / Q and C1 with Q / 6 Ah, each times a random factor; the thermal node scales with Q and
/// Q^(2/3). Half of the OCV curves follow Table 9 with random steps, rounded or not. The others consist of two
/// plateaus, logistic steps and two exponential knees.
HealthyCell draw_healthy_cell(plant::Random& random);

}  // namespace bms::benchmark::truth
