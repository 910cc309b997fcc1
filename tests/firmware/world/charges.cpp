// Chargers of both protocols on the bus of the truck, around the images with their profiles: from 20 % to full, and
// with what goes wrong. The chargers are those of tests/firmware/charger_models.hpp; their frames pass the bus, and
// their current flows in the circuit. The truck's controller repeats that it asks for nothing.
#include "tests/firmware/world/charges.hpp"

#include <memory>

#include "tests/firmware/world/scenarios.hpp"

namespace bms::world {

namespace {

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
  for (unsigned variant = 0; variant < 4; ++variant) {
    const bool elcon = variant % 2 == 0, own_bus = variant >= 2;
    const std::string profile = elcon ? "elcon" : "cia418", named = profile + (own_bus ? " on CAN2" : "");
    const Pack pack = own_bus ? pack_with_charger_bus(profile) : pack_of(truck_ah, 16, profile);
    Cases cases(extent.at_once);
    extent.set(cases, "charges " + named, pack);
    for (const Course& course : courses) {
      const std::string name = fmt::format("{}: {}", named, course.name);
      if (!extent.has(name) || (course.of_elcon_only && !elcon)) continue;
      cases.start(name, [&](Outcome& outcome) {
        std::unique_ptr<firmware::Charger> charger;
        if (elcon)
          charger = std::make_unique<firmware::ElconCharger>();
        else
          charger = std::make_unique<firmware::CanopenCharger>();
        Charge charge(pack, *charger, course.soc, outcome, own_bus ? own_charger_bit_rate : 0);
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
