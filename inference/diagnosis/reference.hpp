// Readings of trusted instruments alongside a recording. A leakage and an error of the current sensor's zero have the
// same recording; with the contactor open, the sensor reads its own error. An offset and a gain of the voltage differ
// on a source of two voltages. A contact lies between the voltage that is read and the cell's own terminals.
#pragma once

#include <span>

#include "diagnosis/prepared_recording.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis {

/// Keeps the readings of a trusted instrument that read in nearly all rows (trusted_readings.hpp). Averages rows that
/// have a reference to checks, over Thresholds::References::check_at_most_s at most. Columns as long as the record, NaN
/// where there was no reference, or empty. With the contactor open (current_ref_a 0) voltage_ref_v may be a source's
/// voltage instead of the cell's: such a voltage is removed from the record (NaN).
void average_references(PreparedRecording& record, std::span<const double> current_ref_a,
                        std::span<const double> voltage_ref_v, const model::CellParameters<>& cell);

/// Sets the deviation of a check that is the mean of so many readings: noise and the reference's own error, and an
/// error that is not quite steady.
void set_deviation(Check& check, double readings, const model::CellParameters<>& cell);

}  // namespace bms::diagnosis
