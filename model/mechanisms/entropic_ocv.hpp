// The open-circuit voltage depends on the temperature (reaction entropy):
//
//   V += dU/dT(soc) (T - T_ref),  dU/dT linear in SOC between 10, 40, 70 and 95 %, constant outside
#pragma once

#include "arithmetic/exponential.hpp"
#include "model/mechanism.hpp"

namespace bms::model {

struct EntropicOcv {
  static constexpr std::string_view id = "entropic_ocv";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"at_10_v_per_k", "V/K", Role::strength, 0, -0.001, 0.001, Per::cell,
                "dU/dT at 10 % SOC; -0.6 to 0.4 mV/K is usual for LFP and graphite", 0.0005},
      Parameter{"at_40_v_per_k", "V/K", Role::strength, 0, -0.001, 0.001, Per::cell, "the same at 40 %", 0.0005},
      Parameter{"at_70_v_per_k", "V/K", Role::strength, 0, -0.001, 0.001, Per::cell, "the same at 70 %", 0.0005},
      Parameter{"at_95_v_per_k", "V/K", Role::strength, 0, -0.001, 0.001, Per::cell, "the same at 95 %", 0.0005},
      reference_temperature("temperature of the cell file's OCV"),
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::tables;
    std::array<Voltage<S>, 4> v_per_k;
    std::array<Voltage<S>, 3> delta_v_per_k;
    std::array<Soc<S>, 4> node = {Soc<S>(0.10), Soc<S>(0.40), Soc<S>(0.70), Soc<S>(0.95)};
    std::array<Coupling<S>, 3> per_width = {Coupling<S>(1 / 0.30), Coupling<S>(1 / 0.30), Coupling<S>(1 / 0.25)};
    Temperature<S> reference_c;

    template <class Real>
    constexpr Law(const std::array<Real, 5>& p, double)
        : v_per_k{Voltage<S>(p[0]), Voltage<S>(p[1]), Voltage<S>(p[2]), Voltage<S>(p[3])},
          delta_v_per_k{Voltage<S>(p[1] - p[0]), Voltage<S>(p[2] - p[1]), Voltage<S>(p[3] - p[2])},
          reference_c(Temperature<S>(p[4])) {}

    constexpr void tables(TablePoint<S>& at, const Soc<S>& soc, const StepInput<S>& input) const {
      const Temperature<S> warmer_k = input.temperature_c - reference_c;
      Voltage<S> here = v_per_k[3];
      if (soc < node[0]) {
        here = v_per_k[0];
      } else {
        for (std::size_t k = 0; k < 3; ++k) {
          if (!(soc < node[k + 1])) continue;
          const Fraction<S> t = Soc<S>(soc - node[k]) * per_width[k];
          here = v_per_k[k] + t * delta_v_per_k[k];
          if constexpr (!Dual<S>) {  // per interval of the tables; a dual number contains it already
            const VoltagePerSoc<S> slope_v = Voltage<S>(delta_v_per_k[k] * per_width[k]) * warmer_k;
            at.ocv_delta_v = at.ocv_delta_v + ratio<Voltage<S>>(slope_v, at.per_width);
          }
          break;
        }
      }
      at.ocv_v = at.ocv_v + here * warmer_k;
    }
  };
};

}  // namespace bms::model
