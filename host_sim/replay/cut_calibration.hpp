// Whether the standard deviation of the state of charge means what it says: the probability integral transform of the
// errors over all cuts of all recordings (host_sim/replay/cuts.hpp). The normal distribution that an estimate states
// has a probability below the truth; over many estimates these probabilities are uniform from 0 to 1. Too few in the
// middle: sigma is too small; too many: too wide; more on one side: the estimate is biased.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "measurement/recording.hpp"

namespace bms::replay {

struct CutResult;

/// Estimates by how probable each says that the truth is below it.
struct Calibration {
  std::array<double, 4> quarters{};  ///< estimates whose probability is in 0 to 1/4, to 1/2, to 3/4, to 1
  double within_2_sigma = 0;         ///< estimates
  double count() const { return quarters[0] + quarters[1] + quarters[2] + quarters[3]; }
  /// error: estimate minus truth; sigma > 0.
  void add(double error, double sigma);
};

/// Groups of estimates: by time since the start, temperature and current.
inline constexpr std::array<double, 5> calibration_from_min{0, 10, 30, 60, 240};
inline constexpr std::array<double, 4> calibration_from_c{-100, 0, 15, 30};
inline constexpr std::array<double, 4> calibration_from_c_rate{0, 0.02, 0.5, 1};
inline constexpr std::size_t calibration_groups =
    calibration_from_min.size() + calibration_from_c.size() + calibration_from_c_rate.size();

using Calibrations = std::array<Calibration, calibration_groups>;

/// Adds the estimate of a row to its groups. capacity_ah: of the cell file; a recording without temperatures counts as
/// 25 degrees C.
void add_to_groups(Calibrations& groups, const measurement::Recording& recording, std::size_t row, double since_start_s,
                   double error, double sigma, double capacity_ah);

/// Markdown: shares of each group over all results, each recording counts once. A start that is exactly right is better
/// than its sigma and one that is far off is worse, so only drawn and unknown starts are shown.
std::string calibration_table(std::span<const CutResult> results);

}  // namespace bms::replay
