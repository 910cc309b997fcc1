// Prints a start of the truck as CSV: pre-charge, drive, recuperation, opening. write_truck_start [SEED]; without a
// seed the components have their typical values.
#include <cstdio>
#include <cstdlib>

#include "plant/circuit/truck.hpp"

namespace {

using namespace bms::plant;

void set(ControllerPins& pins, Relay relay, PinLevel level) { pins.relay[static_cast<std::size_t>(relay)] = level; }

void print_header() {
  std::puts(
      "time_s,b_plus_v,l_plus_v,l_minus_v,dc_link_v,current_a,precharge_a,pc1_v,pc0_v,ld_v,vdda_v,pb14_v,resistor_c,"
      "cell_1_v");
}

void print_line(const Truck& truck) {
  const PinVoltages pins = truck.pins();
  const TrueVoltages v = truck.voltages();
  std::printf("%.5f,%.4f,%.4f,%.4f,%.4f,%.3f,%.4f,%.5f,%.5f,%.4f,%.4f,%.3f,%.2f,%.5f\n", truck.time_s(), v.b_plus_v,
              v.l_plus_v, v.l_minus_v, v.dc_link_v(), truck.current_a(), truck.contact_a(Relay::precharge), pins.pc1_v,
              pins.pc0_v, pins.ld_v, pins.vdda_v, pins.pb14_v, truck.precharge_resistor_c(), truck.cell_v(0));
}

void run(Truck& truck, double duration_s) {
  for (double rest_s = duration_s; rest_s > 1e-9; rest_s -= 0.002) {
    truck.advance(0.002);
    print_line(truck);
  }
}

}  // namespace

int main(int count, char** arguments) {
  Truck truck(count > 1 ? random_world(std::strtoull(arguments[1], nullptr, 10)) : typical_world());
  ControllerPins pins;
  print_header();
  run(truck, 0.2);
  set(pins, Relay::main_minus, PinLevel::high);
  truck.set_pins(pins);
  run(truck, 0.2);
  set(pins, Relay::precharge, PinLevel::high);
  truck.set_pins(pins);
  run(truck, 2.5);
  pins.ddsg = PinLevel::high;
  set(pins, Relay::main_plus, PinLevel::high);
  truck.set_pins(pins);
  run(truck, 0.1);
  set(pins, Relay::precharge, PinLevel::low);
  truck.set_pins(pins);
  run(truck, 0.2);
  truck.set_drive({.power_w = 8'000});
  run(truck, 0.5);
  truck.set_drive({.power_w = -3'000});
  run(truck, 0.3);
  truck.set_drive({});
  run(truck, 0.1);
  truck.set_pins({});
  run(truck, 0.4);
  for (const ContactEvent& event : truck.events()) {
    std::fprintf(stderr, "%.5f s K%d %s%s: %.3f V across, %.3f A, peak %.2f A, DC link %.2f V\n", event.time_s,
                 static_cast<int>(event.relay) + 1, event.closes ? "closes" : "opens", event.bounce ? " (bounce)" : "",
                 event.across_v, event.current_a, event.peak_a, event.dc_link_v);
  }
  std::fprintf(stderr, "%zu steps, %zu factorisations, %.2f J in the pre-charge resistor\n", truck.circuit().steps(),
               truck.circuit().factorisations(), truck.precharge_heat_j());
}
