// What a diagnosis is worth: the cell file against the extended one over recordings, and the extended one as a file.
#pragma once

#include "workflow/diagnosis_result.hpp"

namespace bms::workflow {

/// A recording as the diagnosis takes it, trusted readings summed up; initial soc, its standard deviation, and whether
/// it was told.
diagnosis::PreparedRecording record_of(const measurement::Recording& r, std::string name,
                                       const model::CellParameters<>& cell, double initial_soc, double sigma,
                                       bool soc_given);

/// What both models say, open loop from where each recording begins: fills base_v and extended_v of recordings and
/// hold-outs.
void compare(DiagnoseResult& r);

/// Of several recordings together; nothing without a voltage.
std::optional<OpenLoopFigures> figures(const std::vector<RecordingComparison>& list,
                                       std::vector<double> RecordingComparison::*simulated);

/// The state of charge, as a board would estimate it, on the hold-outs that have a reference.
std::optional<SocErrors> soc_errors(const DiagnoseResult& r);

/// The cell file with what was found; needs r.baseline and r.extended.
files::CellFile extended_cell(const DiagnoseResult& r);

}  // namespace bms::workflow
