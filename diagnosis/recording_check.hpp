// Can the recording be believed at all? What no physics can explain is looked for first: a diagnosis on top of it would
// name a mechanism for a broken clock.
//
// Faults that fill a recording end the diagnosis (DATA_FAULT); a few bad readings are taken out and told.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/prepared_recording.hpp"
#include "model/cell_parameters.hpp"
#include "model/mechanisms/contact_intermittent.hpp"

namespace bms::diagnosis {

struct DataFault {
  std::string id;  ///< "current_inverted", "current_in_ma", "voltage_in_mv", "gaps", "stuck_voltage", "stuck_current",
                   ///< "dropouts", "too_short", "clock"
  std::string text;                ///< one sentence
  std::vector<model::Span> spans;  ///< where
};

struct RecordingCheck {
  std::vector<DataFault> faults;      ///< that forbid a diagnosis
  std::vector<std::string> warnings;  ///< readings that were taken out
};

/// Takes unusable readings out of the record (NaN) and says what it found.
RecordingCheck check_recording(PreparedRecording& record, const model::CellParameters<>& cell);

}  // namespace bms::diagnosis
