// A charge of the flashed image in the world of the truck, by a charger of tests/firmware/charger_models.hpp: its
// frames pass the bus of the truck or a bus of its own, and its current flows in the circuit. The truck's controller
// repeats that it asks for nothing.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>

#include <fmt/format.h>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "tests/firmware/charger_models.hpp"
#include "tests/firmware/world/cases.hpp"
#include "tests/firmware/world/operating.hpp"

namespace bms::world {

/// Bit rate of the charger's own bus, which is not that of the truck.
inline constexpr std::uint32_t own_charger_bit_rate = 125'000;
/// The image for a charger with a bus of its own.
Pack pack_with_charger_bus(const std::string& vehicle_profile);

class Charge {
 public:
  /// charger_bit_rate: of a bus of its own; 0: the charger is on the bus of the truck.
  Charge(const Pack& pack, firmware::Charger& charger, double soc, Outcome& outcome, std::uint32_t charger_bit_rate = 0)
      : charger_(charger), outcome_(outcome), world_(pack.image, setup_of(pack, soc)) {
    charger_.rated_a = pack.limit_a;
    world_.set_noise(cell_noise_v, shunt_noise_v);
    if (charger_bit_rate != 0)
      world_.fit_charger_bus(charger_bit_rate);
    else
      world_.vehicle.on_frame = [this](const can::Frame& frame) { charger_.receive(frame, world_.now_s()); };
    world_.each_step = [this] { step(); };
  }

  bool begins(double share = 0.8) {
    const double ms = world_.run_until([&] { return gives(share); }, 60'000);
    if (ms < 0) fail("no current");
    outcome_.values["closed"] = 1e-3 * ms;
    return ms >= 0;
  }
  /// Returns the seconds until the contactors are open, or a negative value.
  double opens(double within_s) {
    const double ms = world_.run_until([&] { return !world_.any_main_closed(); }, 1e3 * within_s);
    if (ms < 0) fail("stays closed");
    return 1e-3 * ms;
  }
  /// Returns the seconds until no current flows: the charger contactor is open.
  double ends(double within_s) {
    const double ms = world_.run_until([&] { return std::abs(world_.truck.current_a()) < 0.5; }, 1e3 * within_s);
    if (ms < 0) fail("goes on");
    return 1e-3 * ms;
  }
  void stays_open(double for_s) {
    if (world_.run_until([&] { return world_.any_main_closed(); }, 1e3 * for_s) >= 0) fail("closes again");
  }
  void run_s(double s) { world_.run_ms(1e3 * s); }
  bool gives(double share = 0.8) const {
    return world_.closed(plant::Relay::charge) && world_.truck.current_a() > share * charger_.rated_a;
  }
  void fail(const std::string& what) { outcome_.fail(fmt::format("{} ({})", what, summary(world_))); }
  void expect(bool good, const std::string& what) {
    if (!good) fail(what);
  }
  void no_fault() { expect(world_.vehicle.faults_seen() == 0, "a fault"); }
  void a_fault() { expect(world_.vehicle.faults_seen() != 0, "no fault is named"); }
  double soc() {
    double sum = 0;
    for (std::size_t k = 0; k < world_.truck.cell_count(); ++k) sum += world_.truck.cells().soc(k);
    return sum / static_cast<double>(world_.truck.cell_count());
  }
  void stop() { world_.board.can.others.push_back({firmware::wire_frame(can::Stop{}.frame(1)), 0, true}); }
  /// Of every case.
  void end() {
    outcome_.values["highest"] = highest_v_;
    outcome_.values["soc"] = soc();
    outcome_.texts["published"] = fault_names(world_.vehicle.faults_seen());
    for (const std::string& violation : world_.violations()) outcome_.fail(violation);
  }
  double highest_v() const { return highest_v_; }
  TruckWorld& world() { return world_; }

  bool plugged = true;
  bool on_the_wrong_bus = false;  ///< a node of the truck's bus sends what the charger would

 private:
  static constexpr double cell_noise_v = 0.0005, shunt_noise_v = 1e-6;

  static WorldSetup setup_of(const Pack& pack, double soc) {
    WorldSetup setup = typical_setup(pack);
    setup.truck.ocv_v = firmware::ocv_beyond_full();
    for (std::size_t k = 0; k < setup.truck.cells.size(); ++k)
      setup.truck.cells[k].soc = soc + 0.002 * (static_cast<double>(k % 5) - 2);
    return setup;
  }
  void step() {
    const double now_s = world_.now_s();
    world_.plugged = plugged;
    const double limit_a = plugged ? charger_.limit_a(now_s) : 0, target_v = charger_.target_v(now_s);
    world_.truck.set_charger({.on = limit_a > 0 && target_v > 0, .voltage_v = target_v, .current_a = limit_a});
    const bool connected = plugged && world_.closed(plant::Relay::charge);
    charger_.measured(world_.truck.voltages().charger_v, connected ? std::max(0.0, world_.truck.current_a()) : 0);
    if (world_.charger_bus) receive_from_own_bus();
    auto& bus = world_.charger_bus && !on_the_wrong_bus ? world_.charger_bus->can : world_.board.can;
    if (plugged) {
      for (const can::Frame& frame : charger_.send(now_s)) bus.others.push_back({firmware::wire_frame(frame), 0, true});
    }
    highest_v_ = std::max(highest_v_, world_.highest_cell_v());
  }

  void receive_from_own_bus() {
    auto& seen = world_.charger_bus->can.seen;
    for (; read_ < seen.size(); ++read_) {
      if (seen[read_].from_board) charger_.receive(seen[read_].frame, world_.now_s());
    }
  }

  firmware::Charger& charger_;
  Outcome& outcome_;
  TruckWorld world_;
  double highest_v_ = 0;
  std::size_t read_ = 0;  ///< frames of the bus of its own
};

}  // namespace bms::world
