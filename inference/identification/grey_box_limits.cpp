#include "identification/grey_box_limits.hpp"

#include <algorithm>

namespace bms::identification {

namespace {

Limits limits_of(Quantity quantity, const CircuitBounds& b) {
  switch (quantity) {
    case Quantity::r0:
      return {b.r0_min_ohm, b.r0_max_ohm, 0.01};
    case Quantity::r1:
      return {b.r1_min_ohm, b.r1_max_ohm, 0.01};
    case Quantity::c1:
      return {b.c1_min_f, b.c1_max_f, 1'000};
    case Quantity::ocv_branch:
      return {-1, 1, 0.1};
    case Quantity::initial_soc:
      return {-0.05, 1.05, 0.1};
    case Quantity::initial_v_rc:
      return {-0.5, 0.5, 0.01};  // V
  }
  return {};
}

/// Branch positions at which the OCV rises everywhere, and no steeper than a cell file may state: slow charge and
/// discharge need not be parallel near empty.
Limits branch_limits(const model::OcvTable<double>& ocv) {
  constexpr double least_slope_v = 1e-3, most_slope_v = 59;  // per unit of soc
  Limits limits = limits_of(Quantity::ocv_branch, {});
  for (std::size_t k = 0; k + 1 < ocv.half_gap_v.size; ++k) {
    const double gap_slope_v = (ocv.half_gap_v[k + 1] - ocv.half_gap_v[k]) / (ocv.soc[k + 1] - ocv.soc[k]);
    if (gap_slope_v == 0) continue;
    const double to_least = ocv.lean - std::max(0.0, ocv.b1_v[k] - least_slope_v) / gap_slope_v,
                 to_most = ocv.lean + std::max(0.0, most_slope_v - ocv.b1_v[k]) / gap_slope_v;
    limits.lower = std::max(limits.lower, std::min(to_least, to_most));
    limits.upper = std::min(limits.upper, std::max(to_least, to_most));
  }
  return limits;
}

}  // namespace

Limits limits_within(Quantity quantity, const model::CellParameters<>& cell, const CircuitBounds& bounds) {
  return quantity == Quantity::ocv_branch ? branch_limits(cell.ocv) : limits_of(quantity, bounds);
}

}  // namespace bms::identification
