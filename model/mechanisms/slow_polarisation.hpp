// Diffusion slower than R1 C1, as the first two modes of a ladder:
//
//   du_k/dt = (R_k I - u_k) / tau_k,  R_1 = (1 - w) R, tau_1 = tau,  R_2 = w R, tau_2 = tau / 9
//   V = OCV(soc + t_lag (i_1 + i_2) / C_n) + ... + u_1 + u_2,  i_k = u_k / R the current as the modes see it
//
// The voltage depends on the surface of the particles, which is ahead of the mean that is counted. In addition to a
// voltage drop, the knees of the OCV therefore come early under load. For diffusion into a sphere of radius r,
// t_lag = r^2 / (15 D).
//
// R is the resistance at the temperature of the cell file, if the file has a temperature_resistance.
//
// w = 0 is a second RC branch; diffusion into a plate or a sphere has modes at 1, 1/9, 1/25 ... of the longest time
// constant (Warburg element of finite length).
#pragma once

#include "arithmetic/exponential.hpp"
#include "model/mechanism.hpp"

namespace bms::model {

struct SlowPolarisation {
  static constexpr std::string_view id = "slow_polarisation";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"resistance_ohm", "ohm", Role::strength, 0, 0, 0.12, Per::siemens,
                "R of both modes, after a pulse much longer than tau"},
      Parameter{"time_constant_s", "s", Role::shape, 600, 60, 20000, Per::cell, "tau of the slowest mode"},
      Parameter{"faster_share", "1", Role::place, 0.1, 0, 0.6, Per::cell,
                "w: share of the mode that is nine times faster"},
      Parameter{"surface_lag_s", "s", Role::strength, 0, 0, 900, Per::cell,
                "t_lag: under a constant current the surface is ahead by the charge of this time", 0, 0, 200},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::soc_shift_per_v | law_member::states |
                                          law_member::voltage_states | law_member::initial | law_member::relaxation;
    static constexpr std::size_t states = 2;
    static constexpr bool voltage_states = true;
    std::array<Resistance<S>, 2> r_ohm{};
    std::array<Rate<S>, 2> rate_per_s{};
    Coupling<S> surface_per_v{0};

    template <class Real>
    constexpr Law(const std::array<Real, 4>& p, double capacity_ah) {
      // the lag is a multiple of the modes' voltages, so R must not be 0
      constexpr double least_ohm_ah = 1e-6;
      const Real r = p[3] > Real(0) ? p[0] + Real(least_ohm_ah / capacity_ah) : p[0];
      r_ohm = {Resistance<S>(r * (Real(1) - p[2])), Resistance<S>(r * p[2])};
      rate_per_s = {Rate<S>(Real(1) / p[1]), Rate<S>(Real(9) / p[1])};
      if (r > Real(0)) surface_per_v = Coupling<S>(p[3] / (Real(3'600 * capacity_ah) * r));
    }

    constexpr Voltage<S> initial(std::size_t) const { return Voltage<S>(0); }
    constexpr Relaxation<S> relaxation(std::size_t i, const TablePoint<S>& at, const StepInput<S>& input) const {
      return {step_response_after<S>(input.duration_s, rate_per_s[i]),
              Voltage<S>(Resistance<S>(r_ohm[i] * at.activation) * input.current_a)};
    }
    constexpr Coupling<S> soc_shift_per_v() const { return surface_per_v; }
  };
};

}  // namespace bms::model
