// Where a trusted instrument reads alongside nearly all the time, the error of an instrument is not inferred from the
// cell: it is the difference of both. Inferred from the cell, a gain of 0.7 % that a second ammeter showed disappeared
// in the calibration's tolerance, and a contact of 0.48 ohm read UNKNOWN although both references were there.
//
//   current:  read - trusted = gain trusted + offset
//   voltage:  read - trusted = gain trusted + offset + contact I       trusted: at the cell's own terminals
//
// Which of these are there is chosen by how much each reduces the squared difference.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/prepared_recording.hpp"
#include "model/cell_parameters.hpp"
#include "model/extended.hpp"

namespace bms::diagnosis {

/// An error of an instrument, with its standard deviation.
struct InstrumentError {
  model::MechanismSetting setting;
  double gain = 0;                         ///< of -2 log likelihood, over the same without it
  std::vector<std::size_t> equivalent_to;  ///< catalogue indices of what explains the difference as well
};

/// Returns true if the trusted instrument of this kind read in nearly all rows.
bool has_trusted(const PreparedRecording& record, Check::Channel channel);

/// Errors of both instruments, the larger gain first. What is within the tolerance of the cell file does not count.
std::vector<InstrumentError> compare_instruments(const std::vector<PreparedRecording>& records,
                                                 const model::CellParameters<>& cell);

/// Returns true if a current was read with the opposite sign of the trusted one.
bool is_inverted(const PreparedRecording& record);

}  // namespace bms::diagnosis
