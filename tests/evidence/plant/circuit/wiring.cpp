#include "tests/evidence/plant/circuit/wiring.hpp"

namespace bms::plant {

double shown_v(double pin_v, double vdda_v) {
  // 1 Mohm, 56 kohm, 56 kohm
  constexpr double conductance = 1 / 1e6 + 2 / 56e3, bias_share = 1 / 56e3 / conductance, gain = 1 / 1e6 / conductance;
  return (pin_v / vdda_v - bias_share) * 3.3 / gain;
}

Situation situation(const Truck& truck) {
  const PinVoltages pins = truck.pins();
  return {truck.voltages(), shown_v(pins.pc1_v, pins.vdda_v), shown_v(pins.pc0_v, pins.vdda_v)};
}

void weld(Truck& truck, std::initializer_list<Relay> closed) {
  for (const Relay relay : closed) truck.contactor(relay).set_fault(ContactorFault::welded);
}

Situation at_rest_after(TruckParameters world, double start_v, std::initializer_list<Relay> closed) {
  world.dc_link.start_v = start_v;
  Truck truck(world);
  weld(truck, closed);
  truck.advance(0.06);
  return situation(truck);
}

double battery_v(const TruckParameters& world) { return CellString(world.cells).emf_v(); }

Situation precharged(TruckParameters world, double start_v, double duration_s) {
  world.dc_link.start_v = start_v;
  Truck truck(world);
  weld(truck, {Relay::main_minus, Relay::precharge});
  truck.advance(duration_s);
  return situation(truck);
}

}  // namespace bms::plant
