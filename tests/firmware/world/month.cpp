// Ordinary days of a truck: three shifts a day, with what drivers, converters and chargers do to it. After each event
// the truck has to drive or charge again, by itself or with the driver's next key-on. No workshop comes.
//
// A shift is as short as its events allow: a minute of driving, and some seconds where a truck is parked for hours.
#include <algorithm>
#include <cmath>
#include <functional>

#include <fmt/format.h>

#include "tests/firmware/world/promise.hpp"
#include "tests/firmware/world/scenarios.hpp"

namespace bms::world {

namespace {

using plant::Relay;

/// Events, and how a truck has come through them.
struct Tally {
  double met = 0, alone = 0, next_key = 0, locked = 0;
};

class Days {
 public:
  Days(const Pack& pack, std::uint64_t seed, Outcome& outcome)
      : pack_(pack),
        setup_(random_setup(pack, seed)),
        world_(pack.image, setup_),
        judge_(world_,
               promised_rows(BMS_SOURCE_DIR "/firmware/protection/README.md", truck_ah / printed_ah, pack.cells),
               pack.limit_a),
        random_(seed + 11),
        outcome_(outcome) {
    world_.set_noise(cell_noise_v, shunt_noise_v);
    world_.make_late(latest_ms);
    world_.each_step = [this] { judge_.step(); };
  }

  void run(std::size_t days) {
    for (std::size_t shift = 0; shift < days * shifts_a_day && outcome_.good; ++shift) {
      world_.run_ms(1e3 * between(2, 15));
      if (start()) work(between(10, 40));
      if (outcome_.good) turn_off();
      if (outcome_.good && (world_.truck.cells().soc(0) < 0.4 || chance(0.4))) charge();
      check();
      if (shift % shifts_a_day == shifts_a_day - 1) outcome_.values["days"] += 1;
    }
    outcome_.values["hours"] = world_.now_s() / 3'600;
    for (const auto& [name, t] : tallies_) {
      outcome_.values["met " + name] = t.met;
      outcome_.values["alone " + name] = t.alone;
      outcome_.values["key " + name] = t.next_key;
      outcome_.values["locked " + name] = t.locked;
    }
  }

 private:
  static constexpr double cell_noise_v = 0.0015, shunt_noise_v = 5e-6, latest_ms = 5;
  static constexpr int shifts_a_day = 3;
  /// The driver waits so long before the key is turned again: the precharge resistor cools for ten seconds.
  static constexpr double key_pause_ms = 13'000;

  // Faults that an event may cause: they say what it was.
  static constexpr std::uint64_t precharge_failed = 1ULL << 26, not_closed = 1ULL << 28, samples_missing = 1ULL << 29,
                                 unrequested = 1ULL << 36, dip_of_supply = 1ULL << 41;

  double between(double least, double most) { return least + random_.uniform() * (most - least); }
  bool chance(double share) { return random_.uniform() < share; }
  bool closed() const { return world_.both_mains_closed(); }
  bool charges() const { return closed() && world_.closed(Relay::charge); }

  // ---- events ----

  void begin(const std::string& event, std::uint64_t causes) {
    ++tallies_[event].met;
    event_ = event;
    causes_ = causes;
    coils_may_fail_ = false;
    judge_.allowed |= causes;
    world_.vehicle.forget();
  }

  /// Judges an event: `works` holds again, or holds after the next key-on. A truck that had to open has said why.
  void end(Request wanted, const std::function<bool()>& works, double by_itself_ms) {
    Tally& t = tallies_[event_];
    if (world_.run_until(works, by_itself_ms) >= 0) {
      ++t.alone;
    } else {
      const bool coils = coils_may_fail_ && world_.vehicle.coils_dead_seen();
      if ((world_.vehicle.faults_seen() & causes_) == 0 && !coils) fail("opens and does not say why");
      set_drive_a(world_, 0);
      set_charger_a(world_, 0);
      world_.vehicle.request = Request::none;
      world_.run_ms(key_pause_ms);
      world_.vehicle.request = wanted;
      if (world_.run_until(works, start_limit_ms) >= 0) {
        ++t.next_key;
      } else {
        ++t.locked;
        fail("locked out");
      }
    }
    world_.run_ms(300);
    if (world_.vehicle.faults() == 0) judge_.allowed = 0;
  }

  void fail(const std::string& what) { outcome_.fail(fmt::format("{}: {}: {}", event_, what, summary(world_))); }

  /// The loss of the coils' supply is a state and no fault: TruckInputs says it.
  void stop_for_an_emergency(double within_ms, double least_s, double most_s) {
    coils_may_fail_ = true;
    world_.dip_coil_supply(within_ms * random_.uniform() + 1, 1e3 * between(least_s, most_s),
                           setup_.truck.supply.coil_v);
  }

  /// Of the controller or of the coils, as in the scenario of the dips. Returns its duration in ms.
  double dip() {
    const double ms = std::pow(200.0, random_.uniform()), share = random_.uniform();
    const double vdda_v = setup_.truck.supply.vdda_v, least_v = vdda_v - 2.95;
    coils_may_fail_ = chance(0.4);
    if (coils_may_fail_)
      world_.dip_coil_supply(1, ms, setup_.truck.supply.coil_v * (0.2 + 0.8 * share));
    else
      world_.dip_vdda(1, ms, least_v + share * share * (vdda_v - least_v));
    return ms;
  }

  // ---- a shift ----

  /// Key on. Returns true if the truck drives.
  bool start() {
    const double which = random_.uniform();
    if (which < 0.15) {
      begin("emergency stop pressed at key-on", precharge_failed | not_closed);
      stop_for_an_emergency(1, 3, 15);
    } else if (which < 0.3) {
      begin("load of 20 to 60 W during precharge", precharge_failed);
      world_.truck.set_idle_w(between(20, 60));
    } else if (which < 0.45) {
      begin("dip of a supply at key-on", precharge_failed | not_closed | samples_missing | dip_of_supply);
    } else {
      begin("key on", 0);
    }
    world_.vehicle.request = Request::drive;
    if (which >= 0.3 && which < 0.45) {
      world_.run_ms(between(0, 4'000));
      world_.run_ms(dip() + 100);
    }
    if (which < 0.3) {
      world_.run_until([&] { return closed() || world_.vehicle.faults() != 0; }, 8'000);
      if (which < 0.15) world_.run_ms(15'000);
    }
    const bool loaded = which >= 0.15 && which < 0.3 && !closed();
    if (loaded) world_.truck.set_idle_w(setup_.truck.dc_link.idle_w);  // the driver switches the display off
    end(
        Request::drive, [&] { return closed(); }, loaded ? 100 : 8'000);
    world_.truck.set_idle_w(setup_.truck.dc_link.idle_w);
    return closed();
  }

  /// The drive's controller obeys the allowed current of a second ago.
  void work(double seconds) {
    const double event_s = between(0, 1.6 * seconds);
    bool met = false;
    double wish = 0, wish_ends_s = 0, allowed_a[2] = {0, 0};
    for (double s = 0; s < seconds && outcome_.good; s += 0.5) {
      if (s >= wish_ends_s) {
        wish = chance(0.25) ? between(0, 0.5) : -between(0, 1);
        wish_ends_s = s + between(0.5, 12);
      }
      const double most_a = std::min(pack_.limit_a, allowed_a[wish > 0 ? 0 : 1]);
      set_drive_a(world_, 0.95 * wish * most_a);
      allowed_a[0] = world_.vehicle.allowed_charge_a();
      allowed_a[1] = world_.vehicle.allowed_discharge_a();
      world_.set_temperature(static_cast<std::size_t>(4 * random_.uniform()), 25 + between(-0.2, 0.2));
      world_.run_ms(500);
      if (!met && s >= event_s) {
        met = true;
        disturb();
        allowed_a[0] = allowed_a[1] = 0;
      }
      if (outcome_.good && !closed()) {
        event_ = "drive";
        fail("opens");
      }
    }
  }

  void disturb() {
    const double which = random_.uniform();
    if (which < 0.4) {
      begin("emergency stop pressed in drive", not_closed);
      stop_for_an_emergency(1, 0.1, 12);
      world_.run_ms(1'500);
      end(
          Request::drive, [&] { return closed(); }, 14'000);
    } else if (which < 0.8) {
      begin("dip of a supply in drive", precharge_failed | not_closed | samples_missing | dip_of_supply);
      const double ms = dip();
      world_.run_ms(ms + 100);
      end(
          Request::drive, [&] { return closed(); }, 8'000);
    } else {
      begin("charger plugged in while driving", 0);
      world_.vehicle.request = Request::charge;
      world_.run_ms(between(200, 1'000));
      set_drive_a(world_, 0);
      end(
          Request::charge, [&] { return charges(); }, 20'000);
      set_charger_a(world_, 0.5 * pack_.limit_a);
      world_.run_ms(between(500, 5'000));
      set_charger_a(world_, 0);
      world_.vehicle.request = Request::drive;
      world_.run_ms(1'500);  // until the contactors have opened
      if (world_.run_until([&] { return closed() && !world_.closed(Relay::charge); }, start_limit_ms) < 0)
        fail("does not drive after the charge");
    }
  }

  /// With a converter or a fan that runs on: the contactors open after a minute, and the fault ends by itself.
  void turn_off() {
    const double standby_a = chance(0.4) && closed() ? between(5, 10) : 0;
    begin(standby_a > 0 ? "key off with 5 to 10 A that flow on" : "key off", standby_a > 0 ? unrequested : 0);
    if (standby_a > 0) {  // flows before the key is turned, too
      set_drive_a(world_, -standby_a);
      world_.run_ms(500);
    }
    if (key_off(world_, standby_a > 0 ? 70'000 : 8'000, standby_a) < 0) fail("stays closed");
    set_drive_a(world_, 0);
    if (standby_a > 0 && (world_.vehicle.faults_seen() & unrequested) == 0) fail("opens and does not say why");
    ++tallies_[event_].alone;
    world_.run_ms(1e3 * between(0.5, 3));
    if (world_.run_until([&] { return world_.vehicle.faults() == 0; }, 15'000) < 0) fail("the fault stays");
    judge_.allowed = 0;
  }

  void charge() {
    const double which = random_.uniform();
    if (which < 0.25) {
      begin("charger plugged in and out at any moment", 0);
      for (int k = 0; k < 3; ++k) {
        world_.vehicle.request = k == 1 ? Request::drive : Request::charge;
        world_.run_ms(between(50, 4'000));
        if (charges()) set_charger_a(world_, 0.4 * pack_.limit_a);
        world_.run_ms(between(50, 2'000));
        set_charger_a(world_, 0);
        world_.vehicle.request = Request::none;
        world_.run_ms(between(0, 800));
      }
    } else {
      begin("charge", 0);
    }
    world_.vehicle.request = Request::charge;
    world_.run_ms(1'500);  // what is still closed from the request before has opened
    end(
        Request::charge, [&] { return charges(); }, 20'000);
    charge_for(between(5, 40));
    if (outcome_.good) unplug();
  }

  void charge_for(double seconds) {
    for (double s = 0; s < seconds && outcome_.good; s += 1) {
      set_charger_a(world_, 0.9 * std::min(pack_.limit_a, world_.vehicle.allowed_charge_a()));
      world_.run_ms(1'000);
      if (!closed()) fail("opens while charging");
    }
  }

  void unplug() {
    const bool before = chance(0.5);
    begin(before ? "charger switched off before the plug is drawn" : "plug drawn while charging", 0);
    set_charger_a(world_, 0);
    if (before) world_.run_ms(1e3 * between(0.1, 8));
    world_.vehicle.request = Request::none;
    if (world_.run_until([&] { return !world_.any_main_closed(); }, 8'000) < 0) fail("stays closed");
    ++tallies_[event_].alone;
    world_.run_ms(1'000);
  }

  void check() {
    for (const std::string& finding : judge_.findings()) outcome_.fail(finding);
    if (!world_.closings_below_v(closing_limit_v).empty()) {
      outcome_.values["unsafe"] += 1;
      outcome_.fail(summary(world_));
    }
    if (world_.vehicle.silent_ms() > 1'000) outcome_.fail("no Faults message for a second");
    outcome_.values["wrong faults"] = judge_.falsely();
  }

  const Pack& pack_;
  WorldSetup setup_;
  TruckWorld world_;
  Judge judge_;
  plant::Random random_;
  Outcome& outcome_;
  std::map<std::string, Tally> tallies_;
  std::string event_;
  std::uint64_t causes_ = 0;
  bool coils_may_fail_ = false;
};

std::string table_of(const Result& result) {
  std::map<std::string, Tally> all;
  double days = 0, hours = 0, unsafe = 0, wrong = 0;
  for (const Outcome& o : result.outcomes) {
    days += o.value("days", 0);
    hours += o.value("hours", 0);
    unsafe += o.value("unsafe", 0);
    wrong += o.value("wrong faults", 0);
    for (const auto& [name, value] : o.values) {
      if (name.rfind("met ", 0) != 0) continue;
      const std::string event = name.substr(4);
      Tally& t = all[event];
      t.met += value;
      t.alone += o.value("alone " + event, 0);
      t.next_key += o.value("key " + event, 0);
      t.locked += o.value("locked " + event, 0);
    }
  }
  std::string table =
      "| event | met | goes on by itself | with the next key-on | locked out |\n"
      "|---|---|---|---|---|\n";
  for (const auto& [event, t] : all)
    table += fmt::format("| {} | {} | {} | {} | {} |\n", event, t.met, t.alone, t.next_key, t.locked);
  return table + fmt::format(
                     "\n{} trucks, {:.0f} days of three shifts, {:.1f} simulated hours: {} unsafe closings, {} wrong "
                     "faults, {} trucks with a failure of any kind.\n",
                     result.outcomes.size(), days, hours, unsafe, wrong, result.failed());
}

}  // namespace

Result run_month(const Extent& extent) {
  const Pack pack = pack_of(truck_ah, extent.cells);
  Cases cases(extent.at_once);
  extent.set(cases, fmt::format("month_{}", extent.days), pack);
  const std::size_t trucks = extent.count == 0 ? 20 : extent.count;
  for (std::size_t k = 0; k < trucks; ++k) {
    const std::uint64_t seed = extent.seed + k;
    cases.start(fmt::format("truck {}", seed),
                [&, seed](Outcome& outcome) { Days(pack, seed, outcome).run(extent.days); });
  }
  Result result{extent.named("month"), "", cases.finish()};
  result.table = table_of(result);
  return result;
}

}  // namespace bms::world
