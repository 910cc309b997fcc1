// Whether the voltage tells soc here and now, or charge counting carries it; and for how long, and over how much
// charge, it has.
//
//   observable   where 2 % of soc move the OCV by more than the model's error of the voltage
//   anchored     observable, and soc known to 2 %: from here the counting starts
//
// For displays and for decisions (balance, recalibrate, allow a full charge); asked when it is told, not with every
// sample.
#pragma once

#include <cstdint>

#include "estimator/estimate.hpp"
#include "estimator/voltage_doubt.hpp"
#include "model/extended_rc.hpp"

namespace bms::estimator {

template <class S>
class SocQuality {
  using Soc = arithmetic::Soc<S>;

 public:
  static constexpr double known_soc = 0.02;

  struct Now {
    bool observable = false;
    std::uint32_t bridged_s = 0;  ///< since the last anchor; since the start where there was none
    Soc bridged_soc{};            ///< charge moved since, either way, in capacities; 7 at most
  };

  /// at: what the tables say at the estimate's soc under drive. counted: how far the charge moved soc since the last
  /// call.
  constexpr Now update(const Estimate<S>& estimate, const model::TablePoint<S>& at, const model::Drive<S>& drive,
                       const Soc& counted, std::uint32_t step_ms, const arithmetic::Fraction<S>& resistance_error) {
    using namespace model;
    const Voltage<S> moves_v = ocv_slope<S>(at) * Fraction<S>(known_soc);
    const Variance<S> doubt_v2 = drop_doubt_v2<S>(at, drive.current_a, resistance_error);
    now_.observable =
        Variance<S>(moves_v * moves_v) > Variance<S>(at.error_v2 + doubt_v2) && (estimate.flags & not_now) == 0;
    if (now_.observable && estimate.soc_sigma < Soc(known_soc)) {
      now_.bridged_s = 0;
      left_ms_ = 0;
      now_.bridged_soc = Soc(0);
      return now_;
    }
    left_ms_ += step_ms;
    now_.bridged_s += left_ms_ / 1'000;
    left_ms_ %= 1'000;
    const Soc sum = Soc(now_.bridged_soc + magnitude(counted));
    now_.bridged_soc = sum > Soc(7) ? Soc(7) : sum;
    return now_;
  }

 private:
  static constexpr std::uint32_t not_now =
      voltage_missing | voltage_implausible | voltage_stuck | not_started | soc_unsettled | voltage_disbelieved;

  Now now_;
  std::uint32_t left_ms_ = 0;
};

}  // namespace bms::estimator
