// A current sensor that is connected the wrong way round: the voltage of all cells falls when the reading rises.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "diagnosis/pack/pack_verdict.hpp"

namespace bms::diagnosis::pack {

/// From changes between rows. Readings may be some rows late: the delay with the closest relation decides.
/// quiet_a: smaller changes of the current are left out.
std::optional<PackFinding> reversed_current(std::span<const double> current_a,
                                            const std::vector<std::vector<double>>& cell_v, double quiet_a);

}  // namespace bms::diagnosis::pack
