// Plausibility of a recording: what looks wrong, but can be used. Each finding becomes a warning of the recording.
//
//   id                    the recording                                             found by
//   duplicate_time        has rows with the time of the previous row                check_recording
//   gap                   has a time step far above the median                      check_recording
//   current_inverted      has a voltage that falls where the current rises          check_recording
//   current_silent        has a current of exactly 0 while the voltage shows a load check_recording
//   soc_ref_in_percent    has a soc_ref far outside 0 .. 1                          check_recording
//   voltage_in_mv         has voltages that only make sense in millivolts           compare_with_cell
//   pack_voltage          has voltages of several cells in series                   compare_with_cell
//   current_in_ma         has currents that only make sense in milliamperes         compare_with_cell
//   time_in_ms            has times that only make sense in milliseconds            compare_with_cell
//   charge_exceeds_capacity
//                         moves more charge in one direction than the cell has      compare_with_cell
//   outside_cell_range    has values outside the limits of the cell file            compare_with_cell
//   ignored_column        has columns that are not used                             files::parse_recording
//   missing_reading       has readings that are empty or 'nan'                      files::parse_recording
//   truncated_line        breaks off in its last line                               files::parse_recording
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "measurement/recording.hpp"
#include "model/cell_parameters.hpp"

namespace bms::measurement {

/// Limit of a recording: 347 days at one sample per second. Reading needs 8 bytes of memory for each number.
inline constexpr std::size_t most_rows = 30'000'000;
/// Limit of all samples of a CAN log: 116 days. A replay needs about 260 bytes of memory per sample, so 2.6 GB at most.
inline constexpr std::size_t most_log_samples = 10'000'000;

/// Median of the time steps above 0; NaN if no step is.
double usual_step_s(const Recording& recording);

/// Adds the warnings that need no cell: time, sign of the current, unit of soc_ref.
void check_recording(Recording& recording);

/// Adds the warnings that need the limits and the capacity of a cell: units, values outside its range.
void compare_with_cell(Recording& recording, const model::CellParameters<>& cell);

/// The option of `bms import` that mends what the warning says of a unit; empty if it says nothing of one.
std::string_view unit_option(const Warning& warning);

/// The text of the first warning that no reading of this cell can explain: another unit, or a pack. Empty: none.
std::string contradiction(const Recording& recording);

}  // namespace bms::measurement
