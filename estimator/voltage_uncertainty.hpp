// From a voltage to a state of charge: the slope of the OCV, the voltage drop over the resistances, and the uncertainty
// of both.
#pragma once

#include <concepts>
#include <type_traits>

#include "model/extended_rc.hpp"

namespace bms::estimator {

/// Slope of the OCV at one point of the tables.
template <class S>
constexpr arithmetic::VoltagePerSoc<S> ocv_slope(const model::TablePoint<S>& at) {
  return arithmetic::VoltagePerSoc<S>(at.ocv_delta_v * at.per_width);
}

/// Drop over R0 and R1 under a current that lasts.
template <class S>
constexpr arithmetic::Voltage<S> steady_state_drop_v(const model::TablePoint<S>& at,
                                                     const arithmetic::Current<S>& current_a) {
  return arithmetic::Voltage<S>(arithmetic::Voltage<S>(at.r0_ohm * current_a) +
                                arithmetic::Voltage<S>(at.r1_ohm * current_a));
}

/// Variance of that drop. resistance_error: relative standard deviation of the resistances.
template <class S, class Error>
constexpr arithmetic::Variance<S> drop_variance_v2(const model::TablePoint<S>& at,
                                                   const arithmetic::Current<S>& current_a,
                                                   const Error& resistance_error) {
  const arithmetic::Voltage<S> sigma_v =
      arithmetic::product<arithmetic::Voltage<S>>(steady_state_drop_v<S>(at, current_a), resistance_error);
  return sigma_v * sigma_v;
}

/// Variance of the OCV from the uncertainty of the tables' SOC axis (tolerance.initial_soc). In the cold, the surface
/// of the particles is further ahead of the counted charge, in proportion to the resistances; knees then come
/// elsewhere.
template <class S, class Cell>
constexpr arithmetic::Variance<S> soc_axis_variance(const Cell& cell, const model::TablePoint<S>& at) {
  using Variance = arithmetic::Variance<S>;
  const Variance at_reference = Variance(at.error_v2 - cell.noise.model_v2);
  if constexpr (std::same_as<std::remove_cvref_t<decltype(laws_of(cell))>, model::LawSet<S>>)
    return at_reference;
  else
    return at.activation > arithmetic::Factor<S>(1)
               ? arithmetic::product<Variance>(arithmetic::product<Variance>(at_reference, at.activation),
                                               at.activation)
               : at_reference;
}

}  // namespace bms::estimator
