// Cell file and extended cell compared over recordings, and the extended cell as a file.
#pragma once

#include "workflow/diagnosis_result.hpp"

namespace bms::workflow {

/// Simulates both models in open loop from the start of each recording that was diagnosed. Fills base_v and extended_v.
void compare_recordings(DiagnoseResult& r);

/// The same of the hold-outs, with the extended cell as it is written: bms simulate of that file gives the same
/// voltages. Needs the extended cell.
void compare_holdouts(DiagnoseResult& r);

/// Adds the intervals around extended_v. Needs the extended cell.
void add_intervals(DiagnoseResult& r);

/// Readings of several recordings together within their intervals; nothing if no row has a voltage.
std::optional<diagnosis::Coverage> coverage(const std::vector<RecordingComparison>& list);

/// Figures of several recordings together; nothing if no row has a voltage.
std::optional<OpenLoopFigures> figures(const std::vector<RecordingComparison>& list,
                                       std::vector<double> RecordingComparison::*simulated);

/// Errors of the state of charge that a board would estimate, over the hold-outs with a reference.
std::optional<SocErrors> soc_errors(const DiagnoseResult& r);

/// The cell file with the mechanisms found, or with a remark if no mechanism was found. Needs r.baseline and
/// r.extended.
files::CellFile extended_cell(const DiagnoseResult& r);

}  // namespace bms::workflow
