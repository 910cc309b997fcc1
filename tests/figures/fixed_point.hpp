// The estimator in integers over the shift and every real recording: how far it is from the estimator in double, and
// whether the Cortex-M0 computes the host's words.
//
// Each recording with the cell file that is made for it; the drives and pulses of the first cell with the extended
// file, too. Not the slow runs: a C/30 current that stays for hours is within what that file says may be the sensor's
// offset, and is taken for it (estimator/current_at_rest.hpp). What soc is sought anew from then on is chance in every
// scalar.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "host_sim/replay.hpp"

namespace bms {

struct FixedPointRun {
  std::string recording, cell;
};
/// data: the folder of real recordings; where it is not, the shift alone.
std::vector<FixedPointRun> fixed_point_runs(const std::filesystem::path& shift, const std::filesystem::path& data);

/// Largest difference of soc from the estimator in double.
struct Deviation {
  std::size_t estimates = 0;
  double of_fixed = 0, of_float = 0;
};
Deviation deviation(const FixedPointRun& run);

/// Where the microbit's first word that is not the host's is, or nothing.
std::optional<host_sim::Difference> difference_on_microbit(const FixedPointRun& run);

}  // namespace bms
