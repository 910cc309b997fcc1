// The current heats the inside of the cell above its surface, and the resistances follow (Arrhenius):
//
//   dw/dt = (R_th I^2 (R0 + R1) - w) / tau        R = R exp(E / R_gas (1 / (T_ref + w) - 1 / T_ref))
//
// The rise w counts from the reference temperature, whatever the measured one: the error is a part of E, which is only
// known to some extent. The state is w in units of 100 K. The dependence on the measured temperature belongs to
// temperature_resistance.
#pragma once

#include "arithmetic/exponential.hpp"
#include "model/mechanism.hpp"

namespace bms::model {

struct SelfHeating {
  static constexpr std::string_view id = "self_heating";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"thermal_resistance_k_per_w", "K/W", Role::strength, 0, 0, 300, Per::siemens,
                "R_th from the inside to the temperature sensor", 20},
      Parameter{"time_constant_s", "s", Role::shape, 900, 60, 6000, Per::cell, "tau"},
      Parameter{"activation_j_per_mol", "J/mol", Role::given, 25000, 5000, 80000, Per::cell,
                "E of R0 and R1; only its product with R_th is observable"},
      reference_temperature("T_ref, from which the temperature rises"),
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::apply_state | law_member::states | law_member::voltage_states |
                                          law_member::state_unit | law_member::initial | law_member::relaxation;
    static constexpr std::size_t states = 1;
    static constexpr bool voltage_states = false;
    static constexpr StateUnit state_unit{"k", 100};
    Factor<S> energy;  ///< E / (R_gas T_ref)
    Temperature<S> reference_c;
    Coupling<S> per_w;  ///< 100 K per W
    Rate<S> rate_per_s;

    template <class Real>
    constexpr Law(const std::array<Real, 4>& p, double)
        : energy(Factor<S>(mechanism_detail::energy_over_rt(p[2], p[3]))),
          reference_c(Temperature<S>(p[3])),
          per_w(Coupling<S>(p[0] / Real(100))),
          rate_per_s(Rate<S>(Real(1) / p[1])) {}

    constexpr Voltage<S> initial(std::size_t) const { return Voltage<S>(0); }
    constexpr Relaxation<S> relaxation(std::size_t, const TablePoint<S>& at, const StepInput<S>& input) const {
      const Voltage<S> drop_v = Resistance<S>(at.r0_ohm + at.r1_ohm) * input.current_a;
      const Coupling<S> heat_w = drop_v * input.current_a;
      return {step_response_after<S>(input.duration_s, rate_per_s), Voltage<S>(heat_w * per_w)};
    }
    constexpr void apply_state(TablePoint<S>& at, const Voltage<S>& hundred_k, const StepInput<S>&) const {
      const Temperature<S> inside_c = reference_c + Temperature<S>(Coupling<S>(hundred_k) * Coupling<S>(100));
      const Factor<S> less = mechanism_detail::arrhenius<S>(energy, reference_c, inside_c);
      mechanism_detail::scale<S>(at.r0_ohm, at.r0_delta_ohm, less);
      mechanism_detail::scale<S>(at.r1_ohm, at.r1_delta_ohm, less);
      at.activation = Factor<S>(at.activation * less);
    }
  };
};

}  // namespace bms::model
