// Cells whose difference to the neighbours is larger than that of the others and fits no known cause.
#pragma once

#include <vector>

#include "diagnosis/pack/cell_fit.hpp"
#include "diagnosis/pack/pack_verdict.hpp"

namespace bms::diagnosis::pack {

/// usual_v: set to the median RMS over all cells.
std::vector<UnexplainedCell> unexplained_cells(const PackRecording& pack, const std::vector<CellFit>& fits,
                                               const std::vector<std::size_t>& explained, double& usual_v);

}  // namespace bms::diagnosis::pack
