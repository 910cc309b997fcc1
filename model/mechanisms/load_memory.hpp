// A voltage that a load builds up slowly and that charging and discharging build up differently:
//
//   du/dt = (R I - u) / tau,  R = R_charge while I > 0, else R_discharge        V += u
//
// The term of an unknown cause in the slow polarisation (inference/diagnosis/law_term.hpp), not a cause that is
// searched. Two resistances of opposite sign follow the size of the load whatever its direction; one alone follows
// charging or discharging alone. Resistances of both signs are allowed: what is unknown may act against the current.
// They are the same at all temperatures.
#pragma once

#include "arithmetic/exponential.hpp"
#include "model/mechanism.hpp"

namespace bms::model {

struct LoadMemory {
  static constexpr std::string_view id = "load_memory";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"charge_ohm", "ohm", Role::strength, 0, -0.12, 0.12, Per::siemens,
                "R_charge, after a charge much longer than tau"},
      Parameter{"discharge_ohm", "ohm", Role::strength, 0, -0.12, 0.12, Per::siemens,
                "R_discharge, after a discharge much longer than tau"},
      Parameter{"time_constant_s", "s", Role::shape, 1000, 60, 20000, Per::cell, "tau"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members =
        law_member::states | law_member::voltage_states | law_member::initial | law_member::relaxation;
    static constexpr std::size_t states = 1;
    static constexpr bool voltage_states = true;
    Resistance<S> charge_ohm, discharge_ohm;
    Rate<S> rate_per_s;

    template <class Real>
    constexpr Law(const std::array<Real, 3>& p, double)
        : charge_ohm(Resistance<S>(p[0])), discharge_ohm(Resistance<S>(p[1])), rate_per_s(Rate<S>(Real(1) / p[2])) {}

    constexpr Voltage<S> initial(std::size_t) const { return Voltage<S>(0); }
    constexpr Relaxation<S> relaxation(std::size_t, const TablePoint<S>&, const StepInput<S>& input) const {
      const Resistance<S>& ohm = input.current_a > Current<S>(0) ? charge_ohm : discharge_ohm;
      return {step_response_after<S>(input.duration_s, rate_per_s), Voltage<S>(ohm * input.current_a)};
    }
  };
};

}  // namespace bms::model
