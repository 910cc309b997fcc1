// What healthy recordings of a cell leave unexplained by its model: the standard against which a diagnosis compares the
// gain of a cause. Each recording, or each block of a long one, was diagnosed with a cell that was identified
// without it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

namespace bms::healthy_data {

/// Gain is a difference of -2 log posterior, >= 0: an effect of x standard deviations has x^2.
struct HealthyGain {
  std::string cause;  ///< id of a mechanism, or `unknown_cause`
  double gain = 0;
};

/// The cause of what generic columns find in the residual and no mechanism explains.
inline constexpr const char* unknown_cause = "unknown";

struct HealthyRange {
  double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();
  void add(double value) {
    if (!std::isfinite(value)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  void add(const HealthyRange& r) {
    low = std::min(low, r.low);
    high = std::max(high, r.high);
  }
  bool known() const { return high >= low; }
};

struct HealthyBlock {
  std::string recording;               ///< name of the file
  double start_s = 0, duration_s = 0;  ///< in its clock
  double error_v = 0;                  ///< RMS of measured less simulated, open loop
  HealthyRange soc, current_a, temperature_c;
  std::vector<HealthyGain> gains;  ///< of causes with any
};

/// The residual in a range of one axis.
struct HealthyRegime {
  std::string axis;         ///< "soc", "current_c", "temperature_c", "since_edge_s" or "since_start_s"
  double from = 0, to = 0;  ///< absolute value of a current
  double hours = 0;
  double bias_v = 0;  ///< mean
  double rms_v = 0;
  double spread_v = 0;  ///< standard deviation of the blocks' means
  double parts = 1;     ///< recordings that were there; of a single recording, its blocks
};

struct HealthyData {
  bool known = false;  ///< healthy recordings were given, even if no block of them could be diagnosed
  std::vector<HealthyBlock> blocks;
  std::vector<HealthyRegime> regimes;
  /// RMS of the error [V] that the noise and the tolerance of the cell file do not explain.
  double beyond_tolerance_v = 0;

  /// Whether there is something to compare a recording with.
  bool any() const { return !blocks.empty(); }
  double hours() const {
    double sum_s = 0;
    for (const HealthyBlock& b : blocks) sum_s += b.duration_s;
    return sum_s / 3'600;
  }
  std::size_t recordings() const {
    std::vector<std::string> names;
    for (const HealthyBlock& b : blocks) names.push_back(b.recording);
    std::sort(names.begin(), names.end());
    return static_cast<std::size_t>(std::unique(names.begin(), names.end()) - names.begin());
  }
};

}  // namespace bms::healthy_data
