// How a cell starts that rests before a recording: the state of each mechanism at the first row, by one rule for
// simulation, replay, diagnosis, identification and their hold-outs.
//
//   polarisation, heat   relaxed: the laws' own initial states
//   charge               the state of charge that the user states, plus `shift` of the mechanism initial_soc
//   hysteresis           `initial` of the cell file where it is not 0; else by the state of charge: a full cell was
//                        charged last, an empty one discharged, and between them both are equally likely, whose mean is
//                        the middle
//
// The filter on host and board does not use this rule: it estimates the branch position and starts it as the cell file
// says, with the standard deviation of both branches.
#pragma once

#include <span>

#include "model/extended.hpp"

namespace bms::model {

/// States of charge beyond which the last charge that moved is known: a recording begins there after a charge or a
/// discharge.
struct KnownDirection {
  double charged_soc = 0.9, discharged_soc = 0.1;
};
inline constexpr KnownDirection known_direction{};

/// Branch position at a start, -1 discharge .. 1 charge branch.
struct StartPosition {
  double position = 0;
  bool known = false;  ///< the state of charge alone decides it
};

/// stated: `initial` of the cell file; 0: nothing is known. soc: at the start.
constexpr StartPosition start_position(double stated, double soc) {
  double by_soc = 0;
  if (soc > known_direction.charged_soc) by_soc = 1;
  if (soc < known_direction.discharged_soc) by_soc = -1;
  if (by_soc != 0 && (stated == 0 || stated == by_soc)) return {by_soc, true};
  return {stated, false};
}

/// Shift of a stated state of charge by the mechanisms of a cell file.
constexpr double start_shift(std::span<const MechanismSetting> mechanisms) {
  double shift = 0;
  for (const MechanismSetting& m : mechanisms) {
    if (m.index == mechanism_index_of<InitialSoc>) shift += m.value[0];
  }
  return shift;
}

/// A mechanism as it starts at a state of charge.
constexpr MechanismSetting started(MechanismSetting setting, double soc) {
  constexpr std::size_t initial = 3;
  static_assert(OcvHysteresis::parameters[initial].name == "initial");
  if (setting.index == mechanism_index_of<OcvHysteresis>)
    setting.value[initial] = start_position(setting.value[initial], soc).position;
  return setting;
}

/// The laws of all mechanisms of a cell file, in a recording that starts at this state of charge.
template <class S>
constexpr ChosenLaws<S> laws_at_start(std::span<const MechanismSetting> settings, double capacity_ah, double soc) {
  ChosenLaws<S> laws;
  for (const MechanismSetting& m : settings) choose<S, double>(laws, m.index, started(m, soc).value, capacity_ah);
  return laws;
}

}  // namespace bms::model
