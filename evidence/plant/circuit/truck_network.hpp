// Nodes and branches of battery, contactors and truck.
#pragma once

#include <array>
#include <cstddef>

#include "plant/circuit/circuit.hpp"
#include "plant/circuit/truck_parameters.hpp"

namespace bms::plant {

/// Forward voltage of the diodes from an analog pin to VDDA and from VSS to the pin.
constexpr double adc_clamp_v = 0.3;

struct TruckNetwork {
  std::size_t c16, b_plus, b_minus, l_plus, l_minus, charger_plus, ld_pin, pack_pin, plus_pin, minus_pin, tap, frame;
  std::size_t string, fuse, shunt, dc_link, ld_wire, pack_wire, drive_source, charger_source, charger_limit;
  std::size_t other_batteries;  ///< only with TruckParameters::in_parallel
  std::array<std::size_t, relays> contact;
  std::array<std::size_t, 2> upper, bias, high_clamp;  ///< of the dividers of L+ and L-
  /// A leak from within the string divides it: `string` has the cells above it, `string_below` the others.
  std::size_t cells_below, string_below, string_leak;
  bool divided, leaks;
};

/// The contacts are open.
TruckNetwork build_network(Circuit& circuit, const TruckParameters& parameters, const CellString& cells);

}  // namespace bms::plant
