// The judgement of a log's own SOC column, for commands that show it.
#pragma once

#include <optional>

#include "measurement/soc_column.hpp"

namespace bms::measurement {

/// Judges the column of a recording; nothing without one, or if it follows the current of a reference instrument.
std::optional<SocColumn> own_soc_column(const Recording& recording, double capacity_ah);

/// Adds the warning "soc_column" with `before` and one sentence, unless the column is a count.
void warn_of_soc_column(const std::optional<SocColumn>& column, const Recording& recording, double capacity_ah,
                        const std::string& before, std::vector<Warning>& warnings);

}  // namespace bms::measurement
