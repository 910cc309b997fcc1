// The paper's grey-box model: one RC branch behind a resistance and an open-circuit voltage (Fig. 1, Eq. 1-2, 8-9).
//
//   d v_rc / dt = -v_rc / (R1 C1) + I / C1        d soc / dt = I / (3600 C_n)        V = OCV(soc) + v_rc + R0 I
//
// Current > 0 charges; v_rc > 0 while charging (v_rc = -x1 of Eq. 9; the sign of R0 u in Eq. 3 and 5 is an erratum).
// One step is exact for a constant current (zero-order hold), with R1 and C1 at the SOC after the step:
//
//   alpha = 1 - exp(-dt / (R1 C1))        v_rc' = v_rc + alpha (R1 I - v_rc)
//
// A model provides the number of states (the SOC is the last here), the step of the states before the SOC, the voltage,
// and the derivatives of both. A state may depend on itself and on later states only, so that the state transition is
// upper triangular: a second RC branch or a hysteresis voltage comes before the SOC, a sensor offset after it.
#pragma once

#include <array>
#include <cstddef>

#include "arithmetic/exponential.hpp"
#include "model/cell.hpp"
#include "model/temperature.hpp"

namespace bms::model {

/// Input of one time step.
template <class S>
struct StepInput {
  Current<S> current_a;                                              ///< mean over the step, > 0 charges
  TimeStep<S> duration_s;                                            ///< > 0
  Temperature<S> temperature_c = Temperature<S>(assumed_ambient_c);  ///< of the cell; used by mechanisms only
};

template <class S>
struct OneRc {
  static constexpr std::size_t states = 2;  ///< v_rc [V], soc

  using State = std::array<Voltage<S>, states - 1>;  ///< the states before soc
  using StateTransition = std::array<std::array<Coupling<S>, states>, states>;
  using MeasurementJacobian = std::array<VoltagePerSoc<S>, states>;

  /// Discretised RC branch for one step, from the tables at one SOC.
  struct Discretisation {
    Rate<S> rate_per_s;             ///< 1 / (R1 C1)
    Fraction<S> alpha;              ///< 1 - exp(-x), x = duration / (R1 C1)
    Fraction<S> alpha_by_log_rate;  ///< d alpha / d ln rate = x exp(-x)
  };

  static constexpr Discretisation discretise(const TablePoint<S>& at, const TimeStep<S>& duration_s) {
    const Duration<S> tau_s = at.r1_ohm * at.c1_f;
    const Rate<S> rate_per_s = ratio<Rate<S>>(Duration<S>(1), tau_s);
    const Fraction<S> alpha = step_response_after<S>(duration_s, rate_per_s), remaining = Fraction<S>(1) - alpha;
    const Fraction<S> x = duration_s * rate_per_s;
    if (long_step<S>(x)) [[unlikely]]
      return {rate_per_s, alpha, remaining * Current<S>(Exponent<S>(duration_s * rate_per_s))};
    return {rate_per_s, alpha, remaining * x};
  }

  /// x: at the start of the step; at and discretisation: at the SOC at its end.
  static constexpr State advance(const State& x, const TablePoint<S>& at, const Discretisation& discretisation,
                                 const StepInput<S>& input) {
    return {Voltage<S>(x[0] + Voltage<S>(discretisation.alpha * gap_v(x, at, input)))};
  }

  /// Terminal voltage (Eq. 9).
  static constexpr Voltage<S> voltage(const State& x, const TablePoint<S>& at, const StepInput<S>& input) {
    return at.ocv_v + x[0] + Voltage<S>(at.r0_ohm * input.current_a);
  }

  /// d (state after) / d (state before), upper triangular. The derivative by SOC comes through R1, C1 and
  /// d alpha / dx = exp(-x).
  static constexpr StateTransition state_transition(const State& x, const TablePoint<S>& at,
                                                    const Discretisation& discretisation, const StepInput<S>& input) {
    const Fraction<S> remaining = Fraction<S>(1) - discretisation.alpha;
    // changes over one interval: of tau, of alpha, and of the final v_rc
    const Duration<S> tau_delta_s = Duration<S>(at.r1_delta_ohm * at.c1_f) + Duration<S>(at.r1_ohm * at.c1_delta_f);
    const Ratio tau_change = tau_delta_s * discretisation.rate_per_s;
    const Ratio alpha_delta = discretisation.alpha_by_log_rate * tau_change;
    const Voltage<S> target_delta_v = at.r1_delta_ohm * input.current_a;
    const Voltage<S> delta_v =
        Voltage<S>(discretisation.alpha * target_delta_v) - Voltage<S>(alpha_delta * gap_v(x, at, input));
    return {{{Coupling<S>(remaining), Coupling<S>(delta_v * at.per_width)}, {Coupling<S>(0), Coupling<S>(1)}}};
  }

  /// d voltage / d state, at the state after the step.
  static constexpr MeasurementJacobian measurement_jacobian(const TablePoint<S>& at, const StepInput<S>& input) {
    return {
        VoltagePerSoc<S>(1),
        VoltagePerSoc<S>(Voltage<S>(at.ocv_delta_v + Voltage<S>(at.r0_delta_ohm * input.current_a)) * at.per_width)};
  }

 private:
  using Ratio = Current<S>;  // relative changes over an interval: below 2,048

  /// Distance of v_rc from its final value under this current.
  static constexpr Voltage<S> gap_v(const State& x, const TablePoint<S>& at, const StepInput<S>& input) {
    return Voltage<S>(at.r1_ohm * input.current_a) - x[0];
  }
};

}  // namespace bms::model
