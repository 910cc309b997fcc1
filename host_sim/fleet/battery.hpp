// The cells of one battery, compared with themselves over time and with each other.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "fleet/analysis.hpp"

namespace bms::fleet {

/// Hypotheses that are tested of each cell: off in many recordings, discharged, weak; and of each battery: all cells
/// off together, a current sensor that drifts.
inline constexpr std::size_t hypotheses_of_a_cell = 3, hypotheses_of_a_battery = 2;

/// What a cause is taken for if all cells of a battery show it.
std::string cause_if_shared(const std::string& cause);

/// Adds what may be wrong with a battery. cells: the places of its cells in `history`.
void judge_battery(const History& history, std::vector<std::size_t> cells, std::vector<Issue>& issues);

}  // namespace bms::fleet
