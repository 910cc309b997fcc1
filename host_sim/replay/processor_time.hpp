// Processor time of the calling thread: what a computation costs, whatever else the machine does.
#pragma once

#include <ctime>

namespace bms::replay {

/// [s], since the thread began.
inline double processor_time_s() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace bms::replay
