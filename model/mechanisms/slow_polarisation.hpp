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

  /// Largest standard deviation of the surface's lead [SOC] by noise.v_rc_v: what 3 mV mean where 1C drops 10 mV and
  /// the lag is 200 s.
  static constexpr double most_lead_sigma = 0.02;

  /// R of both modes, at least the one that a surface lag needs: the lag is a multiple of the modes' voltages.
  template <class Real>
  static constexpr Real used_ohm(const Real& resistance_ohm, const Real& surface_lag_s, double capacity_ah) {
    // 0.1 mV at 1C is less than any sensor sees, and far above the smallest standard deviation of a state
    constexpr double least_ohm_ah = 1e-4;
    return surface_lag_s > Real(0) ? resistance_ohm + Real(least_ohm_ah / capacity_ah) : resistance_ohm;
  }

  /// Returns false if fixed point loses a surface lag: it rounds a resistance by more than 5 %, or a current of 1C
  /// moves a mode by less than 100 steps of a voltage in a second.
  static constexpr bool fits_fixed_point(const std::array<double, max_mechanism_parameters>& p, double capacity_ah) {
    constexpr double most_rounding = 0.05, least_steps = 100;
    constexpr double step_v = 1.0 / (std::uint64_t{1} << Voltage<FixedPoint>::fraction_bits);
    if (p[3] == 0) return true;
    const double r = used_ohm(p[0], p[3], capacity_ah);
    if (r * capacity_ah / p[1] < least_steps * step_v) return false;
    bool fits = true;
    for (const double ohm : {r * (1 - p[2]), r * p[2]}) {
      const double error_ohm = static_cast<double>(Resistance<FixedPoint>(ohm)) - ohm;
      fits = fits && error_ohm <= most_rounding * ohm && error_ohm >= -most_rounding * ohm;
    }
    return fits;
  }

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::soc_shift_per_v | law_member::states |
                                          law_member::voltage_states | law_member::initial | law_member::relaxation |
                                          law_member::most_sigma_v;
    static constexpr std::size_t states = 2;
    static constexpr bool voltage_states = true;
    std::array<Resistance<S>, 2> r_ohm{};
    std::array<Rate<S>, 2> rate_per_s{};
    Coupling<S> surface_per_v{0};
    Voltage<S> most_error_v{1};

    template <class Real>
    constexpr Law(const std::array<Real, 4>& p, double capacity_ah) {
      const Real r = used_ohm(p[0], p[3], capacity_ah);
      r_ohm = {Resistance<S>(r * (Real(1) - p[2])), Resistance<S>(r * p[2])};
      rate_per_s = {Rate<S>(Real(1) / p[1]), Rate<S>(Real(9) / p[1])};
      if (r > Real(0)) surface_per_v = Coupling<S>(p[3] / (Real(3'600 * capacity_ah) * r));
      const Real most_v_s = Real(3'600 * capacity_ah * most_lead_sigma) * r;
      if (p[3] > most_v_s) most_error_v = Voltage<S>(most_v_s / p[3]);
    }

    constexpr Voltage<S> initial(std::size_t) const { return Voltage<S>(0); }
    constexpr Relaxation<S> relaxation(std::size_t i, const TablePoint<S>& at, const StepInput<S>& input) const {
      return {step_response_after<S>(input.duration_s, rate_per_s[i]),
              Voltage<S>(Resistance<S>(r_ohm[i] * at.activation) * input.current_a)};
    }
    constexpr Coupling<S> soc_shift_per_v() const { return surface_per_v; }
    /// noise.v_rc_v is an error of the drop. Where the drop is small and the lag is long, the surface would become as
    /// uncertain as all of the SOC, and no voltage would correct it.
    constexpr Voltage<S> most_sigma_v() const { return most_error_v; }
  };
};

}  // namespace bms::model
