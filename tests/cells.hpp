// Cells for tests: the parameters of the built-in cell files as constants. The build generates them from the TOML files
// (cmake/cell_header.cpp), so that a test needs no reader and no value stands in two places.
#pragma once

#include "built_in_cells.hpp"
#include "model/cell.hpp"

namespace bms::tests {

/// The cell of the paper, 6 Ah; values of Table 9 (model/cells/table9.toml).
inline constexpr const model::CellParameters<>& table9 = built_in_cells::table9;

/// A123 26650, 2.5 Ah (model/cells/a123_26650.toml).
inline constexpr const model::CellParameters<>& a123_26650 = built_in_cells::a123_26650;

/// A cell with the tables that scalar S needs, as the host prepares it.
template <class S, class Real = double>
constexpr model::Cell<S, model::max_intervals> prepared(const model::CellParameters<Real>& parameters = table9) {
  return model::prepare<S, model::max_intervals>(parameters);
}

}  // namespace bms::tests
