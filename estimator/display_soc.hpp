// The state of charge for a display. It follows the counted charge at once and the corrections of the filter slowly, so
// that a driver never sees it jump. It does not replace the estimate: control functions use the estimate itself.
//
// A correction is shown at 0.5 % per minute. Near empty, where a display that shows too much strands a truck, downward
// corrections are ten times as fast.
#pragma once

#include "arithmetic/scalar.hpp"

namespace bms::estimator {

template <class S>
class DisplaySoc {
  using Soc = arithmetic::Soc<S>;

 public:
  static constexpr double slow_rate_per_s = 0.005 / 60, fast_rate_per_s = 10 * slow_rate_per_s;  ///< SOC per second
  static constexpr double low_soc = 0.1;

  /// soc: the estimate; counted: change of the SOC by the counted charge since the last call; step_s: time since then.
  constexpr Soc update(const Soc& soc, const Soc& counted, const arithmetic::TimeStep<S>& step_s) {
    const Soc clamped = in_range(soc);
    if (!started_) {
      started_ = true;
      return display_soc_ = clamped;
    }
    display_soc_ = Soc(display_soc_ + counted);
    const arithmetic::Rate<S> rate = clamped < Soc(low_soc) && clamped < display_soc_
                                         ? arithmetic::Rate<S>(fast_rate_per_s)
                                         : arithmetic::Rate<S>(slow_rate_per_s);
    const Soc most = Soc(rate * step_s), off = Soc(clamped - display_soc_);
    if (off > most)
      display_soc_ = Soc(display_soc_ + most);
    else if (off < -most)
      display_soc_ = Soc(display_soc_ - most);
    else
      display_soc_ = clamped;
    return display_soc_ = in_range(display_soc_);
  }

 private:
  [[gnu::always_inline]] static constexpr Soc in_range(const Soc& soc) {
    if (soc > Soc(1)) return Soc(1);
    return soc < Soc(0) ? Soc(0) : soc;
  }

  Soc display_soc_{};
  bool started_ = false;
};

}  // namespace bms::estimator
