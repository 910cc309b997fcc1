// Whether a sample went all its way: only then is the watchdog fed.
//
//   sampled     its time is later than that of the sample before: a measuring chain that hands out the same sample
//   again has stopped estimated   the estimator has taken the sample of this time: one that returns without has stopped
//   told        telemetry has come to its last frame: whether the bus took it, and whether anybody listens, is the
//   bus's affair
//
// Readings that are missing are progress: the protection opens for them, a reset would not bring them back. A part that
// hangs never comes back here. Each part is asked for what it did, not whether it was called; a way around one of them
// leaves its question unanswered.
#pragma once

#include <cstdint>

namespace bms::firmware {

class Progress {
 public:
  struct SampleProgress {
    std::uint64_t sample_us = 0;     ///< time of the sample that was taken
    std::uint64_t estimated_us = 0;  ///< time of the last sample that the estimator has taken
    std::uint32_t published = 0;     ///< samples that telemetry has come to the end of; wraps
  };

  /// Once a sample, last of all. True: feed.
  constexpr bool complete(const SampleProgress& done) {
    const bool whole = (first_ || done.sample_us > sample_us_) && done.estimated_us == done.sample_us &&
                       done.published == published_ + 1;
    first_ = false;
    sample_us_ = done.sample_us;
    published_ = done.published;
    return whole;
  }

 private:
  std::uint64_t sample_us_ = 0;
  std::uint32_t published_ = 0;
  bool first_ = true;
};

}  // namespace bms::firmware
