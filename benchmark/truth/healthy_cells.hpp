// Healthy cells by chance: LiFePO4 of 2 to 280 Ah, around Table 9 of the paper, no two alike.
#pragma once

#include "benchmark/truth/concealed_cell.hpp"
#include "benchmark/truth/random_functions.hpp"

namespace bms::benchmark::truth {

/// Resistances go with 6 Ah / Q, C1 with Q / 6 Ah, each times a chance of its own; the thermal node with Q and Q^(2/3).
/// Half of the OCV curves follow Table 9 with chance steps, rounded or not; the others are made of two plateaus,
/// logistic stages and two exponential knees.
HealthyCell draw_healthy_cell(plant::Random& random);

}  // namespace bms::benchmark::truth
