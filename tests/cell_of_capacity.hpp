// A cell of the same kind with another capacity: as many in parallel.
#pragma once

#include <cstddef>

#include "model/cell_parameters.hpp"

namespace bms::tests {

/// p with capacity_ah > 0 [Ah]: currents and capacitances grow as the capacity does, resistances fall.
constexpr model::CellParameters<> of_capacity(model::CellParameters<> p, double capacity_ah) {
  const double in_parallel = capacity_ah / p.capacity_ah;
  p.capacity_ah = capacity_ah;
  for (std::size_t k = 0; k < p.rc.soc.size; ++k) {
    p.rc.r0_ohm[k] /= in_parallel;
    p.rc.r1_ohm[k] /= in_parallel;
    p.rc.c1_f[k] *= in_parallel;
  }
  for (double* a : {&p.limits.charge_current_max_a, &p.limits.discharge_current_max_a, &p.noise.current_a,
                    &p.noise.current_offset_a, &p.noise.current_at_rest_a, &p.noise.current_unknown_a})
    *a *= in_parallel;
  return p;
}

}  // namespace bms::tests
