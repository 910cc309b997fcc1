// A CAN log of a truck in candump format (also gzip). It has the samples that the estimator of the firmware received
// and a hash of its estimates, so that a replay of the samples can be compared with the firmware bit by bit.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host_sim/replay.hpp"
#include "measurement/recording.hpp"

namespace bms::host_sim {

struct CanLog {
  measurement::Recording recording;  ///< the samples as numbers; its warnings name what is missing
  std::vector<measurement::Sample> samples;
  std::optional<measurement::StartingPoint> start;
  bool from_the_start = false;  ///< begins with the first sample of the firmware, and has its starting point
  std::vector<std::optional<std::uint32_t>> hashes;  ///< after each sample
  std::size_t unbroken = 0;                          ///< samples before the first lost one
  std::optional<std::uint32_t> cell_hash;
};

/// Returns true if the file begins like a candump log, or like gzip.
bool is_can_log(const std::string& path);

/// Throws BadInput if the file cannot be read or has no samples.
CanLog read_can_log(const std::string& path);

/// Compares a replay of log.samples with the estimates of the firmware. Returns nothing if all that can be compared is
/// equal, else the first difference in words. compared: number of samples that were compared.
std::optional<std::string> difference_to_log(const CanLog& log, const Track& track, std::size_t& compared);

}  // namespace bms::host_sim
