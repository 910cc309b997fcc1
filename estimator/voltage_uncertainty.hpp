// What stands between a voltage and a state of charge: the slope of the OCV, what falls off over the resistances, and
// by how much that is doubted.
#pragma once

#include "model/cell.hpp"

namespace bms::estimator {

/// Of the OCV, at one point of the tables.
template <class S>
constexpr arithmetic::VoltagePerSoc<S> ocv_slope(const model::TablePoint<S>& at) {
  return arithmetic::VoltagePerSoc<S>(at.ocv_delta_v * at.per_width);
}

/// Over R0 and R1 in a current that lasts.
template <class S>
constexpr arithmetic::Voltage<S> steady_state_drop_v(const model::TablePoint<S>& at,
                                                     const arithmetic::Current<S>& current_a) {
  return arithmetic::Voltage<S>(arithmetic::Voltage<S>(at.r0_ohm * current_a) +
                                arithmetic::Voltage<S>(at.r1_ohm * current_a));
}

/// Variance of that, when the resistances are good to resistance_error of themselves.
template <class S, class Error>
constexpr arithmetic::Variance<S> drop_variance_v2(const model::TablePoint<S>& at,
                                                   const arithmetic::Current<S>& current_a,
                                                   const Error& resistance_error) {
  const arithmetic::Voltage<S> sigma_v =
      arithmetic::product<arithmetic::Voltage<S>>(steady_state_drop_v<S>(at, current_a), resistance_error);
  return sigma_v * sigma_v;
}

}  // namespace bms::estimator
