// The judgement of a log's own SOC column as one sentence.
#pragma once

#include <string>

#include "measurement/soc_column.hpp"

namespace bms::measurement {

/// Judges the column of a recording and says it in one sentence; empty for a count and without a column.
std::string soc_column_text(const Recording& recording, double capacity_ah);

}  // namespace bms::measurement
