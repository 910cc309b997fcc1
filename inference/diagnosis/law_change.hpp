// The term that was learned for an unknown cause, as a curve over the state of charge.
#pragma once

#include <vector>

#include "diagnosis/verdict.hpp"

namespace bms::diagnosis {

inline constexpr int law_change_points = 101;  ///< of a curve

struct LawChange {
  double soc, change;  ///< of the law's table: V for the OCV, ohm for R0 or R1
};

/// Points at states of charge that the recordings have reached. before: the cell file. Empty without a term
/// in a table.
std::vector<LawChange> law_changes(const Diagnosis& d, const model::CellParameters<>& before);

}  // namespace bms::diagnosis
