// What the diagnosis of a healthy recording leaves, for the cell file.
#pragma once

#include "diagnosis/diagnose.hpp"

namespace bms::diagnosis {

/// Returns true if the diagnosis says anything about the model: no fault of the data, and a changing load.
inline bool is_usable_as_healthy(const Diagnosis& d) { return !d.views.empty(); }

/// d: of the record alone, with Options::learns.
healthy_data::HealthyBlock healthy_block(const PreparedRecording& record, const Diagnosis& d);

}  // namespace bms::diagnosis
