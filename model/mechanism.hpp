// What a mechanism is: one physical effect, or one fault of the measuring chain, that the 1RC model does not contain.
//
// A mechanism is a struct of its own in model/mechanisms/: its id, its parameters with unit, bounds and source, and a
// law. The law is a template over the scalar, constructed from the parameters' values and the capacity [Ah]. It has any
// of these members and lists them in `members` (model/law.hpp); what a law has no member for, it does not change.
//
//   Current<S> true_current(Current<S> read)                       undoes a fault of the current sensor
//   Temperature<S> true_temperature(Temperature<S> read)           undoes a fault of the temperature sensor
//   Current<S> counted(Current<S> counted, const StepInput<S>&)    current that ends as charge
//   Soc<S> ocv_soc(Soc<S>)                                         SOC at which the OCV table is read
//   Coupling<S> ocv_soc_slope(Soc<S>)                              its derivative; only with ocv_soc
//   Coupling<S> soc_shift_per_v()                                  shift of that SOC per volt of the law's voltage
//                                                                  states
//   void tables(TablePoint<S>&, Soc<S>, const StepInput<S>&)       changes OCV, R0, R1, C1 at this SOC and input
//   Voltage<S> initial(std::size_t i)                              state i before the first step
//   Relaxation<S> relaxation(std::size_t i, const TablePoint<S>&, const StepInput<S>&)
//                                                                  step of state i; with a fourth argument,
//                                                                  const Voltage<S>* x, if it depends on the law's own
//                                                                  states
//   void apply_state(TablePoint<S>&, Voltage<S> state, const StepInput<S>&)
//                                                                  changes the tables by the law's own state
//   Voltage<S> reading(Voltage<S>)                                 reading of the voltage sensor; linear
//   Voltage<S> initial_sigma_v(), steady_state_sigma_v()           standard deviations of its voltage states, for the
//                                                                  filter; default: half of the voltage that the
//                                                                  current can have built up, and noise.v_rc_v
//   void at(double time_s)                                         host only: time in the recording at the end of a
//                                                                  step
//   states, voltage_states, state_unit, resistances_follow_temperature     static constants
//
// Every state relaxes towards a target, x' = x + alpha (target - x). With `voltage_states` it is a voltage that adds to
// the terminal voltage and that the filter corrects; otherwise only apply_state() uses it, and the filter does not
// correct it. States come between v_rc and SOC (model/one_rc.hpp).
//
// model/catalogue.hpp lists the mechanisms; model/extended.hpp combines them with the 1RC model; model/README.md
// describes how to add one.
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <string_view>

#include "arithmetic/scalar.hpp"
#include "model/cell.hpp"
#include "model/law.hpp"
#include "model/one_rc.hpp"

namespace bms::model {

/// Temperature at which the tables of a cell file are valid, unless its mechanisms say otherwise [degrees C].
inline constexpr double reference_temperature_c = 25;

/// The role of a parameter. A mechanism has no effect if all its strengths are at their neutral values.
enum class Role {
  strength,  ///< 0: no effect
  shape,     ///< > 0, searched over decades
  place,     ///< between its bounds, searched linearly
  given,     ///< known, or determined from the data beforehand; not searched
};

/// How a bound scales with the capacity of the cell.
enum class Per {
  cell,     ///< not at all
  ah,       ///< times the capacity in Ah: currents
  siemens,  ///< divided by the capacity in Ah: resistances
};

struct Parameter {
  std::string_view name, unit;
  Role role = Role::strength;
  double neutral = 0;  ///< default value before default_value() scales it
  double low = 0, high = 0;
  Per per = Per::cell;
  std::string_view meaning;  ///< and the source of the bounds, if there is one
  double usual =
      0;  ///< of a strength: size beyond which it is rare, scaled like the bounds; 0: all sizes are equally likely
  double typical = 0, spread = 0;  ///< mean and standard deviation among cells; spread 0: unknown

  constexpr double scale(double capacity_ah) const {
    if (per == Per::cell) return 1;
    return per == Per::ah ? capacity_ah : 1 / capacity_ah;
  }
  constexpr double lower(double capacity_ah) const { return low * scale(capacity_ah); }
  constexpr double upper(double capacity_ah) const { return high * scale(capacity_ah); }
  constexpr double common(double capacity_ah) const { return usual * scale(capacity_ah); }
  /// The value if the cell file has no entry for it: neutral, scaled like the bounds and clamped to them.
  constexpr double default_value(double capacity_ah) const {
    return std::clamp(neutral * scale(capacity_ah), lower(capacity_ah), upper(capacity_ah));
  }
};

inline constexpr std::size_t max_mechanism_parameters = 5;
inline constexpr std::size_t max_mechanism_states = 2;

/// Where a mechanism acts: in the cell, in the measuring chain, or on the initial state.
enum class Domain { physics, instrument, start };

/// The step of one state of a law.
template <class S>
struct Relaxation {
  Fraction<S> alpha;                ///< share of the distance to the target that is covered
  Voltage<S> target;                ///< final value
  Fraction<S> error_decay = alpha;  ///< share of an error in the state that decays
};

/// Unit of a law's states if they are not voltages, for reports, and its amount per unit of the state.
struct StateUnit {
  std::string_view name;
  double scale;
};

template <class S>
constexpr Voltage<S> relaxed(const Voltage<S>& x, const Relaxation<S>& r) {
  return Voltage<S>(x + r.alpha * Voltage<S>(r.target - x));
}

namespace mechanism_detail {

/// exp(x) for |x| <= 4.5, the range of Factor.
template <class S>
constexpr Factor<S> exponential(const Exponent<S>& x) {
  const Exponent<S> none(0), most(4.5);
  if (x < none) return Factor<S>(Fraction<S>(1) - step_response<S>(-x < most ? Exponent<S>(-x) : most));
  const Fraction<S> remaining = Fraction<S>(Fraction<S>(1) - step_response<S>(x < most ? x : most));
  return ratio<Factor<S>>(Fraction<S>(1), remaining);
}

/// Arrhenius factor of a resistance with this activation energy, relative to reference_c. energy_over_rt: E / (R
/// T_ref).
///   exp(E / R (1 / T - 1 / T_ref)) = exp((E / (R T_ref)) (T_ref - T) / T)
template <class S>
constexpr Factor<S> arrhenius(const Factor<S>& energy_over_rt, const Temperature<S>& reference_c,
                              const Temperature<S>& temperature_c) {
  const Temperature<S> kelvin = temperature_c + Temperature<S>(273.15);
  if (kelvin < Temperature<S>(150)) return Factor<S>(1);  // not a temperature
  const auto relative = ratio<Fraction<S>>(Temperature<S>(reference_c - temperature_c), kelvin);
  return exponential<S>(Exponent<S>(energy_over_rt * relative));
}

inline constexpr double gas_constant_j_per_mol_k = 8.314462618;
template <class Real>
constexpr Real energy_over_rt(const Real& energy_j_per_mol, const Real& reference_c) {
  return energy_j_per_mol / (Real(gas_constant_j_per_mol_k) * (reference_c + Real(273.15)));
}

template <class S>
constexpr void scale(Resistance<S>& value, Resistance<S>& delta, const Factor<S>& by) {
  value = Resistance<S>(value * by);
  delta = Resistance<S>(delta * by);
}

}  // namespace mechanism_detail

}  // namespace bms::model
