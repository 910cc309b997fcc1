// The fault matrix against a board's own image: the forklift board's firmware in the emulator, samples and commands as
// CAN frames, and what it says on CAN judged by the oracle of tests/protection (oracle.hpp), which shares no code with
// the firmware.
//
//   cases      of each protection: just below its threshold, just above, three sigma of noise below, around and above
//   it, and during each other fault;
//              each begins with a new board that is driven off. And the eight-hour shift with three sigma of noise, in
//              which nothing is to be told
//   time       from the sample with which the condition holds to the frame Faults (0x196) that says so, and to the
//   frame ContactorState (0x197) with both
//              main contactors open. Frames come with the sample that caused them (lock step): the bus's own latency is
//              can/README.md's
//   missed     the oracle's fault is there and is not told, false: the other way; of every row that samples tell, with
//   every sample of every case
//
// Heat is judged by the ideal integral, contactors by their own curves (README of protection/). What no frame can bring
// about (a reset by the watchdog, flash that fails) is in bxcan_board_test.cpp.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace bms::protection {

struct DetectionTime {
  int cases = 0, soonest_ms = 0, latest_ms = -1;

  void add(int ms) {
    soonest_ms = cases == 0 || ms < soonest_ms ? ms : soonest_ms;
    latest_ms = ms > latest_ms ? ms : latest_ms;
    ++cases;
  }
};

struct MatrixRow {
  int silent = 0;                         ///< cases below the threshold, in which it did not come
  DetectionTime above, in_noise, during;  ///< after what time it was told
  DetectionTime opened;  ///< after what time both main contactors were told open, of a fault that opens
};

struct MatrixResult {
  std::vector<MatrixRow> rows;  ///< by fault
  std::uint64_t cases = 0, samples = 0, missed = 0, falsely = 0;
  std::uint64_t shift_samples = 0;  ///< of the eight-hour shift, driven to its end without a fault
  std::vector<std::string> wrong;   ///< a line each
  bool traced = false;
  std::string trace;  ///< a line for each sample, of cases that were chosen by name
};

/// every: all cases; else of each fault those below and above, and one of noise and one during another, drawn by seed.
/// only: of those, the ones whose name holds that text, traced sample by sample.
MatrixResult run_fault_matrix(bool every, std::uint64_t seed, unsigned threads, const std::string& only = {});

/// As in protection/README.md.
std::string markdown(const MatrixResult& result);

}  // namespace bms::protection
