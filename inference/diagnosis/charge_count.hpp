// One pass over a recording: the current that flows in each row, and the charge counted from it.
//
// Where the current has no reading (NaN) the last one that was read still flows; before the first one nothing flows.
#pragma once

#include <cmath>
#include <cstddef>

#include "diagnosis/prepared_recording.hpp"

namespace bms::diagnosis {

struct CountedRow {
  std::size_t k = 0;      ///< row of the recording
  double duration_s = 0;  ///< since the row before; 0 in the first row
  double previous_a = 0;  ///< current of the row before
  double current_a = 0;   ///< last current that was read
  double moved_soc = 0;   ///< charge of this row over the capacity, > 0 charging
  double soc = 0;         ///< counted from the recording's start, without limits
};

/// f(const CountedRow&) for each row, in order.
template <class F>
void for_each_row(const PreparedRecording& r, double capacity_ah, F&& f) {
  CountedRow row;
  row.soc = r.initial_soc;
  for (; row.k < r.size(); ++row.k) {
    row.duration_s = row.k > 0 ? r.time_s[row.k] - r.time_s[row.k - 1] : 0;
    row.previous_a = row.current_a;
    if (std::isfinite(r.current_a[row.k])) row.current_a = r.current_a[row.k];
    row.moved_soc = row.current_a * row.duration_s / (3'600 * capacity_ah);
    row.soc += row.moved_soc;
    f(static_cast<const CountedRow&>(row));
  }
}

}  // namespace bms::diagnosis
