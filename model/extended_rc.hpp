// The 1RC model with a set of mechanisms, as the filter steps it: states v_rc, the mechanisms' voltages, SOC.
//
//   Voltages          states of mechanisms that add to the voltage and that the filter corrects. With laws that are
//                     chosen at run time, places for at most as many: those without a state are decoupled and change no
//                     bit of the others
//   MechanismStates   all states of mechanisms; those that are not corrected (a temperature rise) come last
//   Errors            whether two persistent errors are states as well: the amount by which the model's voltage is too
//                     low [V], and the amount by which the current reads too high, in capacities per hour [1/h]. Both
//                     are first-order Gauss-Markov processes: noise.model_v over `persistent_error_correlations` times
//                     noise.model_correlation_s, noise.current_offset_a over its own correlation time
//
//   covariance   v_rc, voltage error, mechanisms' voltages, SOC, current offset      (a state comes before those that
//                                                                                     act on it)
//   values       v_rc, voltage error, current offset, mechanisms' states             (the SOC is counted separately)
//
// A mechanism's state depends on itself and on the current only: x' = x + alpha (target - x), d x' / d x = 1 - alpha,
// no derivative by SOC. The laws' effect on the tables enters through the tables' own derivatives. ExtendedRc<0, 0> is
// OneRc.
//
// The laws come with the cell: a Cell has no laws, an ExtendedCell has those of its file.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "model/law_set.hpp"
#include "model/one_rc.hpp"

namespace bms::model {

/// A prepared cell with the laws of its mechanisms. SomeLaws: Laws or ChosenLaws (model/extended.hpp).
template <class S, std::size_t Max, class SomeLaws>
struct ExtendedCell : Cell<S, Max> {
  SomeLaws laws;
};

template <class S, std::size_t Max>
constexpr LawSet<S> laws_of(const Cell<S, Max>&) {
  return {};
}
template <class S, std::size_t Max, class SomeLaws>
constexpr const SomeLaws& laws_of(const ExtendedCell<S, Max, SomeLaws>& cell) {
  return cell.laws;
}

/// A cell with the input and the mechanism states for which its tables are evaluated.
template <class Tables, class StepInput, class Voltage>
struct OperatingPoint {
  const Tables& cell;
  const StepInput& input;
  const Voltage* mechanism;  ///< the mechanisms' states
};
template <class Tables, class StepInput, class Voltage>
OperatingPoint(const Tables&, const StepInput&, const Voltage*) -> OperatingPoint<Tables, StepInput, Voltage>;

template <class Tables, class S>
constexpr TablePoint<S> look_up(const OperatingPoint<Tables, StepInput<S>, Voltage<S>>& operating_point,
                                const Soc<S>& soc, std::uint8_t& interval) {
  const auto& laws = laws_of(operating_point.cell);
  TablePoint<S> at = look_up(operating_point.cell, soc, interval);
  if constexpr (std::remove_cvref_t<decltype(laws)>::shifts_ocv_soc) {
    at.shifted_ocv_slope_v = at.ocv_delta_v * at.per_width;
    if (const Soc<S> elsewhere = laws.ocv_soc(soc, operating_point.mechanism); elsewhere != soc) {
      std::uint8_t there_interval = interval;
      const TablePoint<S> there = look_up(operating_point.cell, elsewhere, there_interval);
      at.ocv_v = there.ocv_v;
      at.shifted_ocv_slope_v = VoltagePerSoc<S>(VoltagePerSoc<S>(there.ocv_delta_v * there.per_width) *
                                                laws.ocv_soc_slope(soc, operating_point.mechanism));
      at.ocv_delta_v = ratio<Voltage<S>>(at.shifted_ocv_slope_v, at.per_width);
    }
  }
  laws.tables(at, soc, operating_point.input, operating_point.mechanism);
  return at;
}

template <std::size_t Voltages, std::size_t MechanismStates, bool Errors = false>
struct ExtendedRc {
  static_assert(Voltages <= MechanismStates);

  template <class S>
  struct Of {
    using Base = OneRc<S>;
    static constexpr bool errors_are_states = Errors;
    static constexpr std::size_t states = Base::states + Voltages + (Errors ? 2 : 0);
    static constexpr std::size_t values = 1 + (Errors ? 2 : 0) + MechanismStates;
    static constexpr std::size_t voltage_error = 1, current_offset = 2;  ///< places among the values, if Errors
    static constexpr std::size_t first_mechanism_state = values - MechanismStates;
    static constexpr std::size_t soc = states - (Errors ? 2 : 1), last = states - 1;  ///< places in the covariance
    static constexpr std::size_t first_voltage = soc - Voltages;

    using State = std::array<Voltage<S>, values>;
    using StateTransition = std::array<std::array<Coupling<S>, states>, states>;
    using MeasurementJacobian = std::array<VoltagePerSoc<S>, states>;
    using Variances = std::array<Variance<S>, states>;

    /// Index among the values of state i of the covariance; i != soc.
    static constexpr std::size_t value_index(std::size_t i) {
      if (!Errors) return i;
      if (i > soc) return current_offset;
      return i < first_voltage ? i : i - first_voltage + first_mechanism_state;
    }
    static constexpr const Voltage<S>* mechanism_states(const State& x) { return x.data() + first_mechanism_state; }

    /// Share of the two errors that decays in a step; depends on its duration alone.
    struct ErrorDecay {
      Fraction<S> voltage_error{}, current_offset{};
    };
    struct Empty {};
    using OptionalErrorDecay = std::conditional_t<Errors, ErrorDecay, Empty>;
    static constexpr OptionalErrorDecay error_decay(const FilterNoise<S>& noise, const TimeStep<S>& duration_s) {
      if constexpr (Errors)
        return {part(duration_s * Fraction<S>(1.0 / persistent_error_correlations), noise.model_correlation_s),
                part(duration_s, noise.current_offset_correlation_s)};
      else
        return {};
    }

    struct Discretisation {
      typename Base::Discretisation rc;
      std::array<Relaxation<S>, MechanismStates> mechanism;
      OptionalErrorDecay error_decay;
    };

    template <class SomeLaws>
    static constexpr Discretisation discretise(const SomeLaws& laws, const State& x, const TablePoint<S>& at,
                                               const StepInput<S>& input, const OptionalErrorDecay& error_decay = {}) {
      return {Base::discretise(at, input.duration_s), laws.discretise(mechanism_states(x), at, input), error_decay};
    }

    /// Current reading minus the estimated offset.
    static constexpr Current<S> without_offset(const Current<S>& read_a, const State& x, const FilterNoise<S>& noise) {
      if constexpr (Errors)
        return Current<S>(read_a - noise.one_c_a * x[current_offset]);
      else
        return read_a;
    }

    static constexpr State advance(const State& x, const TablePoint<S>& at, const Discretisation& discretisation,
                                   const StepInput<S>& input) {
      State next{};
      next[0] = Base::advance({x[0]}, at, discretisation.rc, input)[0];
      if constexpr (Errors) {
        next[voltage_error] = relaxed<S>(x[voltage_error], {discretisation.error_decay.voltage_error, Voltage<S>(0)});
        next[current_offset] =
            relaxed<S>(x[current_offset], {discretisation.error_decay.current_offset, Voltage<S>(0)});
      }
#pragma GCC unroll 8
      for (std::size_t k = 0; k < MechanismStates; ++k)
        next[first_mechanism_state + k] = relaxed<S>(x[first_mechanism_state + k], discretisation.mechanism[k]);
      return next;
    }

    /// Voltage that the sensor reads.
    template <class SomeLaws>
    static constexpr Voltage<S> voltage(const SomeLaws& laws, const State& x, const TablePoint<S>& at,
                                        const StepInput<S>& input) {
      Voltage<S> v = Base::voltage({x[0]}, at, input);
      if constexpr (Voltages > 0 || Errors) v = Voltage<S>(v + sum_v(laws, x));
      return laws.reading(v);
    }

    /// Terminal voltage of a reading.
    template <class SomeLaws>
    static constexpr Voltage<S> true_voltage(const SomeLaws& laws, const Voltage<S>& read_v) {
      if (!laws.changes_reading()) return read_v;
      return ratio<Voltage<S>>(Voltage<S>(read_v - laws.reading(Voltage<S>(0))), gain(laws));
    }

    template <class SomeLaws>
    static constexpr Voltage<S> sum_v(const SomeLaws& laws, const State& x) {
      Voltage<S> sum(0);
      if constexpr (Errors) sum = x[voltage_error];
      const std::size_t count = voltages(laws);
#pragma GCC unroll 8
      for (std::size_t k = 0; k < Voltages; ++k) {
        if (k < count) sum = Voltage<S>(sum + x[first_mechanism_state + k]);
      }
      return sum;
    }

    /// Whether the transition of state i may depend on a later state k.
    struct Couples {
      static constexpr bool of(std::size_t i, std::size_t k) {
        return (i == 0 && k == soc) || (Errors && i == soc && k == last);
      }
    };
    static constexpr StateTransition state_transition(const State& x, const TablePoint<S>& at,
                                                      const Discretisation& discretisation, const StepInput<S>& input) {
      const auto base = Base::state_transition({x[0]}, at, discretisation.rc, input);
      StateTransition f{};
      f[0][0] = base[0][0];
      f[0][soc] = base[0][1];
#pragma GCC unroll 8
      for (std::size_t k = 0; k < Voltages; ++k)
        f[first_voltage + k][first_voltage + k] = Coupling<S>(Fraction<S>(1) - discretisation.mechanism[k].error_decay);
      f[soc][soc] = Coupling<S>(1);
      if constexpr (Errors) {
        f[voltage_error][voltage_error] = Coupling<S>(Fraction<S>(1) - discretisation.error_decay.voltage_error);
        // the drop of an offset over the resistances is below a millivolt
        f[soc][last] = -Coupling<S>(input.duration_s * Fraction<S>(1.0 / 3'600));
        f[last][last] = Coupling<S>(Fraction<S>(1) - discretisation.error_decay.current_offset);
      }
      return f;
    }

    template <class SomeLaws>
    static constexpr MeasurementJacobian measurement_jacobian(const SomeLaws& laws, const TablePoint<S>& at,
                                                              const StepInput<S>& input) {
      const auto base = Base::measurement_jacobian(at, input);
      MeasurementJacobian h{};
#pragma GCC unroll 8
      for (std::size_t k = 0; k < soc; ++k) h[k] = base[0];
      if constexpr (Voltages > 0 && SomeLaws::scales_states) {
        std::array<Factor<S>, Voltages> per_state{};
        per_state.fill(Factor<S>(1));
        laws.voltage_per_state(at, per_state);
#pragma GCC unroll 8
        for (std::size_t k = 0; k < Voltages; ++k) h[first_voltage + k] = VoltagePerSoc<S>(per_state[k]);
      }
      if constexpr (Voltages > 0 && SomeLaws::shifts_ocv_soc) {
        std::array<Coupling<S>, Voltages> ahead{};
        laws.soc_shift_per_v(ahead);
#pragma GCC unroll 8
        for (std::size_t k = 0; k < Voltages; ++k)
          h[first_voltage + k] = VoltagePerSoc<S>(h[first_voltage + k] + at.shifted_ocv_slope_v * ahead[k]);
      }
      const std::size_t count = voltages(laws);
#pragma GCC unroll 8
      for (std::size_t k = 0; k < Voltages; ++k) {
        if (k >= count) h[first_voltage + k] = VoltagePerSoc<S>(0);
      }
      h[soc] = base[1];
      if (laws.changes_reading()) {
        const Voltage<S> times = gain(laws);
#pragma GCC unroll 8
        for (std::size_t k = 0; k <= soc; ++k) h[k] = VoltagePerSoc<S>(h[k] * times);
      }
      return h;
    }

    /// Process noise of a step, without the SOC's: it replaces the share that decays, 1 - (1 - alpha)^2, of the
    /// steady-state variance.
    template <class SomeLaws>
    static constexpr Variances noise(const SomeLaws& laws, const Discretisation& discretisation,
                                     const FilterNoise<S>& of) {
      Variances q{};
      q[0] = steady_state_noise(of.v_rc_v2, discretisation.rc.alpha);
      if constexpr (Voltages > 0) {
        std::array<Variance<S>, Voltages> steady{};
        laws.variances(
            steady, [](const auto& law) -> decltype(law.steady_state_sigma_v()) { return law.steady_state_sigma_v(); },
            [&](std::size_t, const auto& law) { return error_of(law, of.v_rc_v2); });
#pragma GCC unroll 8
        for (std::size_t k = 0; k < Voltages; ++k)
          q[first_voltage + k] = steady_state_noise(uncertain(steady[k]), discretisation.mechanism[k].error_decay);
      }
      if constexpr (Errors) {
        q[voltage_error] = steady_state_noise(of.model_v2, discretisation.error_decay.voltage_error);
        q[last] = steady_state_noise(of.offset_per_h2, discretisation.error_decay.current_offset);
      }
      return q;
    }

    /// Start of the persistent errors and of the mechanisms under a current that has flowed for an unknown time: half
    /// of the final voltage, with a standard deviation of the same size. Sets the mechanisms' states in x and their
    /// variances.
    template <class SomeLaws>
    static constexpr void start(const SomeLaws& laws, State& x, Variances& variances, const TablePoint<S>& at,
                                const StepInput<S>& input, const FilterNoise<S>& of) {
      if constexpr (Errors) {
        variances[voltage_error] = of.model_v2;
        variances[last] = of.offset_per_h2;
      }
      if constexpr (MechanismStates > 0) {
        const auto initial = laws.initial();
        for (std::size_t k = 0; k < MechanismStates; ++k) x[first_mechanism_state + k] = initial[k];
      }
      if constexpr (Voltages > 0) {
        const auto discretisation = laws.discretise(mechanism_states(x), at, input);
        std::array<Variance<S>, Voltages> first{};
        laws.variances(
            first, [](const auto& law) -> decltype(law.initial_sigma_v()) { return law.initial_sigma_v(); },
            [&](std::size_t k, const auto& law) {
              x[first_mechanism_state + k] = Voltage<S>(discretisation[k].target * Fraction<S>(0.5));
              return Variance<S>(error_of(law, of.v_rc_v2) +
                                 x[first_mechanism_state + k] * x[first_mechanism_state + k]);
            });
        for (std::size_t k = 0; k < Voltages; ++k) variances[first_voltage + k] = uncertain(first[k]);
      }
    }

    /// Voltages of the RC pair and of the mechanisms' voltage states that a lasting current causes: what a polarisation
    /// scales with.
    template <class SomeLaws>
    static constexpr std::array<Voltage<S>, 1 + Voltages> final_voltages(const SomeLaws& laws, const State& x,
                                                                         const TablePoint<S>& at,
                                                                         const StepInput<S>& input) {
      std::array<Voltage<S>, 1 + Voltages> v{};
      v[0] = Voltage<S>(at.r1_ohm * input.current_a);
      if constexpr (Voltages > 0) {
        const auto discretisation = laws.discretise(mechanism_states(x), at, input);
        for (std::size_t k = 0; k < voltages(laws); ++k) v[1 + k] = discretisation[k].target;
      }
      return v;
    }
    /// Whether state k of the covariance, before the SOC, relaxes with a time constant.
    template <class SomeLaws>
    static constexpr bool is_polarisation(const SomeLaws& laws, std::size_t k) {
      return k == 0 || (k >= first_voltage && k < first_voltage + voltages(laws) &&
                        !laws.starts_with_own_sigma(k - first_voltage));
    }
    /// Polarisation x at one SOC, as it would be at another one. here, there: final_voltages() at both.
    static constexpr State polarisation_at(State x, const std::array<Voltage<S>, 1 + Voltages>& here,
                                           const std::array<Voltage<S>, 1 + Voltages>& there) {
      for (std::size_t k = 0; k <= Voltages; ++k) {
        if (here[k] == there[k]) continue;
        Voltage<S>& v = x[k == 0 ? 0 : first_mechanism_state + k - 1];
        v = scaled_by(v, there[k], here[k]);
      }
      return x;
    }

   private:
    /// Places for voltages that have a state. States beyond the places are not corrected.
    template <class SomeLaws>
    static constexpr std::size_t voltages(const SomeLaws& laws) {
      if constexpr (SomeLaws::all_act) {
        return Voltages;
      } else {
        const std::size_t count = laws.voltage_states();
        return count < Voltages ? count : Voltages;
      }
    }
    /// v times numerator / denominator, both of the same sign; 2 V at most.
    static constexpr Voltage<S> scaled_by(const Voltage<S>& v, const Voltage<S>& numerator,
                                          const Voltage<S>& denominator) {
      constexpr double most_v = 2, most_times = 16;
      const Voltage<S> size = v < Voltage<S>(0) ? Voltage<S>(-v) : v, most(most_v);
      const Voltage<S> up = numerator < Voltage<S>(0) ? Voltage<S>(-numerator) : numerator;
      const Voltage<S> down = denominator < Voltage<S>(0) ? Voltage<S>(-denominator) : denominator;
      const bool large = !(Voltage<S>(up * Fraction<S>(1 / most_times)) < down);
      const Factor<S> times = large ? Factor<S>(most_times) : ratio<Factor<S>>(up, down);
      const Factor<S> wide = Factor<S>((size < most ? size : most) * times);
      const Voltage<S> result = wide < Factor<S>(most_v) ? Voltage<S>(wide) : most;
      return v < Voltage<S>(0) ? Voltage<S>(-result) : result;
    }
    /// At least (1 uV)^2: a mechanism of strength 0 would make its state certain, and the filter divide 0 by 0.
    static constexpr Variance<S> uncertain(const Variance<S>& variance) {
      const auto least = Variance<S>(1e-12);
      return variance < least ? least : variance;
    }
    /// noise.v_rc_v for the states of this law.
    template <class Law>
    static constexpr Variance<S> error_of(const Law& law, const Variance<S>& v_rc_v2) {
      if constexpr (requires { law.most_sigma_v(); }) {
        const Voltage<S> most_v = law.most_sigma_v();
        const auto most_v2 = Variance<S>(most_v * most_v);
        return most_v2 < v_rc_v2 ? most_v2 : v_rc_v2;
      } else {
        return v_rc_v2;
      }
    }
    static constexpr Variance<S> steady_state_noise(const Variance<S>& steady, const Fraction<S>& alpha) {
      return product<Variance<S>>(steady, Fraction<S>(alpha * Fraction<S>(Fraction<S>(2) - alpha)));
    }
    /// short_s / long_s, 1 at most.
    template <class Time>
    static constexpr Fraction<S> part(const Time& short_s, const Duration<S>& long_s) {
      return long_s > Duration<S>(short_s) ? ratio<Fraction<S>>(Duration<S>(short_s), long_s) : Fraction<S>(1);
    }
    /// Slope of the reading, which is linear in the voltage.
    template <class SomeLaws>
    static constexpr Voltage<S> gain(const SomeLaws& laws) {
      return Voltage<S>(laws.reading(Voltage<S>(1)) - laws.reading(Voltage<S>(0)));
    }
  };
};

}  // namespace bms::model
