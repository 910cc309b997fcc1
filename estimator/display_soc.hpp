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
  static constexpr double calm_per_s = 0.005 / 60, hasty_per_s = 10 * calm_per_s;  ///< soc
  static constexpr double nearly_empty = 0.1;

  /// soc: the estimate; counted: how far the charge has moved it since the last call; step_s: time since then.
  constexpr Soc show(const Soc& soc, const Soc& counted, const arithmetic::TimeStep<S>& step_s) {
    const Soc held = soc > Soc(1) ? Soc(1) : soc < Soc(0) ? Soc(0) : soc;
    if (!started_) {
      started_ = true;
      return shown_ = held;
    }
    shown_ = Soc(shown_ + counted);
    const arithmetic::Rate<S> pace =
        held < Soc(nearly_empty) && held < shown_ ? arithmetic::Rate<S>(hasty_per_s) : arithmetic::Rate<S>(calm_per_s);
    const Soc most = Soc(pace * step_s), off = Soc(held - shown_);
    shown_ = off > most ? Soc(shown_ + most) : off < -most ? Soc(shown_ - most) : held;
    if (shown_ > Soc(1)) shown_ = Soc(1);
    if (shown_ < Soc(0)) shown_ = Soc(0);
    return shown_;
  }

 private:
  Soc shown_{};
  bool started_ = false;
};

}  // namespace bms::estimator
