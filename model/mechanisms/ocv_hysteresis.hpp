// Hysteresis of the open-circuit voltage, with one state h:
//
//   V += M (h - h_0)      -1 <= h <= 1
//
// h_0 is the branch position of the cell file's OCV: -1 the discharge branch, 0 the middle, 1 the charge branch. Rest
// does not change h. `measured` selects how h moves, and M:
//
//   0   dh/dt = gamma |I| / (3600 C_n) (sgn I - h), M constant (Plett, J. Power Sources 134 (2004) 252, Part 2, with
//       its decay in moved charge). The diagnosis fits both forms
//   1   dh/dt = gamma I / (3600 C_n), limited to -1 .. 1, and M follows half_gap_v over SOC, if it is known: at h = -1
//       and 1 the OCV is the curve that was measured in discharge and in charge. In a drive with regenerative braking a
//       cell stays near its discharge branch, with the knees of that branch. The first form, whose mean h is (charge -
//       discharge) / (charge + discharge), puts it halfway
//
// The state is M h, with M of the middle of the curve.
#pragma once

#include "arithmetic/exponential.hpp"
#include "model/mechanism.hpp"

namespace bms::model {

struct OcvHysteresis {
  static constexpr std::string_view id = "ocv_hysteresis";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"half_gap_v", "V", Role::strength, 0, 0, 0.07, Per::cell,
                "M: half of charge minus discharge branch; 3 to 40 mV is usual for LFP", 0.04},
      Parameter{"decay", "1", Role::shape, 40, 8, 400, Per::cell,
                "gamma: a charge of 1 / decay of the capacity covers 63 % of the way from one branch to the other; "
                "measured: half of the way"},
      Parameter{"ocv_at", "1", Role::place, 0, -1, 1, Per::cell,
                "h_0: branch position of the cell file's OCV, -1 discharge .. 1 charge branch"},
      Parameter{"initial", "1", Role::place, 0, -1, 1, Per::cell, "h at the start of a recording"},
      Parameter{"measured", "1", Role::given, 0, 0, 1, Per::cell,
                "1: between the charge and discharge curves of the cell file; 0: exponentially, with a constant gap"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::apply_state | law_member::states | law_member::voltage_states |
                                          law_member::initial | law_member::relaxation | law_member::initial_sigma_v |
                                          law_member::steady_state_sigma_v | law_member::voltage_per_state;
    static constexpr std::size_t states = 1;
    static constexpr bool voltage_states = true;
    Voltage<S> half_gap_v, ocv_at_v, initial_v;
    Coupling<S> per_mas;  ///< gamma / (3600 C_n), per 1000 A s
    bool measured;

    template <class Real>
    constexpr Law(const std::array<Real, 5>& p, double capacity_ah)
        : half_gap_v(Voltage<S>(p[0])),
          ocv_at_v(Voltage<S>(p[0] * p[2])),
          initial_v(Voltage<S>(p[0] * p[3])),
          per_mas(Coupling<S>(p[1] / Real(3.6 * capacity_ah))),
          measured(p[4] > Real(0.5)) {}

    constexpr Voltage<S> initial(std::size_t) const { return initial_v; }
    constexpr Relaxation<S> relaxation(std::size_t, const TablePoint<S>&, const StepInput<S>& input,
                                       const Voltage<S>* x) const {
      const bool charging = input.current_a > Current<S>(0);
      const Current<S> size_a = charging ? input.current_a : Current<S>(-input.current_a);
      const Current<S> milli = size_a * Fraction<S>(0.001);
      const Exponent<S> moved = input.duration_s * Rate<S>(milli * per_mas);
      const Voltage<S> target = charging ? half_gap_v : Voltage<S>(-half_gap_v);
      const Fraction<S> exponentially = step_response<S>(moved);
      if (!measured) return {exponentially, target};
      const Voltage<S> left_v = charging ? Voltage<S>(target - x[0]) : Voltage<S>(x[0] - target);
      const bool far = !(moved < Exponent<S>(2));
      const Voltage<S> step_v = half_gap_v * Fraction<S>(far ? Exponent<S>(0) : moved);
      return {!far && left_v > step_v ? ratio<Fraction<S>>(step_v, left_v) : Fraction<S>(1), target, exponentially};
    }
    constexpr Voltage<S> initial_sigma_v() const { return half_gap_v; }  // h is unknown
    constexpr Voltage<S> steady_state_sigma_v() const {
      return Voltage<S>(half_gap_v * Fraction<S>(0.25));
    }  // one state does not describe minor loops
    constexpr Factor<S> voltage_per_state(const TablePoint<S>& at) const { return measured ? at.gap : Factor<S>(1); }
    constexpr void apply_state(TablePoint<S>& at, const Voltage<S>& state_v, const StepInput<S>&) const {
      if (!measured) {
        at.ocv_v = at.ocv_v - ocv_at_v;
        return;
      }
      // the state itself is added with the other voltage states
      at.ocv_v = at.ocv_v + Voltage<S>(state_v * Factor<S>(at.gap - Factor<S>(1))) - Voltage<S>(ocv_at_v * at.gap);
      at.ocv_delta_v = at.ocv_delta_v + Voltage<S>(Voltage<S>(state_v - ocv_at_v) * at.gap_delta);
    }
  };
};

}  // namespace bms::model
