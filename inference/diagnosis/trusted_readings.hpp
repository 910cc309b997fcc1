// A diagnosis with trusted instruments alongside: errors of the own instruments are read off, and the cell is diagnosed
// from the trusted readings, as if there were no others. More instruments can then not make an answer worse.
#pragma once

#include <vector>

#include "diagnosis/instrument_comparison.hpp"
#include "diagnosis/prepared_recording.hpp"
#include "diagnosis/verdict.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis {

/// Returns true if a trusted instrument reads in nearly all rows of one of the recordings.
bool have_trusted_readings(const std::vector<PreparedRecording>& records);

/// The recordings with the trusted readings in the place of the others; in rows without, the errors are taken away from
/// the own readings. A recording without a trusted instrument stays as it is: it may be older than the errors.
std::vector<PreparedRecording> as_trusted(const std::vector<PreparedRecording>& records,
                                          const std::vector<InstrumentError>& errors);

/// The diagnosis of the cell from its trusted readings, with the errors of the instruments. records: as read.
Diagnosis with_instrument_errors(Diagnosis of_cell, const std::vector<InstrumentError>& errors,
                                 const model::CellParameters<>& cell, const std::vector<MechanismSetting>& own,
                                 const std::vector<PreparedRecording>& records);

}  // namespace bms::diagnosis
