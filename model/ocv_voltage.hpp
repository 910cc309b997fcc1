// The open-circuit voltage that a cell file's table states.
#pragma once

#include <cstddef>

#include "model/cell.hpp"

namespace bms::model {

/// [V] at a state of charge. An edge belongs to the piece above it; outside 0 .. 1 the outermost pieces continue.
template <class Real>
constexpr Real ocv_voltage(const OcvTable<Real>& ocv, double soc) {
  const std::size_t k = cell_detail::ocv_piece(ocv, soc);
  return ocv.b0_v[k] + ocv.b1_v[k] * soc;
}

}  // namespace bms::model
