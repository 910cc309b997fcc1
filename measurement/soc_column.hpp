// Whether the state-of-charge column of a log is a count of the charge that the same log shows.
//
//   soc(t) = a + x * q(t) / capacity + d * t      a count has x = 1 and d = 0 within the resolution of the column
//
// Increments that the charge does not explain are jumps. If many of them follow the voltage instead, the column is a
// table of voltages. What is left decides between another capacity (x) and a drift (d, which may begin later).
#pragma once

#include <string>
#include <vector>

#include "measurement/recording.hpp"

namespace bms::measurement {

enum class SocFault {
  jump,      ///< size: change of the column, as a fraction
  reset,     ///< a jump to 100 %; size as above
  stuck,     ///< does not move while charge flows; size: the charge, as a fraction of the capacity
  drift,     ///< size: change that no charge explains until the end, as a fraction
  capacity,  ///< counts with another capacity; size: that capacity [Ah]
  table,     ///< follows the voltage; size: largest change that no charge explains, as a fraction
};

struct SocEvent {
  double time_s = 0;  ///< of the recording
  SocFault fault = SocFault::jump;
  double size = 0;
};

/// Detection limits: a jump, a drift over the log or a charge without a change of 2 % plus the column's resolution,
/// another capacity of 5 % that changes the column as much. A charge that is unknown within a row is not blamed on the
/// column.
struct SocColumn {
  bool is_count = true;
  std::vector<SocEvent> events;  ///< in the order of time
  double resolution = 0;         ///< step of the column, as a fraction; 0: finer than 0.01 %
  bool contradicts() const;      ///< jumps, holds or follows the voltage: not a reference
};

/// Judges Recording::soc_ref, whose size must be that of the rows. Nothing is blamed in a column of fewer than 20
/// values.
SocColumn judge_soc_column(const Recording& recording, double capacity_ah);

/// "jump", "reset", ...
const char* name_of(SocFault fault);
/// One sentence; empty for a count. capacity_ah: of the cell file.
std::string sentence_of(const SocColumn& column, double first_s, double capacity_ah);

}  // namespace bms::measurement
