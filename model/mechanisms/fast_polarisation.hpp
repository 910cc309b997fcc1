// A polarisation faster than R1 C1: double layer and charge transfer, visible in the first seconds after a current
// edge.
//
//   du/dt = (R I - u) / tau        V += u
//
// R is the resistance at the temperature of the cell file, if the file has a temperature_resistance.
#pragma once

#include "arithmetic/exponential.hpp"
#include "model/mechanism.hpp"

namespace bms::model {

struct FastPolarisation {
  static constexpr std::string_view id = "fast_polarisation";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"resistance_ohm", "ohm", Role::strength, 0, 0, 0.06, Per::siemens, "R"},
      Parameter{"time_constant_s", "s", Role::shape, 1.5, 0.2, 30, Per::cell, "tau, below a third of R1 C1"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members =
        law_member::states | law_member::voltage_states | law_member::initial | law_member::relaxation;
    static constexpr std::size_t states = 1;
    static constexpr bool voltage_states = true;
    Resistance<S> r_ohm;
    Rate<S> rate_per_s;

    template <class Real>
    constexpr Law(const std::array<Real, 2>& p, double)
        : r_ohm(Resistance<S>(p[0])), rate_per_s(Rate<S>(Real(1) / p[1])) {}

    constexpr Voltage<S> initial(std::size_t) const { return Voltage<S>(0); }
    constexpr Relaxation<S> relaxation(std::size_t, const TablePoint<S>& at, const StepInput<S>& input) const {
      return {step_response_after<S>(input.duration_s, rate_per_s),
              Voltage<S>(Resistance<S>(r_ohm * at.activation) * input.current_a)};
    }
  };
};

}  // namespace bms::model
