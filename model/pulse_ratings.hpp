// Currents that the maker of a cell allows for 10 s and for 30 s, from rest, in addition to the continuous ones
// (model/cell_parameters.hpp). They protect, and no model uses them, so they are not parameters of the cell.
#pragma once

#include "model/cell_parameters.hpp"

namespace bms::model {

/// Of one direction [A]. 0: not stated.
struct PulseRating {
  double for_10s_a = 0, for_30s_a = 0;

  constexpr bool stated() const { return for_10s_a != 0 || for_30s_a != 0; }
  /// The largest one.
  constexpr double most_a() const { return for_10s_a > for_30s_a ? for_10s_a : for_30s_a; }
};

struct PulseRatings {
  PulseRating charge, discharge;

  constexpr bool stated() const { return charge.stated() || discharge.stated(); }
};

namespace accepted {

/// Over the continuous current. Five times of it count as a short circuit.
inline constexpr Range pulse_ratio{1.2, 4.5};
inline constexpr double pulse_step = 1.15;  ///< least ratio of the rating for 10 s to that for 30 s

}  // namespace accepted

/// Keys of the table [pulses]. Visitor: as in model/cell_fields.hpp.
template <class Visitor, class Ratings>
void visit_pulses(Visitor& visitor, Ratings& p) {
  if (!visitor.optional_table("pulses", p.stated())) return;
  visitor.optional_number("charge_10s_a", p.charge.for_10s_a);
  visitor.optional_number("charge_30s_a", p.charge.for_30s_a);
  visitor.optional_number("discharge_10s_a", p.discharge.for_10s_a);
  visitor.optional_number("discharge_30s_a", p.discharge.for_30s_a);
}

/// The first rating that is refused, by the continuous currents of the same cell.
constexpr CellFault first_fault(const PulseRatings& p, const Limits& limits) {
  constexpr const char* ratio = "1.2 to 4.5 times the continuous current, and at most 2000 A";
  constexpr const char* step = "at least 1.15 times the rating for 30 s";
  const auto beyond = [](double a, double continuous_a) {
    return a != 0 && (parameters_detail::outside(a, accepted::pulse_ratio.low * continuous_a,
                                                 accepted::pulse_ratio.high * continuous_a) ||
                      a > accepted::current_a.high);
  };
  const auto short_step = [](const PulseRating& r) {
    return r.for_10s_a != 0 && r.for_30s_a != 0 && !(r.for_10s_a >= accepted::pulse_step * r.for_30s_a);
  };
  if (beyond(p.charge.for_30s_a, limits.charge_current_max_a)) return {"pulses.charge_30s_a", 0, ratio};
  if (beyond(p.charge.for_10s_a, limits.charge_current_max_a)) return {"pulses.charge_10s_a", 0, ratio};
  if (short_step(p.charge)) return {"pulses.charge_10s_a", 0, step};
  if (beyond(p.discharge.for_30s_a, limits.discharge_current_max_a)) return {"pulses.discharge_30s_a", 0, ratio};
  if (beyond(p.discharge.for_10s_a, limits.discharge_current_max_a)) return {"pulses.discharge_10s_a", 0, ratio};
  if (short_step(p.discharge)) return {"pulses.discharge_10s_a", 0, step};
  return {};
}

}  // namespace bms::model
