// Faults of the voltage channels that are visible before any physics: readings that are repeated, late, or missing.
//
// Where the model moves by several steps of the converter from one row to the next, a reading that stays the same was
// not read again. The time between changes is the time for which a reading is repeated. Only rows in which a held
// channel has changed are compared with the other cells.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "diagnosis/pack/pack_recording.hpp"
#include "diagnosis/pack/track.hpp"

namespace bms::diagnosis::pack {

struct ChannelState {
  std::size_t moving_rows = 0;   ///< in which a reading must change
  double frozen_share = 0;       ///< of them: the reading did not change
  std::optional<double> held_s;  ///< time between changes; set if the channel is held
  double missing_share = 0;      ///< rows without a reading, or with one that is impossible
  std::size_t glitches = 0;      ///< readings that are impossible
  double lag_s = 0;              ///< that fits best, in whole rows
  /// Apparent resistance at steps of the current [ohm]: in rows with a new reading, and in all others.
  double fresh_ohm = 0, stale_ohm = 0;
};

struct PackFinding;

struct Channels {
  std::vector<ChannelState> cells;
  std::optional<double> pack_ohm;  ///< apparent resistance of the pack's voltmeter over the number of cells

  /// Cells that are repeated, ascending.
  std::vector<std::size_t> repeated() const;
  double usual_lag_s() const;
  bool are_mostly_held() const;
  /// Cells that lag by more than a row behind most others; none if they are many.
  std::vector<std::size_t> late(double step_s) const;
};

/// Removes impossible readings and the repeated readings of held channels from `pack`.
Channels check_channels(const Track& track, PackRecording& pack);

/// Adds the held channels and those without many readings.
void add_findings(const Channels& channels, std::vector<PackFinding>& findings);

}  // namespace bms::diagnosis::pack
