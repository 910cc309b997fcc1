// Hardware in the loop: a board, and a simulated pack or a recording that it measures, in lock step.
//
// While the board keeps its contactors closed, the load follows a profile within the current that the board allows. An
// injected fault can make the load exceed that current. The session ends with the profile. Time is the time of the
// samples, so a run is as fast as simulation and board compute, and repeatable with a board in the emulator.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "authentication/codes.hpp"
#include "hil/board_link.hpp"
#include "hil/injection.hpp"
#include "hil/received_state.hpp"
#include "hil/simulated_pack.hpp"
#include "measurement/recording.hpp"

namespace bms::hil {

struct SessionPlan {
  files::CellFile cell;            ///< of the simulated pack
  measurement::Recording profile;  ///< its current is the load; if replayed, its voltages are the cell voltages,
                                   ///< those of v_1 to v_N if it has them for all cells
  bool replayed = false;     ///< the cells read the recording; its current flows only while the contactors are closed
  std::size_t cells = 16;    ///< 1 to max_cells, as the board has
  double initial_soc = 0.9;  ///< of the pack
  std::optional<double> announced_soc;  ///< sent to the board at the start; empty: the board estimates it
  double sample_period_s = 0.1;
  std::optional<authentication::Key> key;  ///< of the board; with it, requests for power are DriveRequests
  PackSpread spread;
  std::vector<Injection> injections;
};

/// An injection and the reaction of the board.
struct InjectionResult {
  Injection injection;
  std::optional<double> after_s;  ///< from its start until the expected fault was published; empty: it was not
  bool in_time = true;
};

/// Lowest and highest voltage of the first `cells` cells that have a reading; NaN if none has.
std::pair<double, double> voltage_range_v(const measurement::PackSample<max_cells>& sample, std::size_t cells);

/// A value that is not known is NaN.
struct TracePoint {
  double time_s, soc, soc_sigma, soc_true, current_a, lowest_v, highest_v, dc_link_v;
  double allowed_charge_a = 0, allowed_discharge_a = 0;  ///< NaN: not published
};

struct SessionResult {
  double duration_s = 0, speedup = 0;
  std::uint64_t samples = 0, frames = 0, lost = 0, crc_errors = 0, unanswered = 0;
  double soc_rmse = 0, soc_max_error = 0, within_2_sigma = 0, median_sigma = 0;
  std::uint64_t soc_published = 0;  ///< PackState messages with a valid SOC for which the true SOC is known
  std::uint64_t soc_wrong = 0;      ///< of these, wrong by more than 2 % and three sigma
  std::optional<double> driving_after_s;
  /// Replayed only: since then current flowed in the recording while the contactors were open. The SOC is not judged
  /// after that time.
  std::optional<double> cut_off_at_s;
  std::vector<FaultEvent> faults;
  std::vector<InjectionResult> injection_results;
  std::vector<TracePoint> trace;  ///< every one to ten seconds
};

/// Runs the plan to its end. Calls frame(time_s, f) for each frame that the board sends, and progress(fraction done).
/// Either function may be empty. Throws std::runtime_error if the board stops.
SessionResult run_session(BoardLink& link, const SessionPlan& plan,
                          const std::function<void(double, const can::Frame&)>& frame,
                          const std::function<void(double)>& progress);

}  // namespace bms::hil
