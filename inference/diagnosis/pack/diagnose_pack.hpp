// The diagnosis of a pack: faults of the data first, then each cell against its neighbours, then the pack's own
// sensors. What all cells share cancels in the difference between neighbours. README.md gives the reasons.
#pragma once

#include <functional>
#include <string>

#include "diagnosis/pack/pack_recording.hpp"
#include "diagnosis/pack/pack_verdict.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis::pack {

struct PackOptions {
  std::function<void(double, const std::string&)> progress;  ///< share done, and what is done now; may be empty
};

/// Three cells or more, each column as long as time_s. The repeated readings of held channels are removed from `pack`.
/// Verdict and statement are left to conclude().
PackDiagnosis diagnose_pack(const model::CellParameters<>& cell, PackRecording& pack, const PackOptions& options = {});

/// Sorts the findings, faults of the data first, and sets verdict and statement.
void conclude(PackDiagnosis& diagnosis);

}  // namespace bms::diagnosis::pack
