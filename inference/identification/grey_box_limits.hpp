// Bounds and scales of the unknowns of a grey box.
#pragma once

#include "identification/grey_box.hpp"

namespace bms::identification {

struct Limits {
  double lower, upper, scale;
};

/// cell: its OCV bounds the branch position.
Limits limits_within(Quantity quantity, const model::CellParameters<>& cell, const CircuitBounds& bounds);

}  // namespace bms::identification
