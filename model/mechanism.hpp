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
//   Voltage<S> most_sigma_v()                                      largest standard deviation that noise.v_rc_v means
//                                                                  for its voltage states
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
#include "model/cell_parameters.hpp"
#include "model/law.hpp"
#include "model/one_rc.hpp"
#include "model/temperature.hpp"

namespace bms::model {

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
  double typical = 0, spread = 0;         ///< mean and standard deviation among cells; spread 0: unknown
  bool is_reference_temperature = false;  ///< the default value is that of the cell file, not `neutral`

  constexpr double scale(double capacity_ah) const {
    if (per == Per::cell) return 1;
    return per == Per::ah ? capacity_ah : 1 / capacity_ah;
  }
  constexpr double lower(double capacity_ah) const { return low * scale(capacity_ah); }
  constexpr double upper(double capacity_ah) const { return high * scale(capacity_ah); }
  constexpr double common(double capacity_ah) const { return usual * scale(capacity_ah); }
  /// The value if the cell file has no entry for it: neutral, scaled like the bounds and clamped to them. For a
  /// reference temperature, default_setting() (model/extended.hpp) takes that of the cell file instead.
  constexpr double default_value(double capacity_ah) const {
    return std::clamp(neutral * scale(capacity_ah), lower(capacity_ah), upper(capacity_ah));
  }
};

/// The parameter reference_c of a mechanism that depends on the temperature.
constexpr Parameter reference_temperature(std::string_view meaning) {
  constexpr accepted::Range range = accepted::reference_temperature_c;
  Parameter p{"reference_c", "degC",     Role::given, default_reference_temperature_c,
              range.low,     range.high, Per::cell,   meaning};
  p.is_reference_temperature = true;
  return p;
}

inline constexpr std::size_t max_mechanism_parameters = 13;
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

template <class S>
constexpr void scale(Resistance<S>& value, Resistance<S>& delta, const Factor<S>& by) {
  value = Resistance<S>(value * by);
  delta = Resistance<S>(delta * by);
}

}  // namespace mechanism_detail

}  // namespace bms::model
