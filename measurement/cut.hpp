// A part of a recording.
#pragma once

#include "measurement/recording.hpp"

namespace bms::measurement {

/// Leaves the rows from from_s to until_s, both included, in seconds since the first row. All columns and the clock
/// stay as they are.
void cut(Recording& recording, double from_s, double until_s);

}  // namespace bms::measurement
