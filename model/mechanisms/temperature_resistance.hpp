// Resistances that depend on the temperature by Arrhenius, except for the share of contacts and foils in R0:
//
//   R0(T) = R0 (1 - s + s a_0)    R1(T) = R1 a_1    a_k = exp(E_k / R_gas (1 / T - 1 / T_ref))
//
// T_ref is the temperature at which the cell file's resistances are valid. C1 is constant, so the time constant follows
// R1. Fast and slow polarisation follow a_1, their time constants are constant.
//
// At one temperature E_0 and s have the same effect: prior knowledge of E_0 decides, and the standard deviations show
// it.
#pragma once

#include "arithmetic/exponential.hpp"
#include "model/mechanism.hpp"

namespace bms::model {

struct TemperatureResistance {
  static constexpr std::string_view id = "temperature_resistance";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"r0_activation_j_per_mol", "J/mol", Role::strength, 0, 0, 60000, Per::cell,
                "E_0: of the reactions in R0, 40 to 60 kJ/mol; 5 to 30 kJ/mol if s is 1", 0, 50000, 10000},
      Parameter{"r1_activation_j_per_mol", "J/mol", Role::strength, 0, 0, 90000, Per::cell,
                "E_1; 30 to 70 kJ/mol is usual", 70000},
      reference_temperature("temperature of the cell file's resistances"),
      Parameter{"r0_share", "1", Role::place, 1, 0.02, 1, Per::cell, "s: share of R0 that depends on the temperature"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::tables | law_member::resistances_follow_temperature;
    static constexpr bool resistances_follow_temperature = true;
    Factor<S> r0_energy, r1_energy;  ///< over R T_ref
    Temperature<S> reference_c;
    Fraction<S> share;

    template <class Real>
    constexpr Law(const std::array<Real, 4>& p, double)
        : r0_energy(Factor<S>(mechanism_detail::energy_over_rt(p[0], p[2]))),
          r1_energy(Factor<S>(mechanism_detail::energy_over_rt(p[1], p[2]))),
          reference_c(Temperature<S>(p[2])),
          share(Fraction<S>(p[3])) {}

    constexpr void tables(TablePoint<S>& at, const Soc<S>&, const StepInput<S>& input) const {
      const Factor<S> more = mechanism_detail::arrhenius<S>(r0_energy, reference_c, input.temperature_c);
      const Factor<S> slower = mechanism_detail::arrhenius<S>(r1_energy, reference_c, input.temperature_c);
      mechanism_detail::scale<S>(at.r0_ohm, at.r0_delta_ohm,
                                 Factor<S>(Factor<S>(1) + share * Factor<S>(more - Factor<S>(1))));
      mechanism_detail::scale<S>(at.r1_ohm, at.r1_delta_ohm, slower);
      at.activation = Factor<S>(at.activation * slower);
    }
  };
};

}  // namespace bms::model
