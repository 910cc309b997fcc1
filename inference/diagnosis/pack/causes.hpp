// The causes that the diagnosis of a pack knows, and the parameters by which a cell differs from its neighbours.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace bms::diagnosis::pack {

/// How a cell, its connection or its channel differs from the neighbours. All of them have a healthy spread.
enum Parameter : std::size_t {
  charge,         ///< state of charge minus that of the neighbours, at the start
  capacity,       ///< 1 / capacity relative to the neighbours, minus 1
  leak,           ///< charge lost a day, as a fraction of the capacity
  resistance,     ///< R0 and R1 relative to the neighbours, minus 1
  polarisation,   ///< the same, R1 only
  time_constant,  ///< of the polarisation: R1 C1 relative to the neighbours, in ln
  tilt,           ///< the resistances' course over the state of charge: relative change from empty to full
  joint,          ///< resistance of a connection within the cell's voltage [ohm]
  offset,         ///< of the voltage channel [V]
  gain,           ///< of the voltage channel, minus 1
  slope,          ///< by the voltage around its mean: curves of healthy cells differ; a gain error also shifts the mean
  delay,          ///< of the voltage channel against the neighbours [s]
  temperature,    ///< change of the resistances per kelvin of difference to the mean of the sensors [1/K]
  heating,        ///< change of the resistances per kelvin by which a grown one warms its cell, minus the usual [1/K]
  blur,           ///< response to changes of the current within a few rows: not read at the moment of the neighbours
  shape_1,        ///< the OCV curve of this cell differs by cos(pi soc) [V]
  shape_2,        ///< ... by cos(2 pi soc)
  shape_3,        ///< ... by cos(3 pi soc)
  shape_4,        ///< ... by cos(4 pi soc)
  parameter_count
};

enum class Cause {
  imbalance,
  capacity,
  leakage,
  resistance,
  joint,
  offset,
  gain,
  late,
  sense_wire,
  // not compared with neighbours by parameters
  repeated,
  staggered,
  missing,
  thermistor,
  pack_voltage,
  shared,
  // of all cells
  current_offset,
  current_gain,
  all_capacity,
  current_sign,
  current_silent  ///< reads 0 under load
};

/// Causes that are compared with one another for each cell.
inline constexpr std::array cell_causes = {Cause::imbalance,  Cause::capacity, Cause::leakage,
                                           Cause::resistance, Cause::joint,    Cause::offset,
                                           Cause::gain,       Cause::late,     Cause::sense_wire};

/// What a cause is for the user.
struct CauseText {
  std::string_view id, name, parameter, unit, meaning, action;
};
const CauseText& text_of(Cause cause);

/// Returns true if the readings are at fault, not the battery.
constexpr bool is_of_data(Cause cause) {
  return cause == Cause::late || cause == Cause::repeated || cause == Cause::staggered || cause == Cause::missing ||
         cause == Cause::current_silent;
}

/// Returns true for two causes of one cell whose effects are nearly alike. Together they would cancel at any size.
constexpr bool are_alike(Cause a, Cause b) {
  return (a == Cause::offset && b == Cause::gain) || (a == Cause::gain && b == Cause::offset) ||
         (a == Cause::resistance && b == Cause::joint) || (a == Cause::joint && b == Cause::resistance) ||
         (a == Cause::capacity && b == Cause::leakage) || (a == Cause::leakage && b == Cause::capacity);
}

/// The parameter of a cell that a cause changes. A sense wire changes the offsets of two neighbours in opposite ways.
constexpr Parameter parameter_of(Cause cause) {
  switch (cause) {
    case Cause::imbalance:
      return charge;
    case Cause::capacity:
      return capacity;
    case Cause::leakage:
      return leak;
    case Cause::resistance:
      return resistance;
    case Cause::joint:
      return joint;
    case Cause::gain:
      return gain;
    case Cause::late:
      return delay;
    default:
      return offset;
  }
}

}  // namespace bms::diagnosis::pack
