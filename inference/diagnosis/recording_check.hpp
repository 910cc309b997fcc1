// Is the recording usable at all? What no physics can explain is checked first: a diagnosis on top of it would name a
// mechanism for a broken clock.
//
// Faults of the whole recording end the diagnosis (DATA_FAULT). Single bad readings are removed and reported.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "diagnosis/prepared_recording.hpp"
#include "model/cell_parameters.hpp"
#include "model/mechanisms/contact_intermittent.hpp"

namespace bms::diagnosis {

struct DataFault {
  std::string id;    ///< "voltage_in_mv", "current_in_ma", "dropouts", "stuck_voltage", "gaps", "current_inverted"
  std::string text;  ///< what is wrong and what to do next
  std::vector<model::Span> spans;  ///< where
};

struct RecordingCheck {
  std::vector<DataFault> faults;      ///< that prevent a diagnosis
  std::vector<std::string> warnings;  ///< readings that were removed
};

/// The current has the wrong sign.
DataFault inverted_current();

/// The longest time [s] between rows in which nothing changed, if the logger writes rows on change; else 0. Such a
/// logger makes many long steps, and the current is the same at both ends of nearly all of them. One that stops in a
/// drive comes back at another current.
double longest_unchanged_s(std::span<const double> time_s, std::span<const double> current_a, double capacity_ah);

/// Removes unusable readings from the record (NaN) and reports what it found.
RecordingCheck check_recording(PreparedRecording& record, const model::CellParameters<>& cell);

}  // namespace bms::diagnosis
