// The state of charge at the start of a recording whose first voltage leaves it open.
#pragma once

#include "measurement/recording.hpp"
#include "workflow/recording_start.hpp"

namespace bms::workflow {

/// A first voltage on a flat part of the OCV fits many states of charge, and their mean need not be one that fits the
/// voltages after it: a diagnosis that begins there finds a cause that does not exist. Returns the start within three
/// standard deviations of `from` with the smallest open-loop error over the recording, with the sigma of `from`. A
/// start that is known well stays, and so does one that others do not clearly improve.
StartSoc likeliest_start(const measurement::Recording& recording, const files::CellFile& cell, const StartSoc& from);

}  // namespace bms::workflow
