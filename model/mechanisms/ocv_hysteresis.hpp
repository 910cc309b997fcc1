// Hysteresis of the open-circuit voltage, one state (Plett, J. Power Sources 134 (2004) 252, Part 2, with its decay in charge moved):
//
//   dh/dt = gamma |I| / (3600 C_n) (sgn I - h)        V += M (h - h_0)
//
// The state carried is M h. h_0 is where the cell file's OCV lies between the branches: -1 the discharge branch, 0 the middle,
// 1 the charge branch. h is not changed by rest, however long.
#pragma once

#include "model/exponential.hpp"
#include "model/mechanism.hpp"

namespace bms::model {

struct OcvHysteresis {
  static constexpr std::string_view id = "ocv_hysteresis";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"half_gap_v", "V", Role::strength, 0, 0, 0.07, Per::cell, "half of charge less discharge branch, M; 3 to 40 mV is usual for LFP", 0.04},
      Parameter{"decay", "1", Role::shape, 40, 8, 400, Per::cell, "gamma: 1 / decay of the capacity moved leads from one branch to 63 % of the way to the other"},
      Parameter{"ocv_at", "1", Role::place, 0, -1, 1, Per::cell, "h_0: where the OCV of the cell file lies, -1 discharge .. 1 charge branch"},
      Parameter{"initial", "1", Role::place, 0, -1, 1, Per::cell, "h at the start of a recording"},
  };

  template <class S>
  struct Law {
    static constexpr std::size_t states = 1;
    static constexpr bool voltage_states = true;
    Voltage<S> half_gap_v, ocv_at_v, initial_v;
    Coupling<S> per_mas;  ///< gamma / (3600 C_n), per 1000 A s

    template <class Real>
    constexpr Law(const std::array<Real, 4>& p, double capacity_ah)
        : half_gap_v(Voltage<S>(p[0])), ocv_at_v(Voltage<S>(p[0] * p[2])), initial_v(Voltage<S>(p[0] * p[3])), per_mas(Coupling<S>(p[1] / Real(3.6 * capacity_ah))) {}

    constexpr Voltage<S> initial(std::size_t) const { return initial_v; }
    constexpr Relaxation<S> settle(std::size_t, const TablePoint<S>&, const Drive<S>& drive) const {
      const bool charging = drive.current_a > Current<S>(0);
      const Current<S> size_a = charging ? drive.current_a : Current<S>(-drive.current_a);
      const Current<S> milli = size_a * Fraction<S>(0.001);
      const Exponent<S> moved = drive.duration_s * Rate<S>(milli * per_mas);
      return {settled<S>(moved), charging ? half_gap_v : Voltage<S>(-half_gap_v)};
    }
    constexpr Voltage<S> error_at_first() const { return half_gap_v; }  // h may be anything
    constexpr Voltage<S> lasting_error() const { return Voltage<S>(half_gap_v * Fraction<S>(0.25)); }  // one state is not the whole of it: minor loops
    constexpr void tables(TablePoint<S>& at, const Soc<S>&, const Drive<S>&) const { at.ocv_v = at.ocv_v - ocv_at_v; }
  };
};

}  // namespace bms::model
