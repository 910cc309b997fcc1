// A board in the loop: a simulated pack or a recording on one side, what the board says on CAN on the other, truth
// against it.
//
// The load follows a profile while the board has its contactors closed and takes no more than the board allows, unless
// it is told not to obey; without a profile's end everything ends with it. Time is the samples': as fast as both sides
// compute, and the same every time.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "hil/board_link.hpp"
#include "hil/injection.hpp"
#include "hil/simulated_pack.hpp"
#include "measurement/recording.hpp"

namespace bms::hil {

struct SessionPlan {
  files::CellFile cell;  ///< the pack's, in truth
  measurement::Recording
      profile;             ///< its current is the load's; with voltages, and replayed: its voltages are the cells'
  bool replayed = false;   ///< the cells read what was recorded; its current flows only while the contactors are closed
  std::size_t cells = 16;  ///< 1 or 16: as the board has
  double initial_soc = 0.9;             ///< of the pack
  std::optional<double> announced_soc;  ///< what the board is told; nothing: it finds out
  double sample_period_s = 0.1;
  PackSpread spread;
  std::vector<Injection> injections;
};

/// A bit of the message Faults.
struct FaultEvent {
  std::string name;
  double raised_at_s = 0;
  std::optional<double> cleared_at_s;
};

/// An injection, and what came of it.
struct InjectionResult {
  Injection injection;
  std::optional<double> after_s;  ///< until the expected fault was told; nothing: it was not
  bool in_time = true;
};

struct TracePoint {
  double time_s, soc, soc_sigma, soc_true, current_a, lowest_v, highest_v, dc_link_v;
  std::string state;
};

struct SessionResult {
  double duration_s = 0, speedup = 0;
  std::uint64_t samples = 0, frames = 0, lost = 0, crc_errors = 0, unanswered = 0;
  double soc_rmse = 0, soc_max_error = 0, within_2_sigma = 0, median_sigma = 0;
  std::uint64_t soc_published = 0;  ///< times that a soc was told as valid
  std::uint64_t soc_wrong = 0;      ///< of these, more than three sigma and 2 % off
  std::optional<double> driving_after_s;
  std::optional<double> cut_off_at_s;  ///< replayed: since then current flowed in the recording while the contactors
                                       ///< were open; what the board tells of soc is not judged from there on
  std::vector<FaultEvent> faults;
  std::vector<InjectionResult> injection_results;
  std::vector<TracePoint> trace;  ///< every few seconds
};

/// frame(time_s, f): each that the board sends. progress(part done).
SessionResult run_session(BoardLink& link, const SessionPlan& plan,
                          const std::function<void(double, const can::Frame&)>& frame,
                          const std::function<void(double)>& progress);

}  // namespace bms::hil
