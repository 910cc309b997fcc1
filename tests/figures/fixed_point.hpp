// The estimator in fixed point over the shift and every real recording: its difference from the estimator in double,
// and whether the Cortex-M0 computes the same words as the host.
//
// Each recording runs with its own cell file; the drives and pulses of the first cell also with the extended file. The
// slow runs do not: a C/30 current that lasts for hours is within the offset that the extended file assumes for the
// sensor, and is taken for it (estimator/current_at_rest.hpp). The state of charge is then estimated again, and where
// it ends depends on rounding in every scalar.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "replay/replay.hpp"

namespace bms {

struct FixedPointRun {
  std::string recording, cell;
};
/// data: the folder of real recordings. If it does not exist, the shift alone.
std::vector<FixedPointRun> fixed_point_runs(const std::filesystem::path& shift, const std::filesystem::path& data);

/// Largest difference of soc from the estimator in double.
struct Deviation {
  std::size_t estimates = 0;
  double of_fixed = 0, of_float = 0;
};
Deviation deviation(const FixedPointRun& run);

/// The first word of the microbit that differs from the host, or nothing.
std::optional<replay::Difference> difference_on_microbit(const FixedPointRun& run);

}  // namespace bms
