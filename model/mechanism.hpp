// What a mechanism is: one piece of physics, or one fault of the measuring chain, that the 1RC model leaves out.
//
// A mechanism is a struct of its own in model/mechanisms/: its id, its parameters with unit, bounds and source, and a
// law. The law is a template over the scalar, made from the parameters' values; it has any of these members, and what
// it lacks it does not touch:
//
//   Current<S> true_current(Current<S> read)                       undoes a fault of the current sensor
//   Temperature<S> true_temperature(Temperature<S> read)           the same for the temperature
//   Current<S> counted(Current<S> counted, const Drive<S>&)        current that ends as charge
//   Soc<S> ocv_soc(Soc<S>)                                         where the OCV table is read
//   Coupling<S> soc_shift_per_v()                                      the same by the law's voltage states: soc ahead
//   per volt of their sum Coupling<S> ocv_soc_slope(Soc<S>)                                 its derivative; with
//   ocv_soc only void tables(TablePoint<S>&, Soc<S>, const Drive<S>&)           changes OCV, R0, R1, C1 at this soc
//   under this drive Voltage<S> initial(std::size_t i)                              state i before the first step
//   Relaxation<S> settle(std::size_t i, const TablePoint<S>&, const Drive<S>&)     how state i moves in a step; with a
//   fourth argument,
//                                                                  const Voltage<S>* x, where that depends on the law's
//                                                                  own states
//   void warm(TablePoint<S>&, Voltage<S> state, const Drive<S>&)   changes the tables by the law's own state
//   Voltage<S> reading(Voltage<S>)                                 what the voltage sensor makes of the voltage: a
//   straight line Voltage<S> initial_sigma_v(), steady_state_sigma_v()                   standard deviations of its
//   voltage states, for the filter; without
//                                                                  them: half of what the current can have built up,
//                                                                  and noise.v_rc_v
//   void at(double time_s)                                         host only: where in the recording the step ends
//
// Every state is relaxed towards a target, x' = x + p (target - x). With `voltage_states` it is a voltage that adds to
// the terminal's and the filter corrects it; otherwise it is what warm() reads, and as sure as what drives it. States
// come between v_rc and soc (model/one_rc.hpp).
//
// model/catalogue.hpp lists the mechanisms; model/extended.hpp composes them with the base model. model/README.md tells
// how to add one.
#pragma once

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

/// What a parameter does. Of a mechanism whose strengths are all at their neutral value nothing is seen.
enum class Role {
  strength,  ///< 0: no effect
  shape,     ///< > 0, searched over decades
  place,     ///< somewhere between its bounds, searched linearly
  given,     ///< known or read off the data beforehand, not searched
};

/// How a bound depends on the size of the cell.
enum class Per {
  cell,     ///< as it stands
  ah,       ///< times the capacity in Ah: currents
  siemens,  ///< divided by the capacity in Ah: resistances
};

struct Parameter {
  std::string_view name, unit;
  Role role = Role::strength;
  double neutral = 0;  ///< value when nothing is said, as unsaid() scales it
  double low = 0, high = 0;
  Per per = Per::cell;
  std::string_view meaning;  ///< and its source, where the bounds have one
  double usual = 0;  ///< of a strength: size beyond which it is rare, scaled as the bounds are; 0: all are alike
  double typical = 0,
         spread = 0;  ///< what it is in most cells, and its standard deviation among them; spread 0: nobody knows

  constexpr double scale(double capacity_ah) const {
    return per == Per::cell ? 1 : per == Per::ah ? capacity_ah : 1 / capacity_ah;
  }
  constexpr double lower(double capacity_ah) const { return low * scale(capacity_ah); }
  constexpr double upper(double capacity_ah) const { return high * scale(capacity_ah); }
  constexpr double common(double capacity_ah) const { return usual * scale(capacity_ah); }
  /// neutral, scaled as the bounds are and held within them: what a cell file that is silent about it means.
  constexpr double default_value(double capacity_ah) const {
    const double silent = neutral * scale(capacity_ah);
    return silent < lower(capacity_ah) ? lower(capacity_ah) : silent > upper(capacity_ah) ? upper(capacity_ah) : silent;
  }
};

inline constexpr std::size_t max_mechanism_parameters = 5;
inline constexpr std::size_t max_mechanism_states = 2;

/// Where in the measuring chain or in the cell a mechanism acts.
enum class Domain { physics, instrument, start };

/// How one state of a law moves in a step.
template <class S>
struct Relaxation {
  Fraction<S> alpha;                ///< p
  Voltage<S> target;                ///< where it goes
  Fraction<S> error_decay = alpha;  ///< how much of an error in the state is gone after it
};

/// What a law's states are where they are no voltages: the unit for people, and how much of it one unit of the state
/// is.
struct StateUnit {
  std::string_view name;
  double scale;
};

template <class S>
constexpr Voltage<S> relaxed(const Voltage<S>& x, const Relaxation<S>& r) {
  return Voltage<S>(x + r.alpha * Voltage<S>(r.target - x));
}

namespace mechanism_detail {

/// exp(x) for |x| <= 4.5, where Factor ends.
template <class S>
constexpr Factor<S> exponential(const Exponent<S>& x) {
  const Exponent<S> none(0), most(4.5);
  if (x < none) return Factor<S>(Fraction<S>(1) - step_response<S>(-x < most ? Exponent<S>(-x) : most));
  const Fraction<S> remaining = Fraction<S>(Fraction<S>(1) - step_response<S>(x < most ? x : most));
  return ratio<Factor<S>>(Fraction<S>(1), remaining);
}

/// Arrhenius: how much a resistance of this activation energy differs from that at reference_c. kelvin = energy / R
/// [K].
///   exp(E / R (1 / T - 1 / T_ref)) = exp((E / (R T_ref)) (T_ref - T) / T)
template <class S>
constexpr Factor<S> arrhenius(const Factor<S>& energy_over_rt, const Temperature<S>& reference_c,
                              const Temperature<S>& temperature_c) {
  const Temperature<S> kelvin = temperature_c + Temperature<S>(273.15);
  if (kelvin < Temperature<S>(150)) return Factor<S>(1);  // no reading
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
