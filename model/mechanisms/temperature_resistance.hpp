// Resistances that depend on the temperature by Arrhenius, except for the share of contacts and foils in R0:
//
//   R0(T) = R0 (1 - s + s a_0)    R1(T) = R1 a_1    a_k = exp(E_k / R_gas (1 / T - 1 / T_ref))
//
// T_ref is the temperature at which the cell file's resistances are valid. C1 is constant, so the time constant follows
// R1. Fast and slow polarisation follow an energy of their own; their time constants are constant.
//
// Towards empty the resistances of a cold cell rise steeply: except for R0, the energies are E (1 + D(soc)), D is 0 at
// 50 % and linear between 10, 25, 50 and 80 %, constant outside.
//
// At one temperature E_0 and s have the same effect: prior knowledge of E_0 decides, and the standard deviations show
// it.
#pragma once

#include "arithmetic/exponential.hpp"
#include "model/mechanism.hpp"
#include "model/soc_nodes.hpp"

namespace bms::model {

struct TemperatureResistance {
  static constexpr std::string_view id = "temperature_resistance";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"r0_activation_j_per_mol", "J/mol", Role::strength, 0, 0, 60000, Per::cell,
                "E_0: of the reactions in R0, 40 to 60 kJ/mol; 5 to 30 kJ/mol if s is 1", 0, 50000, 10000},
      Parameter{"r1_activation_j_per_mol", "J/mol", Role::strength, 0, 0, 90000, Per::cell,
                "E_1; 30 to 60 kJ/mol: diffusion 20 to 40, reactions 40 to 60", 0, 45000, 15000},
      reference_temperature("temperature of the cell file's resistances"),
      Parameter{"r0_share", "1", Role::place, 1, 0.02, 1, Per::cell, "s: share of R0 that depends on the temperature"},
      Parameter{"more_at_10", "1", Role::given, 0, -1, 4, Per::cell, "D at 10 % SOC"},
      Parameter{"more_at_25", "1", Role::given, 0, -1, 4, Per::cell, "the same at 25 %"},
      Parameter{"more_at_80", "1", Role::given, 0, -1, 4, Per::cell, "the same at 80 %"},
      Parameter{"slow_ratio", "1", Role::given, 1, 0, 10, Per::cell, "energy of fast and slow polarisation over E_1"},
  };

  /// No energy, and no difference of two that are next to each other, is beyond the range of Factor.
  static constexpr bool fits_fixed_point(const std::array<double, max_mechanism_parameters>& p, double) {
    constexpr auto most = static_cast<double>(Factor<FixedPoint>::highest());
    bool fits = true;
    for (const double slow_ratio : {1.0, p[7]}) {
      const std::array<double, 4> at = energies(p, p[1] * slow_ratio);
      for (std::size_t k = 0; k < at.size(); ++k)
        fits = fits && at[k] < most && (k == 0 || magnitude(at[k] - at[k - 1]) < most);
    }
    return fits;
  }

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::tables | law_member::resistances_follow_temperature;
    static constexpr bool resistances_follow_temperature = true;
    Factor<S> r0_energy;  ///< over R T_ref
    SocNodes<S, Factor<S>, 4> r1_energy, slow_energy;
    Temperature<S> reference_c;
    Fraction<S> share;
    bool slow_differs;

    template <class Real>
    constexpr Law(const std::array<Real, 8>& p, double)
        : r0_energy(Factor<S>(mechanism_detail::energy_over_rt(p[0], p[2]))),
          r1_energy(nodes, energies(p, p[1])),
          slow_energy(nodes, energies(p, Real(p[1] * p[7]))),
          reference_c(Temperature<S>(p[2])),
          share(Fraction<S>(p[3])),
          slow_differs(p[7] != Real(1)) {}

    constexpr void tables(TablePoint<S>& at, const Soc<S>& soc, const StepInput<S>& input) const {
      const Factor<S> more = mechanism_detail::arrhenius<S>(r0_energy, reference_c, input.temperature_c);
      mechanism_detail::scale<S>(at.r0_ohm, at.r0_delta_ohm,
                                 Factor<S>(Factor<S>(1) + share * Factor<S>(more - Factor<S>(1))));
      const auto energy = r1_energy.at(soc);
      const Factor<S> slower = mechanism_detail::arrhenius<S>(energy.value, reference_c, input.temperature_c);
      mechanism_detail::scale<S>(at.r1_ohm, at.r1_delta_ohm, slower);
      if constexpr (!Dual<S>) {  // a dual number contains the slope already
        const Coupling<S> slope_ohm = Coupling<S>(Coupling<S>(at.r1_ohm * energy.slope) *
                                                  mechanism_detail::colder<S>(reference_c, input.temperature_c));
        at.r1_delta_ohm = Resistance<S>(at.r1_delta_ohm + ratio<Resistance<S>>(slope_ohm, at.per_width));
      }
      const Factor<S> slow =
          slow_differs ? mechanism_detail::arrhenius<S>(slow_energy.at(soc).value, reference_c, input.temperature_c)
                       : slower;
      at.activation = Factor<S>(at.activation * slow);
    }

   private:
    static constexpr std::array<double, 4> nodes = {0.10, 0.25, 0.50, 0.80};
  };

 private:
  /// Energies at the nodes, over R T_ref.
  template <class Parameters, class Real>
  static constexpr std::array<Real, 4> energies(const Parameters& p, const Real& energy_j_per_mol) {
    const Real e = mechanism_detail::energy_over_rt(energy_j_per_mol, p[2]);
    return {Real(e * (Real(1) + p[4])), Real(e * (Real(1) + p[5])), e, Real(e * (Real(1) + p[6]))};
  }
};

}  // namespace bms::model
