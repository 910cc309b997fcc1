// The state of charge for a display: it moves with the charge that is counted, and takes in what the filter corrects
// only slowly, so that a driver never sees it jump. Beside the true estimate, not in its place: who steers by soc uses
// that.
//
// A correction is shown at `calm` per minute; near empty, where a display that says too much strands a truck, at ten
// times that.
#pragma once

#include "arithmetic/scalar.hpp"

namespace bms::estimator {

template <class S>
class DisplaySoc {
  using Soc = arithmetic::Soc<S>;

 public:
  static constexpr double slow_rate_per_s = 0.005 / 60, fast_rate_per_s = 10 * slow_rate_per_s;  ///< soc
  static constexpr double low_soc = 0.1;

  /// soc: the estimate; counted: how far the charge has moved it since the last call; step_s: time since then.
  constexpr Soc update(const Soc& soc, const Soc& counted, const arithmetic::TimeStep<S>& step_s) {
    const Soc clamped = soc > Soc(1) ? Soc(1) : soc < Soc(0) ? Soc(0) : soc;
    if (!started_) {
      started_ = true;
      return display_soc_ = clamped;
    }
    display_soc_ = Soc(display_soc_ + counted);
    const arithmetic::Rate<S> pace = clamped < Soc(low_soc) && clamped < display_soc_
                                         ? arithmetic::Rate<S>(fast_rate_per_s)
                                         : arithmetic::Rate<S>(slow_rate_per_s);
    const Soc most = Soc(pace * step_s), off = Soc(clamped - display_soc_);
    display_soc_ = off > most ? Soc(display_soc_ + most) : off < -most ? Soc(display_soc_ - most) : clamped;
    if (display_soc_ > Soc(1)) display_soc_ = Soc(1);
    if (display_soc_ < Soc(0)) display_soc_ = Soc(0);
    return display_soc_;
  }

 private:
  Soc display_soc_{};
  bool started_ = false;
};

}  // namespace bms::estimator
