// What a current sensor reads at rest.
#pragma once

#include "ammeter/ammeter.hpp"
#include "files/cell_file.hpp"
#include "measurement/recording.hpp"

namespace bms::ammeter {

/// The mean reading over stretches of two to ten minutes in which the reading is small and constant. It is the offset
/// if no current flows then; the remark says so. No answer if the stretches differ, if they are fewer than three, or if
/// the reading is exactly 0, which a device may write by itself.
/// A log without any load is one rest if its readings are constant: the remark says so, because a small load that never
/// changes looks the same.
SensorFinding reading_at_rest(const measurement::Recording& recording, const files::CellFile& cell);

/// The mean reading of a recording during which no current can flow. No answer if it has fewer than 30 readings, or if
/// all of them are exactly 0, which a device may write by itself. The standard deviation includes the drift between
/// minutes.
SensorFinding reading_without_current(const measurement::Recording& recording);

}  // namespace bms::ammeter
