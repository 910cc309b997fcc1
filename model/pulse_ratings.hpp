// Currents above the continuous ones that the maker of a cell allows for 10 s and for 30 s, from rest. They protect,
// and no model uses them, so they are not parameters of the cell (model/cell_parameters.hpp).
#pragma once

#include "model/cell_parameters.hpp"

namespace bms::model {

/// Of one direction [A]. 0: not stated.
struct PulseRating {
  double for_10s_a = 0, for_30s_a = 0;

  constexpr bool stated() const { return for_10s_a != 0 || for_30s_a != 0; }
};

struct PulseRatings {
  double temperature_min_c = 0;  ///< of the coldest cell, from which the ratings hold
  PulseRating charge, discharge;

  constexpr bool stated() const { return charge.stated() || discharge.stated(); }
};

/// Keys of the table [pulses]. Visitor: as in model/cell_fields.hpp.
template <class Visitor, class Ratings>
void visit_pulses(Visitor& visitor, Ratings& p) {
  if (!visitor.optional_table("pulses", p.stated())) return;
  visitor.number("temperature_min_c", p.temperature_min_c);
  visitor.optional_number("charge_10s_a", p.charge.for_10s_a);
  visitor.optional_number("charge_30s_a", p.charge.for_30s_a);
  visitor.optional_number("discharge_10s_a", p.discharge.for_10s_a);
  visitor.optional_number("discharge_30s_a", p.discharge.for_30s_a);
}

/// The first rating that is refused, by the limits of the same cell. The bounds are values of the same file, which are
/// compared as they are written: equal ones are accepted, also after all of them are scaled or rounded.
constexpr CellFault first_fault(const PulseRatings& p, const Limits& limits) {
  if (!p.stated()) return {};
  constexpr double most_a = accepted::current_a.high;
  const auto outside = [](double a, double least_a) {
    return a != 0 && parameters_detail::outside(a, least_a, most_a);
  };
  if (outside(p.charge.for_30s_a, limits.charge_current_max_a))
    return {"pulses.charge_30s_a", 0, "charge_current_max_a to 2000 A"};
  if (outside(p.charge.for_10s_a, limits.charge_current_max_a))
    return {"pulses.charge_10s_a", 0, "charge_current_max_a to 2000 A"};
  if (outside(p.charge.for_10s_a, p.charge.for_30s_a)) return {"pulses.charge_10s_a", 0, "the rating for 30 s or more"};
  if (outside(p.discharge.for_30s_a, limits.discharge_current_max_a))
    return {"pulses.discharge_30s_a", 0, "discharge_current_max_a to 2000 A"};
  if (outside(p.discharge.for_10s_a, limits.discharge_current_max_a))
    return {"pulses.discharge_10s_a", 0, "discharge_current_max_a to 2000 A"};
  if (outside(p.discharge.for_10s_a, p.discharge.for_30s_a))
    return {"pulses.discharge_10s_a", 0, "the rating for 30 s or more"};
  if (parameters_detail::outside(p.temperature_min_c, limits.temperature_min_c, limits.temperature_max_c))
    return {"pulses.temperature_min_c", 0, "a temperature within the limits"};
  return {};
}

}  // namespace bms::model
