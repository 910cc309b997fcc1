// A cell file for a cell of another size or chemistry: what scales with the capacity, and limits of use that are not
// copied from another cell.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "files/cell_file.hpp"
#include "measurement/recording.hpp"

namespace bms::workflow {

/// Limits of use as the user states them; what is not given is derived.
struct StatedLimits {
  std::optional<double> voltage_min_v, voltage_max_v, charge_current_max_a, discharge_current_max_a, temperature_min_c,
      temperature_max_c;
  bool any() const;
};

/// Cells in parallel instead of one: resistances divided, C1 and currents multiplied by the ratio of the capacities,
/// also in mechanisms. Voltages, times and the OCV stay. Values are clamped to what a cell file accepts; the ids of
/// those that were are returned.
std::vector<std::string> scale_to(double capacity_ah, files::CellFile& cell);

/// "LFP", "LTO" or "NMC" (also NCA), by the voltages of a cell in use. Source: the nominal voltages 3.2, 2.3 and 3.6 V.
std::string chemistry_of(const std::vector<measurement::Recording>& recordings);

/// Writes limits into `cell`. Voltages: stated, or usual for the chemistry and no narrower than the recordings.
/// Currents: stated, or the 1C current, or the largest current that the recordings sustain for ten seconds.
/// Temperatures: stated, or usual for the chemistry. Returns the sentence for [limits] source.
std::string derive_limits(const StatedLimits& stated, const std::string& chemistry,
                          const std::vector<measurement::Recording>& recordings, files::CellFile& cell);

}  // namespace bms::workflow
