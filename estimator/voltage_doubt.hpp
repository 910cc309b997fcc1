// What stands between a voltage and a state of charge: the slope of the OCV, what falls off over the resistances, and by how much that is
// doubted.
#pragma once

#include "model/cell.hpp"

namespace bms {

/// Of the OCV, at one point of the tables.
template <class S>
constexpr model::VoltagePerSoc<S> ocv_slope(const model::TablePoint<S>& at) {
  return model::VoltagePerSoc<S>(at.ocv_delta_v * at.per_width);
}

/// Over R0 and R1 in a current that lasts.
template <class S>
constexpr model::Voltage<S> settled_drop_v(const model::TablePoint<S>& at, const model::Current<S>& current_a) {
  return model::Voltage<S>(model::Voltage<S>(at.r0_ohm * current_a) + model::Voltage<S>(at.r1_ohm * current_a));
}

/// Variance of that, when the resistances are good to resistance_error of themselves.
template <class S, class Error>
constexpr model::Variance<S> drop_doubt_v2(const model::TablePoint<S>& at, const model::Current<S>& current_a, const Error& resistance_error) {
  const model::Voltage<S> doubt_v = model::product<model::Voltage<S>>(settled_drop_v<S>(at, current_a), resistance_error);
  return doubt_v * doubt_v;
}

}  // namespace bms
