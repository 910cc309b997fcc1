// A recording with fewer rows and the same charge, for fits that simulate it many times.
#pragma once

#include <cstddef>

#include "measurement/recording.hpp"

namespace bms::measurement {

/// Rows of about the same duration, at most `most` + 1 of them, fewer with gaps: current, voltage and temperature are
/// means over the rows that they replace, the current by time. Other columns are left out. A recording that is short
/// enough stays as it is.
Recording thinned(const Recording& recording, std::size_t most);

}  // namespace bms::measurement
