// Battery, contactors, truck and charger as one circuit, and what the pins of the board see of it.
//
//                 fuse          K1 main plus
//   C16 --[cells]-- F1 -- B+ --+---o o----------+-- L+ --+------- K4 -- CH+
//                              +-- K3 - 50 ohm -+        |
//                                              DC-link capacitor, bleeder, drive, DC/DC
//   C0  --[shunt]-------- B- -----o o---------------- L- +------------- CH-
//                                 K2 main minus
//
// LD and PACK of the front end and the two dividers load L+, B+ and L- against C0, which is ground.
// The plant knows components and physics. It has no sequence, no threshold and no diagnosis.
// Currents > 0 charge the battery; the drive's power is > 0 when it drives.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "plant/circuit/cell_string.hpp"
#include "plant/circuit/circuit.hpp"
#include "plant/circuit/contactor.hpp"
#include "plant/circuit/truck_network.hpp"
#include "plant/circuit/truck_parameters.hpp"

namespace bms::plant {

/// `floating`: an input or a controller without supply; the pull-down makes it low.
enum class PinLevel { low, high, floating };

struct ControllerPins {
  std::array<PinLevel, relays> relay = {};  ///< PC6 to PC9, indexed by Relay
  PinLevel ddsg = PinLevel::low;            ///< low: K1 opens
  PinLevel dchg = PinLevel::low;            ///< low: K4 opens
};

struct Drive {
  double power_w = 0;    ///< < 0 recuperates
  double current_a = 0;  ///< added to it: a load of constant current
};

struct ChargerDemand {
  bool on = false;
  double voltage_v = 58.4, current_a = 50;
};

/// A battery as the DC link sees it, by Thevenin.
struct LinkSource {
  double emf_v = 0, siemens = 0;  ///< 0 S: its contacts are open
};

struct SupplyDip {
  double start_s, duration_s, depth_v;
};

/// Voltages at the pins, against C0.
struct PinVoltages {
  double ld_v, pack_v;
  double pc1_v, pc0_v;  ///< dividers of L+ and L-
  double vdda_v;
  double pb14_v, pb15_v;  ///< auxiliary contacts of K1 and K2: 0 when the main contact is closed
  double pa1_v, pa2_v;    ///< Hall sensors
  double shunt_v;         ///< > 0 charges
  double pc4_v;           ///< divided supply of the coils
};

struct TrueVoltages {
  double b_plus_v, b_minus_v, l_plus_v, l_minus_v, charger_v;
  double dc_link_v() const { return l_plus_v - l_minus_v; }
};

/// A main contact that has closed or opened.
struct ContactEvent {
  double time_s = 0;
  Relay relay = Relay::main_plus;
  bool closes = false;
  bool bounce = false;   ///< not the first touch of a closing
  double across_v = 0;   ///< closing: right before; opening: right after
  double current_a = 0;  ///< closing: right after; opening: right before
  double peak_a = 0;     ///< closing: largest within 5 ms while closed
  double dc_link_v = 0;  ///< right before
};

enum class Wire { fuse, ld, pack, plus_divider, minus_divider, precharge_resistor };

class Truck {
 public:
  explicit Truck(const TruckParameters& parameters);

  void set_pins(const ControllerPins& pins) { pins_ = pins; }
  void set_drive(const Drive& drive) { drive_ = drive; }
  void set_charger(const ChargerDemand& demand) { charger_ = demand; }
  /// All other batteries at the DC link together. Needs TruckParameters::in_parallel.
  void set_other_batteries(const LinkSource& source);
  /// This battery, for the circuits of the others.
  LinkSource link_source() const;
  void set_idle_w(double idle_w) { parameters_.dc_link.idle_w = idle_w; }
  void add_vdda_dip(const SupplyDip& dip) { vdda_dips_.push_back(dip); }
  void add_coil_supply_dip(const SupplyDip& dip) { coil_dips_.push_back(dip); }
  Contactor& contactor(Relay relay) { return contactors_[static_cast<std::size_t>(relay)]; }
  const Contactor& contactor(Relay relay) const { return contactors_[static_cast<std::size_t>(relay)]; }
  void break_wire(Wire wire);
  void set_precharge_ohm(double ohm);
  /// Of a truck whose string has a leak.
  void set_string_leak_ohm(double ohm);
  /// Between the battery and the frame: all leaks in parallel. While a contact joins them, those of the truck count:
  /// the capacitor of the DC link joins its poles for what a monitor measures.
  double insulation_ohm() const;
  CellString& cells() { return cells_; }

  void advance(double duration_s);

  double time_s() const { return circuit_.time_s(); }
  PinVoltages pins() const;
  TrueVoltages voltages() const;
  double current_a() const { return circuit_.current_a(network_.shunt); }
  double cell_v(std::size_t cell) const { return cells_.voltage_v(cell, circuit_.current_a(network_.string)); }
  std::size_t cell_count() const { return cells_.size(); }
  double contact_a(Relay relay) const { return circuit_.current_a(contact(relay)); }
  bool contact_closed(Relay relay) const { return circuit_.closed(contact(relay)); }
  double precharge_heat_j() const { return circuit_.heat_j(contact(Relay::precharge)); }
  double precharge_resistor_c() const { return resistor_c_; }
  const std::vector<ContactEvent>& events() const { return events_; }
  const Circuit& circuit() const { return circuit_; }

 private:
  std::size_t contact(Relay relay) const { return network_.contact[static_cast<std::size_t>(relay)]; }
  double coil_supply_v() const;
  void update_supplies(double duration_s);
  void update_drive();
  void update_charger();
  double step_limit_s(double rest_s) const;
  void update_cells(double duration_s);
  void update_resistor(double duration_s);
  void move_contacts();
  void track_peaks();

  TruckParameters parameters_;
  CellString cells_;
  Circuit circuit_;
  TruckNetwork network_;
  std::array<Contactor, relays> contactors_;
  ControllerPins pins_;
  Drive drive_;
  ChargerDemand charger_;
  LinkSource others_;
  std::vector<SupplyDip> vdda_dips_, coil_dips_;
  double vdda_v_, steady_coil_a_ = 0;
  double last_step_s_ = 0;
  double resistor_c_, counted_heat_j_ = 0;
  std::vector<ContactEvent> events_;
};

}  // namespace bms::plant
