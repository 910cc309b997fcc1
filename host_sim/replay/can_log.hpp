// A CAN log of a truck in candump format (also gzip). It has the samples that the estimator of the firmware received
// and a hash of its estimates, so that a replay of the samples can be compared with the firmware bit by bit.
//
// A log may contain several runs of the firmware: it was restarted, or parts of several days were joined. A run ends
// where the firmware's time goes back, advances much more than the time of the frames, or much less although samples
// are missing. Runs have nothing in common, so each is a recording of its own.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "measurement/recording.hpp"
#include "replay/replay.hpp"

namespace bms::replay {

/// One run of the firmware.
struct CanLog {
  measurement::Recording recording;  ///< the samples as numbers; its warnings name what is missing
  std::vector<measurement::Sample> samples;
  Start start;
  bool from_the_start = false;  ///< begins with the first sample of the firmware, and has its starting point
  std::vector<std::optional<std::uint32_t>> hashes;  ///< after each sample
  std::size_t unbroken = 0;                          ///< samples before the first lost one
  std::uint64_t lost = 0;                            ///< samples that the counter shows to be missing
  std::optional<std::uint32_t> cell_hash;
};

/// Returns true if the path is a regular file that begins like a candump log, or like gzip.
bool is_can_log(const std::string& path);

/// The runs of a log, the earliest first, at least one. A run of less than ten samples, or whose time does not
/// increase, is left out. Throws BadInput if the file cannot be read, has no run, or has more than
/// measurement::most_log_samples samples.
std::vector<CanLog> read_can_log(const std::string& path);

/// Compares a replay of log.samples with the estimates of the firmware. Returns nothing if all that can be compared is
/// equal, else the first difference in words. compared: number of samples that were compared.
std::optional<std::string> difference_to_log(const CanLog& log, const Track& track, std::size_t& compared);

}  // namespace bms::replay
