// Whether the voltage determines the SOC now, or charge counting carries it; for how long, and over how much charge, it
// has been carried.
//
//   observable   2 % of SOC change the OCV by more than the model's voltage error
//   anchored     observable, and the SOC is known to 2 %: time and charge are counted from here
//
// For displays and for decisions (balance, recalibrate, allow a full charge).
#pragma once

#include <cstdint>

#include "estimator/estimate.hpp"
#include "estimator/voltage_uncertainty.hpp"
#include "model/extended_rc.hpp"

namespace bms::estimator {

template <class S>
class SocQuality {
  using Soc = arithmetic::Soc<S>;

 public:
  static constexpr double known_soc = 0.02;

  struct Result {
    bool observable = false;
    std::uint32_t since_anchor_s = 0;  ///< since the last anchor, or since the start before the first one
    Soc since_anchor_soc{};            ///< charge moved since then in either direction, in capacities; 7 at most
  };

  /// at: tables at the estimate's SOC under this input. counted: change of the SOC by the counted charge since the last
  /// call.
  constexpr Result update(const Estimate<S>& estimate, const model::TablePoint<S>& at, const model::StepInput<S>& input,
                          const Soc& counted, std::uint32_t step_ms, const arithmetic::Fraction<S>& resistance_error) {
    using namespace model;
    const Voltage<S> moves_v = ocv_slope<S>(at) * Fraction<S>(known_soc);
    const Variance<S> resistance_v2 = drop_variance_v2<S>(at, input.current_a, resistance_error);
    result_.observable = Variance<S>(moves_v * moves_v) > Variance<S>(at.error_v2 + resistance_v2) &&
                         (estimate.flags & unobservable_flags) == 0;
    if (result_.observable && estimate.soc_sigma < Soc(known_soc)) {
      result_.since_anchor_s = 0;
      part_of_second_ms_ = 0;
      result_.since_anchor_soc = Soc(0);
      return result_;
    }
    part_of_second_ms_ += step_ms;
    result_.since_anchor_s += part_of_second_ms_ / 1'000;
    part_of_second_ms_ %= 1'000;
    const Soc sum = Soc(result_.since_anchor_soc + magnitude(counted));
    result_.since_anchor_soc = sum > Soc(7) ? Soc(7) : sum;
    return result_;
  }

 private:
  static constexpr std::uint32_t unobservable_flags = voltage_missing | voltage_implausible | voltage_stuck |
                                                      not_started | soc_ambiguous | voltage_rejected | not_a_number;

  Result result_;
  std::uint32_t part_of_second_ms_ = 0;
};

}  // namespace bms::estimator
