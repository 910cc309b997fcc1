// What the current sensor reads while the cell rests: no charger is on after a discharge, so a charging current that is
// read in every such rest is an error of the sensor. A discharging one may be a device that is always on.
#pragma once

#include "diagnosis/prepared_recording.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis {

/// Adds a check of the current (PreparedRecording::checks) for each rest if the sensor reads the same small charging
/// current in several rests that follow a discharge (Thresholds::IdleReading). Stretches of exact zeros do not count:
/// many instruments write them while they do not measure.
void add_idle_checks(PreparedRecording& record, const model::CellParameters<>& cell);

}  // namespace bms::diagnosis
