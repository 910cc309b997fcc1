// Chargers of both protocols on the bus of the truck, around the images with their profiles: from 20 % to full, and
// with what goes wrong. The chargers are those of tests/firmware/charger_models.hpp; their frames pass the bus, and
// their current flows in the circuit. The truck's controller repeats that it asks for nothing.
#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "tests/firmware/charger_models.hpp"
#include "tests/firmware/world/scenarios.hpp"

namespace bms::world {

namespace {

using plant::Relay;

class Charge {
 public:
  Charge(const Pack& pack, firmware::Charger& charger, double soc, Outcome& outcome)
      : charger_(charger), outcome_(outcome), world_(pack.image, setup_of(pack, soc)) {
    charger_.rated_a = pack.limit_a;
    world_.set_noise(cell_noise_v, shunt_noise_v);
    world_.vehicle.on_frame = [this](const can::Frame& frame) { charger_.receive(frame, world_.now_s()); };
    world_.each_step = [this] { step(); };
  }

  bool begins() {
    const double ms = world_.run_until([&] { return gives(); }, 60'000);
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
  bool gives() const { return world_.closed(Relay::charge) && world_.truck.current_a() > 0.8 * charger_.rated_a; }
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

  bool plugged = true;

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
    const bool connected = plugged && world_.closed(Relay::charge);
    charger_.measured(world_.truck.voltages().charger_v, connected ? std::max(0.0, world_.truck.current_a()) : 0);
    if (plugged) {
      for (const can::Frame& frame : charger_.send(now_s))
        world_.board.can.others.push_back({firmware::wire_frame(frame), 0, true});
    }
    highest_v_ = std::max(highest_v_, world_.highest_cell_v());
  }

  firmware::Charger& charger_;
  Outcome& outcome_;
  TruckWorld world_;
  double highest_v_ = 0;
};

constexpr double upper_limit_v = 3.65, severe_v = 3.815;

void to_full(Charge& charge, firmware::Charger&, Outcome& outcome) {
  if (!charge.begins()) return;
  outcome.values["ended"] = charge.opens(2 * 3'600);
  charge.expect(charge.soc() > 0.97 && charge.soc() < 1.03, "not full");
  charge.expect(charge.highest_v() < upper_limit_v, "above the limit of a cell");
  charge.no_fault();
  charge.stays_open(120);  // still plugged in: the charge is over
}

void lost_frames(Charge& charge, firmware::Charger& charger, Outcome&) {
  if (!charge.begins()) return;
  for (int k = 0; k < 10; ++k) {  // two of three
    charger.silent = true;
    charge.run_s(2.5);
    charger.silent = false;
    charge.run_s(0.6);
    if (!charge.gives()) return charge.fail(fmt::format("ends with lost frames {}", k));
  }
  charge.no_fault();
}

void plug_drawn(Charge& charge, firmware::Charger&, Outcome& outcome) {
  if (!charge.begins()) return;
  charge.plugged = false;
  outcome.values["ended"] = charge.opens(10);
  charge.stays_open(10);
  charge.no_fault();
  charge.plugged = true;
  charge.begins();
}

void silent_and_goes_on(Charge& charge, firmware::Charger& charger, Outcome& outcome) {
  if (!charge.begins()) return;
  charger.silent = charger.deaf = charger.ignores_limit = true;
  outcome.values["ended"] = charge.opens(80);
  charge.stays_open(10);
}

void stopped(Charge& charge, firmware::Charger& charger, Outcome& outcome) {
  if (!charge.begins()) return;
  charge.stop();
  outcome.values["ended"] = charge.opens(10);
  charge.stays_open(20);  // its frames go on
  charge.no_fault();
  charger.silent = true;
  charge.run_s(5);
  charger.silent = false;
  charge.begins();
}

void too_high_a_voltage(Charge& charge, firmware::Charger& charger, Outcome& outcome) {
  charger.own_target_v = 70;
  if (!charge.begins()) return;
  outcome.values["ended"] = charge.opens(3'600);
  charge.expect(charge.highest_v() < upper_limit_v + 0.01, "above the limit of a cell");
  charge.stays_open(20);
}

void ignores_the_limit(Charge& charge, firmware::Charger& charger, Outcome& outcome) {
  charger.own_target_v = 70;
  charger.ignores_limit = true;
  if (!charge.begins()) return;
  outcome.values["ended"] = charge.ends(3'600);
  charge.expect(charge.highest_v() < severe_v, "above the severe limit of a cell");
  charge.a_fault();
}

/// Only the protocol in which a charger says its voltage.
void another_battery(Charge& charge, firmware::Charger& charger, Outcome& outcome) {
  if (!charge.begins()) return;
  charger.reported_v = 26.5;
  outcome.values["ended"] = charge.opens(30);
  charger.reported_v.reset();
  charge.stays_open(20);
  charge.no_fault();
}

struct Course {
  const char* name;
  double soc;
  void (*run)(Charge&, firmware::Charger&, Outcome&);
  bool of_elcon_only = false;
};
constexpr Course courses[] = {{"from 20 % to full", 0.2, to_full},
                              {"from 90 % to full", 0.9, to_full},
                              {"two of three frames are lost", 0.5, lost_frames},
                              {"the plug is drawn and put in again", 0.5, plug_drawn},
                              {"silent, and goes on", 0.5, silent_and_goes_on},
                              {"a stop", 0.5, stopped},
                              {"holds 70 V", 0.94, too_high_a_voltage},
                              {"holds 70 V and ignores the limit", 0.94, ignores_the_limit},
                              {"reports 26.5 V", 0.5, another_battery, true}};

std::string row_of(const Outcome& o) {
  const auto number = [&](const char* name, int digits) {
    const double value = o.value(name, -1);
    return value < 0 ? std::string("-") : fmt::format("{:.{}f}", value, digits);
  };
  return fmt::format("| {} | {} | {} | {:.1f} % | {} | {} | {} |\n", o.name, number("closed", 1), number("ended", 1),
                     100 * o.value("soc", 0), number("highest", 3), o.text("published"), o.why);
}

}  // namespace

Result run_charges(const Extent& extent) {
  Result result{
      "charges",
      "| charger | current after [s] | open again after [s] | charge at the end | highest cell [V] | published "
      "| |\n|---|---|---|---|---|---|---|\n",
      {}};
  for (const bool elcon : {true, false}) {
    const char* profile = elcon ? "elcon" : "cia418";
    const Pack pack = pack_of(truck_ah, 16, profile);
    Cases cases(extent.at_once);
    extent.set(cases, std::string("charges ") + profile, pack);
    for (const Course& course : courses) {
      const std::string name = fmt::format("{}: {}", profile, course.name);
      if (!extent.has(name) || (course.of_elcon_only && !elcon)) continue;
      cases.start(name, [&](Outcome& outcome) {
        std::unique_ptr<firmware::Charger> charger;
        if (elcon)
          charger = std::make_unique<firmware::ElconCharger>();
        else
          charger = std::make_unique<firmware::CanopenCharger>();
        Charge charge(pack, *charger, course.soc, outcome);
        course.run(charge, *charger, outcome);
        charge.end();
      });
    }
    for (const Outcome& o : cases.finish()) result.outcomes.push_back(o);
  }
  for (const Outcome& o : result.outcomes) result.table += row_of(o);
  return result;
}

}  // namespace bms::world
