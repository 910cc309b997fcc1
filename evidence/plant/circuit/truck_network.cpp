#include "plant/circuit/truck_network.hpp"

#include <cmath>

namespace bms::plant {

namespace {

constexpr double diode_ohm = 1, pin_leakage_ohm = 1e12, no_leak_ohm = 1e12;

void build_battery(Circuit& circuit, TruckNetwork& n, const TruckParameters& p, const CellString& cells) {
  n.c16 = circuit.add_node();
  n.b_plus = circuit.add_node();
  n.b_minus = circuit.add_node();
  n.cells_below = p.leaks.cells_below;
  n.divided = std::isfinite(p.leaks.string_ohm) && n.cells_below > 0 && n.cells_below < cells.size();
  if (n.divided) {
    const std::size_t below = n.cells_below, tap = circuit.add_node();
    n.string = circuit.add(Branch{.from = n.c16,
                                  .to = tap,
                                  .resistance_ohm = cells.resistance_ohm() - cells.resistance_ohm(below),
                                  .emf_v = cells.emf_v() - cells.emf_v(below)});
    n.string_below =
        circuit.add(Branch{.from = tap, .resistance_ohm = cells.resistance_ohm(below), .emf_v = cells.emf_v(below)});
    n.tap = tap;
  } else {
    n.string = circuit.add(Branch{.from = n.c16, .resistance_ohm = cells.resistance_ohm(), .emf_v = cells.emf_v()});
    n.tap = n.cells_below == 0 ? Circuit::ground : n.c16;
  }
  n.fuse = circuit.add(Branch{.from = n.b_plus, .to = n.c16, .resistance_ohm = p.fuse_ohm});
  n.shunt = circuit.add(Branch{.from = Circuit::ground, .to = n.b_minus, .resistance_ohm = p.shunt_ohm});
}

void build_truck(Circuit& circuit, TruckNetwork& n, const TruckParameters& p) {
  n.l_plus = circuit.add_node();
  n.l_minus = circuit.add_node();
  n.dc_link = circuit.add(Branch{.from = n.l_plus,
                                 .to = n.l_minus,
                                 .resistance_ohm = p.dc_link.esr_ohm,
                                 .capacitance_f = p.dc_link.capacitance_f,
                                 .capacitor_v = p.dc_link.start_v});
  if (std::isfinite(p.dc_link.bleeder_ohm)) {
    circuit.add(Branch{.from = n.l_plus, .to = n.l_minus, .resistance_ohm = p.dc_link.bleeder_ohm});
  }
  n.drive_source = circuit.add_current_source(n.l_plus, n.l_minus);
  if (p.in_parallel)
    n.other_batteries = circuit.add(Branch{.from = n.l_plus, .to = n.l_minus, .resistance_ohm = p.open_contact_ohm});
}

/// A current source, limited to a voltage, feeds the output capacitor through a diode.
void build_charger(Circuit& circuit, TruckNetwork& n, const TruckParameters& p) {
  n.charger_plus = circuit.add_node();
  const std::size_t inner = circuit.add_node();
  n.charger_source = circuit.add_current_source(n.l_minus, inner);
  n.charger_limit = circuit.add(Diode{.from = inner, .to = n.l_minus, .on_ohm = 1e-3});
  circuit.add(Diode{.from = inner, .to = n.charger_plus});
  circuit.add(Branch{.from = n.charger_plus,
                     .to = n.l_minus,
                     .resistance_ohm = p.charger.output_ohm,
                     .capacitance_f = p.charger.output_f,
                     .capacitor_v = p.charger.idle_v});
}

void build_contacts(Circuit& circuit, TruckNetwork& n, const TruckParameters& p) {
  const auto add = [&](Relay relay, std::size_t from, std::size_t to, double ohm) {
    const Switch open{.from = from, .to = to, .on_ohm = ohm, .off_ohm = p.open_contact_ohm};
    n.contact[static_cast<std::size_t>(relay)] = circuit.add(open);
  };
  add(Relay::main_plus, n.b_plus, n.l_plus, p.main_contact_ohm);
  add(Relay::main_minus, n.b_minus, n.l_minus, p.main_contact_ohm);
  add(Relay::precharge, n.b_plus, n.l_plus, p.precharge.ohm);
  add(Relay::charge, n.charger_plus, n.l_plus, p.main_contact_ohm);
}

void build_front_end(Circuit& circuit, TruckNetwork& n, const FrontEndInputs& p) {
  const auto input = [&](std::size_t node, double internal_ohm, std::size_t& wire) {
    const std::size_t pin = circuit.add_node();
    wire = circuit.add(Branch{.from = node, .to = pin, .resistance_ohm = p.series_ohm});
    circuit.add(Branch{.from = pin, .resistance_ohm = internal_ohm});
    circuit.add(Diode{.to = pin, .forward_v = p.clamp_v, .on_ohm = diode_ohm, .off_ohm = pin_leakage_ohm});
    return pin;
  };
  n.ld_pin = input(n.l_plus, p.ld_ohm, n.ld_wire);
  n.pack_pin = input(n.b_plus, p.pack_ohm, n.pack_wire);
}

void build_divider(Circuit& circuit, TruckNetwork& n, const Divider& p, std::size_t which) {
  const std::size_t node = which == 0 ? n.l_plus : n.l_minus;
  std::size_t& pin = which == 0 ? n.plus_pin : n.minus_pin;
  pin = circuit.add_node();
  n.upper[which] = circuit.add(Branch{.from = node, .to = pin, .resistance_ohm = p.upper_ohm});
  circuit.add(Branch{.from = pin, .resistance_ohm = p.lower_ohm});
  n.bias[which] = circuit.add(Branch{.from = pin, .resistance_ohm = p.bias_ohm});
  circuit.add(Branch{.from = pin, .capacitance_f = p.capacitance_f});
  n.high_clamp[which] = circuit.add(Diode{.from = pin, .on_ohm = diode_ohm, .off_ohm = pin_leakage_ohm});
  circuit.add(Diode{.to = pin, .forward_v = adc_clamp_v, .on_ohm = diode_ohm, .off_ohm = pin_leakage_ohm});
}

/// The frame: what leaks to it.
void build_frame(Circuit& circuit, TruckNetwork& n, const FrameLeaks& p) {
  n.leaks = p.any();
  if (!n.leaks) return;
  n.frame = circuit.add_node();
  const auto leak = [&](std::size_t node, double ohm) {
    return circuit.add(Branch{.from = node, .to = n.frame, .resistance_ohm = std::isfinite(ohm) ? ohm : no_leak_ohm});
  };
  n.string_leak = leak(n.tap, p.string_ohm);
  leak(n.l_plus, p.plus_ohm);
  leak(n.l_minus, p.minus_ohm);
}

}  // namespace

TruckNetwork build_network(Circuit& circuit, const TruckParameters& parameters, const CellString& cells) {
  TruckNetwork network{};
  build_battery(circuit, network, parameters, cells);
  build_truck(circuit, network, parameters);
  build_charger(circuit, network, parameters);
  build_contacts(circuit, network, parameters);
  build_front_end(circuit, network, parameters.front_end);
  build_divider(circuit, network, parameters.plus_divider, 0);
  build_divider(circuit, network, parameters.minus_divider, 1);
  build_frame(circuit, network, parameters.leaks);
  return network;
}

}  // namespace bms::plant
