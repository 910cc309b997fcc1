// A truck's log: CAN frames as candump keeps them (also gzip), with the samples as the firmware's estimator saw them
// and a hash of all that it computed. What a replay of the samples gives can be compared with that, bit for bit.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host_sim/replay.hpp"
#include "measurement/recording.hpp"

namespace bms::host_sim {

struct CanLog {
  measurement::Recording recording;  ///< the same as numbers; its warnings tell of what is missing
  std::vector<measurement::Sample> samples;
  std::optional<measurement::StartingPoint> start;
  bool from_the_start = false;  ///< begins with the firmware's first sample, and says where it began
  std::vector<std::optional<std::uint32_t>> hashes;  ///< after each sample
  std::size_t unbroken = 0;                          ///< samples before the first that got lost
  std::optional<std::uint32_t> cell_hash;
};

/// Whether the file begins as a candump log does, or as gzip.
bool is_can_log(const std::string& path);

/// Throws BadInput: no frames, no samples among them.
CanLog read_can_log(const std::string& path);

/// Compares a replay of log.samples with what the firmware computed. Nothing: all that can be compared is equal; else
/// where it is not, in words. compared: samples whose hash was.
std::optional<std::string> difference_to_log(const CanLog& log, const Track& track, std::size_t& compared);

}  // namespace bms::host_sim
