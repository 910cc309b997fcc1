// What the current of a row is: the mean since the row before, as a counter gives it, or a single reading, as most
// monitors log it. A count of single readings is wrong by what the current did in between.
#pragma once

#include "diagnosis/pack/pack_recording.hpp"

namespace bms::diagnosis::pack {

/// Sets single_readings, count_walk and usual_step_s. A load that steps at random moments changes within its rows. A
/// mean then differs from the current at the moment of the voltages by at least half of what it differs from the mean
/// before, in squares; a reading does not. Of a load that is smooth over rows, or that steps between them, means are as
/// good as readings and are taken for them: their count then changes by half a row of the first and the last current.
void find_current_kind(PackRecording& pack, double capacity_ah);

/// Mean current over the interval that ends with row k, as far as it is known; NaN: unknown. Two readings say nothing
/// of an interval in which rows are missing: there it is current_a[k].
double mean_current_a(const PackRecording& pack, std::size_t k);

}  // namespace bms::diagnosis::pack
