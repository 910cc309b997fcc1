// The open-circuit voltage depends on the temperature (reaction entropy):
//
//   V += dU/dT(soc) (T - T_ref),  dU/dT linear in SOC between 10, 40, 70 and 95 %, constant outside
#pragma once

#include "arithmetic/exponential.hpp"
#include "model/mechanism.hpp"
#include "model/soc_nodes.hpp"

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
    SocNodes<S, Voltage<S>, 4> v_per_k;
    Temperature<S> reference_c;

    template <class Real>
    constexpr Law(const std::array<Real, 5>& p, double)
        : v_per_k({0.10, 0.40, 0.70, 0.95}, std::array<Real, 4>{p[0], p[1], p[2], p[3]}),
          reference_c(Temperature<S>(p[4])) {}

    constexpr void tables(TablePoint<S>& at, const Soc<S>& soc, const StepInput<S>& input) const {
      const Temperature<S> warmer_k = input.temperature_c - reference_c;
      const auto here = v_per_k.at(soc);
      if constexpr (!Dual<S>) {  // per interval of the tables; a dual number contains it already
        at.ocv_delta_v = at.ocv_delta_v + ratio<Voltage<S>>(VoltagePerSoc<S>(here.slope * warmer_k), at.per_width);
      }
      at.ocv_v = at.ocv_v + here.value * warmer_k;
    }
  };
};

}  // namespace bms::model
