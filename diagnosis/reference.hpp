// Readings of trusted instruments beside a recording. Leakage and an error of the current's zero have the same
// recording; with the contactor open, what the sensor reads is its own. An offset and a gain of the voltage differ on a
// source of two voltages; a contact lies between the voltage that is read and the cell's own terminals.
#pragma once

#include <span>

#include "diagnosis/prepared_recording.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis {

/// Sums rows that have a reference up to checks of five minutes at most. Columns as long as the record, NaN where there
/// was none, or empty. With the contactor open (current_ref_a 0) voltage_ref_v may be a source's in place of the
/// cell's: such a voltage is taken out of the record (NaN).
void average_references(PreparedRecording& record, std::span<const double> current_ref_a,
                        std::span<const double> voltage_ref_v, const model::CellParameters<>& cell);

/// How well a mean of so many readings can be compared: noise, the reference's own error, and an error that is not
/// quite steady. apart: reading less reference.
double check_deviation(Check::Channel channel, double apart, double readings, const model::CellParameters<>& cell);

}  // namespace bms::diagnosis
