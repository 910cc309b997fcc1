// Charge and discharge branch of the open-circuit voltage move apart in the cold. With the state h of ocv_hysteresis:
//
//   V += (h M g(soc) - s(soc)) (exp(E(soc) / R (1 / T - 1 / T_ref)) - 1)
//
// g, s and E are linear in SOC between 10, 25, 50 and 85 %, constant outside. M is half_gap_v of ocv_hysteresis. The
// discharge branch moves by -(M g + s), the charge branch by M g - s: near empty mostly the discharge branch moves,
// near full mostly the charge branch.
//
// Slow runs (C/30) of lithium iron phosphate cells at -15 to 45 degrees C: M g is 4 to 10 mV and E about 25 to 40
// kJ/mol on the plateau, up to 80 kJ/mol below 15 %. It is not an overvoltage that follows the current: rests within
// drives lie on the branches of their own temperature.
//
// The exponent stops at 4.5: what is colder is as at that temperature.
#pragma once

#include "arithmetic/exponential.hpp"
#include "model/mechanism.hpp"
#include "model/soc_nodes.hpp"

namespace bms::model {

struct BranchTemperature {
  static constexpr std::string_view id = "branch_temperature";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array<double, 4> nodes = {0.10, 0.25, 0.50, 0.85};
  static constexpr double least_energy = 5'000, most_energy = 100'000;
  static constexpr std::array parameters = {
      Parameter{"gap_at_10", "1", Role::strength, 0, 0, 4, Per::cell, "g at 10 % SOC, relative to the half gap M"},
      Parameter{"gap_at_25", "1", Role::strength, 0, 0, 4, Per::cell, "the same at 25 %"},
      Parameter{"gap_at_50", "1", Role::strength, 0, 0, 4, Per::cell, "the same at 50 %; 0.2 to 0.5 is usual", 0.5},
      Parameter{"gap_at_85", "1", Role::strength, 0, 0, 4, Per::cell, "the same at 85 %"},
      Parameter{"shift_at_10_v", "V", Role::strength, 0, -0.05, 0.05, Per::cell, "s at 10 % SOC"},
      Parameter{"shift_at_25_v", "V", Role::strength, 0, -0.05, 0.05, Per::cell, "the same at 25 %"},
      Parameter{"shift_at_50_v", "V", Role::strength, 0, -0.05, 0.05, Per::cell, "the same at 50 %"},
      Parameter{"shift_at_85_v", "V", Role::strength, 0, -0.05, 0.05, Per::cell, "the same at 85 %"},
      Parameter{"energy_at_10_j_per_mol", "J/mol", Role::given, 30'000, least_energy, most_energy, Per::cell,
                "E at 10 % SOC"},
      Parameter{"energy_at_25_j_per_mol", "J/mol", Role::given, 30'000, least_energy, most_energy, Per::cell,
                "the same at 25 %"},
      Parameter{"energy_at_50_j_per_mol", "J/mol", Role::given, 30'000, least_energy, most_energy, Per::cell,
                "the same at 50 %"},
      Parameter{"energy_at_85_j_per_mol", "J/mol", Role::given, 30'000, least_energy, most_energy, Per::cell,
                "the same at 85 %"},
      reference_temperature("temperature of the cell file's OCV"),
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::tables;
    SocNodes<S, Factor<S>, 4> gap, energy;  ///< energy: over R T_ref
    SocNodes<S, Voltage<S>, 4> shift_v;
    Temperature<S> reference_c;

    template <class Real>
    constexpr Law(const std::array<Real, 13>& p, double)
        : gap(nodes, std::array<Real, 4>{p[0], p[1], p[2], p[3]}),
          energy(nodes, std::array<Real, 4>{over_rt(p[8], p[12]), over_rt(p[9], p[12]), over_rt(p[10], p[12]),
                                            over_rt(p[11], p[12])}),
          shift_v(nodes, std::array<Real, 4>{p[4], p[5], p[6], p[7]}),
          reference_c(Temperature<S>(p[12])) {}

    constexpr void tables(TablePoint<S>& at, const Soc<S>& soc, const StepInput<S>& input) const {
      const auto g = gap.at(soc), e = energy.at(soc);
      const auto s = shift_v.at(soc);
      const Factor<S> factor = mechanism_detail::arrhenius<S>(e.value, reference_c, input.temperature_c);
      const Factor<S> more = Factor<S>(factor - Factor<S>(1));
      at.gap = Factor<S>(at.gap + g.value * more);
      at.ocv_v = Voltage<S>(at.ocv_v - s.value * more);
      if constexpr (!Dual<S>) {  // a dual number contains the slopes already
        const Coupling<S> factor_slope =
            Coupling<S>(Coupling<S>(factor * e.slope) * mechanism_detail::colder<S>(reference_c, input.temperature_c));
        const Coupling<S> gap_slope = Coupling<S>(Coupling<S>(more * g.slope) + Coupling<S>(factor_slope * g.value));
        const Coupling<S> shift_slope = Coupling<S>(Coupling<S>(more * s.slope) + Coupling<S>(factor_slope * s.value));
        at.gap_delta = Factor<S>(at.gap_delta + ratio<Factor<S>>(gap_slope, at.per_width));
        at.ocv_delta_v = Voltage<S>(at.ocv_delta_v - ratio<Voltage<S>>(shift_slope, at.per_width));
      }
    }

   private:
    template <class Real>
    static constexpr Real over_rt(const Real& energy_j_per_mol, const Real& c) {
      return mechanism_detail::energy_over_rt(energy_j_per_mol, c);
    }
  };
};

}  // namespace bms::model
