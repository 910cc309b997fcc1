// Dual numbers without their derivatives.
#pragma once

#include "model/one_rc.hpp"

namespace bms::diagnosis {

/// The value of a double or of a dual number.
template <class S>
double number(const S& x) {
  if constexpr (model::Dual<S>)
    return x.a;
  else
    return x;
}

}  // namespace bms::diagnosis
