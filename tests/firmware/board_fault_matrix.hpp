// Runs the fault matrix on the image of a board: the firmware of the forklift board in the emulator, with samples and
// commands as CAN frames. The oracle of tests/firmware/protection (oracle.hpp), which shares no code with the firmware,
// judges the messages that it sends.
//
//   cases      for each protection: just below its threshold, just above, noise of three sigma below, around and above
//              it, and during each other fault. Each case begins with a new board that drives. In addition the
//              eight-hour shift with noise of three sigma, in which no fault may be published.
//   time       from the sample with which the condition holds to the message Faults (0x196), and to the message
//              ContactorState (0x197) with both main contactors open. Frames come with the sample that caused them
//              (lock step). The latency of the bus is in firmware/can/README.md.
//   missed     the oracle has a fault that is not published; false: the opposite. Checked for every row that samples
//              determine, with every sample of every case
//
// Overload is compared with the ideal integral, contactor faults with curves of this test (README of
// firmware/protection/). Faults that no frame can cause (a watchdog reset, a failing flash) are tested on the boards in
// Unicorn.
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
  int silent = 0;                         ///< cases below the threshold without the fault
  DetectionTime above, in_noise, during;  ///< time until the fault was published
  DetectionTime opened;                   ///< time until both main contactors were open, for a fault that opens
};

struct MatrixResult {
  std::vector<MatrixRow> rows;  ///< by fault
  std::uint64_t cases = 0, samples = 0, missed = 0, falsely = 0;
  std::uint64_t shift_samples = 0;  ///< samples of the eight-hour shift, completed without a fault
  std::vector<std::string> wrong;   ///< one line per deviation
  bool traced = false;
  std::string trace;  ///< one line per sample, for cases chosen by name
};

/// every: all cases; otherwise for each fault the cases below and above, one with noise and one during another fault,
/// chosen by the seed. only: just the cases whose name contains this text, traced sample by sample.
MatrixResult run_fault_matrix(bool every, std::uint64_t seed, unsigned threads, const std::string& only = {});

/// The table of firmware/protection/README.md.
std::string markdown(const MatrixResult& result);

}  // namespace bms::protection
