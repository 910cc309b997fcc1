// Decides whether a sample was processed completely. Only then is the watchdog fed.
//
//   sampled     the time of the sample is later than that of the previous one. A measuring chain that delivers the same
//               sample again has stopped.
//   estimated   the estimator has processed the sample of this time. An estimator that returns without doing so has
//               stopped.
//   published   telemetry has reached its last frame. It does not matter whether a node listens or the bus accepts it.
//
// Missing readings count as progress: the protection opens the contactors for them, and a reset would not help. A part
// that hangs never returns to this class. The class checks results, not calls, so it also notices a skipped call.
#pragma once

#include <cstdint>

namespace bms::firmware {

class Progress {
 public:
  struct SampleProgress {
    std::uint64_t sample_us = 0;     ///< time of this sample
    std::uint64_t estimated_us = 0;  ///< time of the last sample that the estimator has processed
    std::uint32_t published = 0;     ///< samples that telemetry has published completely; wraps
  };

  /// Call once at the end of each sample. Returns true if the watchdog may be fed.
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
