// The board's wiring in given positions of the contacts: what the nodes have and what the two dividers show of it.
#pragma once

#include <initializer_list>

#include "plant/circuit/truck.hpp"

namespace bms::plant {

/// A node of the DC link by its divider with nominal values, its pin being measured as a share of VDDA.
double shown_v(double pin_v, double vdda_v);

struct Situation {
  TrueVoltages v;
  double plus_v, minus_v;  ///< L+ and L- as the dividers show them
};

Situation situation(const Truck& truck);

/// Closes the contacts at once by welding them.
void weld(Truck& truck, std::initializer_list<Relay> closed);

/// The contacts in `closed`, and no other, have been closed for 60 ms; the DC link was charged to start_v.
Situation at_rest_after(TruckParameters world, double start_v, std::initializer_list<Relay> closed);

/// Open-circuit voltage of the battery.
double battery_v(const TruckParameters& world);

/// Pre-charge with K2 and K3 from start_v for duration_s.
Situation precharged(TruckParameters world, double start_v, double duration_s);

}  // namespace bms::plant
