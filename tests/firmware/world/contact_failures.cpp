// Failures of contactors, coils, auxiliary contacts, the precharge resistor, fuse and wires: which fault is published,
// when, and what the failure did to the contacts.
#include <functional>

#include <fmt/format.h>

#include "tests/firmware/world/promise.hpp"
#include "tests/firmware/world/scenarios.hpp"

namespace bms::world {

using plant::AuxiliaryFault;
using plant::ContactorFault;
using plant::Relay;
using plant::Wire;

namespace {

constexpr unsigned precharge_failed = 26, welded = 27, not_closed = 28;

enum class When { before_start, while_driving, while_charging, while_idle };

/// What must follow. `found`: one of the three contactor faults is published, and a battery that cannot be connected
/// safely stays off. `drives`: the failure must not stop the truck. `either`: the failure is not visible at the wiring,
/// so both are right.
enum class Follows { found, drives, either };

struct Failure {
  std::string name;
  When when;
  Follows follows;
  std::function<void(TruckWorld&)> happens;
  std::function<void(plant::TruckParameters&)> built = {};  ///< instead: components that are wrong from the start
  std::string reason = {};                                  ///< why it cannot be found
};

std::function<void(TruckWorld&)> contact(Relay relay, ContactorFault fault) {
  return [=](TruckWorld& w) { w.truck.contactor(relay).set_fault(fault); };
}
std::function<void(TruckWorld&)> auxiliary(Relay relay, AuxiliaryFault fault) {
  return [=](TruckWorld& w) { w.truck.contactor(relay).set_auxiliary_fault(fault); };
}
std::function<void(TruckWorld&)> wire(Wire broken) {
  return [=](TruckWorld& w) { w.truck.break_wire(broken); };
}

std::vector<Failure> contactor_failures() {
  using enum When;
  using enum Follows;
  std::vector<Failure> list;
  const std::pair<Relay, const char*> named[] = {
      {Relay::main_plus, "K1"}, {Relay::main_minus, "K2"}, {Relay::precharge, "K3"}};
  for (const auto& [relay, name] : named) {
    list.push_back(
        {fmt::format("{} welded before the start", name), before_start, found, contact(relay, ContactorFault::welded)});
    list.push_back(
        {fmt::format("{} welds while driving", name), while_driving, found, contact(relay, ContactorFault::welded)});
    list.push_back({fmt::format("{} coil open before the start", name), before_start, found,
                    contact(relay, ContactorFault::open_coil)});
    list.push_back({fmt::format("{} burnt contact before the start", name), before_start, found,
                    contact(relay, ContactorFault::no_contact)});
    // the relay has opened before the truck drives, so its armature stays attracted from the next start on
    const When when = relay == Relay::precharge ? before_start : while_driving;
    list.push_back(
        {fmt::format("{} does not drop out", name), when, found, contact(relay, ContactorFault::no_drop_out)});
  }
  list.push_back(
      {"K1 coil opens while driving", while_driving, found, contact(Relay::main_plus, ContactorFault::open_coil)});
  list.push_back(
      {"K2 coil opens while driving", while_driving, found, contact(Relay::main_minus, ContactorFault::open_coil)});
  list.push_back({"K1 coil opens at standby", while_idle, found, contact(Relay::main_plus, ContactorFault::open_coil)});
  list.push_back(
      {"K2 coil opens at standby", while_idle, found, contact(Relay::main_minus, ContactorFault::open_coil)});
  list.push_back({"K1 and K2 weld while driving", while_driving, found, [](TruckWorld& w) {
                    w.truck.contactor(Relay::main_plus).set_fault(ContactorFault::welded);
                    w.truck.contactor(Relay::main_minus).set_fault(ContactorFault::welded);
                  }});
  for (const auto& [relay, name] : named) {
    list.push_back({fmt::format("{} three times as slow", name),
                    before_start,
                    either,
                    [slow = relay](TruckWorld& w) { w.truck.contactor(slow).set_slowness(3); },
                    {},
                    "slow, but it switches"});
  }
  list.push_back({"all contacts bounce for 20 ms", before_start, drives, {}, [](plant::TruckParameters& p) {
                    for (auto& relay : p.relay) relay.bounce = {0.018, 0.02};
                  }});
  list.push_back({"K4 coil open",
                  while_charging,
                  either,
                  contact(Relay::charge, ContactorFault::open_coil),
                  {},
                  "no feedback of K4"});
  list.push_back({"K4 welded, charger keeps 45 V", before_start, either, contact(Relay::charge, ContactorFault::welded),
                  [](plant::TruckParameters& p) { p.charger.idle_v = 45; }, "the charger feeds the DC link"});
  list.push_back(
      {"K4 welded, charger idle at 0 V", before_start, drives, contact(Relay::charge, ContactorFault::welded)});
  return list;
}

std::vector<Failure> other_failures() {
  using enum When;
  using enum Follows;
  std::vector<Failure> list;
  const std::pair<Relay, const char*> named[] = {{Relay::main_plus, "K1"}, {Relay::main_minus, "K2"}};
  for (const auto& [relay, name] : named) {
    list.push_back({fmt::format("auxiliary contact of {} stuck open", name), before_start, found,
                    auxiliary(relay, AuxiliaryFault::stuck_open)});
    list.push_back({fmt::format("auxiliary contact of {} stuck closed", name), before_start, found,
                    auxiliary(relay, AuxiliaryFault::stuck_closed)});
    list.push_back({fmt::format("auxiliary contact of {} opens while driving", name), while_driving, found,
                    auxiliary(relay, AuxiliaryFault::stuck_open)});
  }
  const auto resistor = [](double ohm) { return [=](TruckWorld& w) { w.truck.set_precharge_ohm(ohm); }; };
  list.push_back({"precharge resistor burnt", before_start, found, wire(Wire::precharge_resistor)});
  list.push_back({"precharge resistor shorted", before_start, found, resistor(0.05)});
  list.push_back({"precharge resistor 5 ohm", before_start, found, resistor(5)});
  list.push_back({"precharge resistor 20 ohm",
                  before_start,
                  either,
                  resistor(20),
                  {},
                  "less than half: within the range of curves"});
  list.push_back({"precharge resistor 500 ohm", before_start, found, resistor(500)});
  list.push_back({"fuse open before the start", before_start, found, wire(Wire::fuse)});
  list.push_back({"fuse opens while driving", while_driving, found, wire(Wire::fuse)});
  list.push_back({"wire of LD broken", before_start, drives, wire(Wire::ld)});
  list.push_back(
      {"wire of PACK broken", before_start, either, wire(Wire::pack), {}, "the pack is measured at its cells, too"});
  list.push_back({"wire of the divider at L+ broken", before_start, found, wire(Wire::plus_divider)});
  list.push_back({"wire of the divider at L- broken", before_start, found, wire(Wire::minus_divider)});
  list.push_back({"divider at L+ breaks while driving", while_driving, found, wire(Wire::plus_divider)});
  list.push_back({"divider at L- breaks while driving",
                  while_driving,
                  either,
                  wire(Wire::minus_divider),
                  {},
                  "its pin shows 1.65 V, nearly the value of a closed K2"});
  list.push_back({"load of 30 W during precharge", before_start, found, {}, [](plant::TruckParameters& p) {
                    p.dc_link.idle_w = 30;
                    p.dc_link.idle_from_v = 9;
                  }});
  list.push_back({"DC link shorted by 10 ohm", before_start, found, {}, [](plant::TruckParameters& p) {
                    p.dc_link.bleeder_ohm = 10;
                  }});
  list.push_back({"capacitor five times as large",
                  before_start,
                  either,
                  {},
                  [](plant::TruckParameters& p) { p.dc_link.capacitance_f *= 5; },
                  "slow, within the time limit or not"});
  list.push_back({"capacitor missing",
                  before_start,
                  either,
                  {},
                  [](plant::TruckParameters& p) { p.dc_link.capacitance_f = 1e-5; },
                  "too fast, but no inrush"});
  return list;
}

class FailureCase {
 public:
  FailureCase(const Pack& pack, const Failure& failure, const WorldSetup& setup, Outcome& outcome)
      : pack_(pack),
        failure_(failure),
        world_(pack.image, setup),
        judge_(world_, rows(pack), pack.limit_a),
        outcome_(outcome) {
    judge_.allowed = ~std::uint64_t{0};
    world_.each_step = [this] { judge_.step(); };
  }

  void run() {
    if (!prepare()) return;
    happened_ms_ = world_.now_ms();
    world_.vehicle.forget();
    if (failure_.happens) failure_.happens(world_);
    if (failure_.when == When::before_start) world_.vehicle.request = Request::drive;
    world_.run_ms(12'000);
    drove_ = driven_closed();
    key_off(world_, 3'000);
    world_.run_ms(8'000);
    // a second attempt, as a driver does it
    world_.vehicle.request = Request::drive;
    world_.run_ms(9'000);
    drives_again_ = driven_closed();
    judge();
  }

 private:
  static std::vector<Row> rows(const Pack& pack) {
    return promised_rows(BMS_SOURCE_DIR "/firmware/protection/README.md", pack.capacity_ah / printed_ah, pack.cells);
  }

  /// Closed by the outputs, and not by a weld.
  bool driven_closed() const {
    const auto high = [&](Relay relay) { return world_.pin(relay) == Level::high; };
    return world_.both_mains_closed() && high(Relay::main_plus) && high(Relay::main_minus);
  }

  bool prepare() {
    if (failure_.when == When::before_start) {
      world_.run_ms(300);
      return true;
    }
    Operating state = Operating::drive;
    if (failure_.when == When::while_charging) state = Operating::charge;
    if (failure_.when == When::while_idle) state = Operating::standby;
    const std::string problem = bring_to(world_, pack_, state);
    if (!problem.empty()) outcome_.fail(problem);
    return problem.empty();
  }

  void judge() {
    const std::uint64_t seen = world_.vehicle.faults_seen();
    double first_ms = -1;
    for (const unsigned bit : {precharge_failed, welded, not_closed}) {
      const double ms = world_.vehicle.raised_ms(bit, happened_ms_);
      if (ms >= 0 && (first_ms < 0 || ms < first_ms)) first_ms = ms;
    }
    outcome_.texts["published"] = fault_names(seen);
    outcome_.texts["reason"] = failure_.reason;
    outcome_.values["drove"] = drove_;
    outcome_.values["drives again"] = drives_again_;
    if (first_ms >= 0) outcome_.values["after"] = 1e-3 * (first_ms - happened_ms_);
    outcome_.values["resistor"] = world_.truck.precharge_resistor_c();
    const auto closings = world_.closings_below_v(closing_limit_v);
    outcome_.values["bad closings"] = static_cast<double>(closings.size());
    if (!closings.empty()) outcome_.fail(summary(world_));
    if (failure_.follows == Follows::found && first_ms < 0) outcome_.fail("not found: " + summary(world_));
    if (failure_.follows == Follows::found && drives_again_)
      outcome_.fail("drives again with the failure: " + summary(world_));
    if (failure_.follows == Follows::drives && (!drove_ || !drives_again_))
      outcome_.fail("does not drive: " + summary(world_));
    for (const std::string& finding : judge_.findings()) outcome_.fail(finding);
  }

  const Pack& pack_;
  const Failure& failure_;
  TruckWorld world_;
  Judge judge_;
  Outcome& outcome_;
  double happened_ms_ = 0;
  bool drove_ = false, drives_again_ = false;
};

}  // namespace

Result run_contact_failures(const Extent& extent) {
  const Pack pack = pack_of(extent.capacity_ah, extent.cells);
  std::vector<Failure> failures = contactor_failures();
  for (Failure& failure : other_failures()) failures.push_back(std::move(failure));
  Cases cases(extent.at_once);
  extent.set(cases, "contacts", pack);
  for (const Failure& failure : failures) {
    if (!extent.has(failure.name)) continue;
    WorldSetup setup = typical_setup(pack, extent.seed);
    if (failure.built) failure.built(setup.truck);
    cases.start(failure.name, [&, setup](Outcome& outcome) { FailureCase(pack, failure, setup, outcome).run(); });
  }
  Result result{extent.named("contact failures"), "", cases.finish()};
  result.table =
      "| failure | published faults | first contactor fault after [s] | drove | again | remark "
      "|\n|---|---|---|---|---|---|\n";
  for (const Outcome& o : result.outcomes) {
    const double after = o.value("after", -1);
    result.table +=
        fmt::format("| {} | {} | {} | {} | {} | {} |\n", o.name, o.text("published"),
                    after < 0 ? "-" : fmt::format("{:.2f}", after), o.value("drove", 0) > 0 ? "yes" : "no",
                    o.value("drives again", 0) > 0 ? "yes" : "no", o.good ? o.text("reason") : "**deviation**");
  }
  return result;
}

}  // namespace bms::world
