// Random worlds: key on, precharge, drive, recuperate, charge, key off, and a restart with a charged DC link.
#include <algorithm>

#include <fmt/format.h>

#include "tests/firmware/world/promise.hpp"
#include "tests/firmware/world/scenarios.hpp"

namespace bms::world {

using plant::Relay;

namespace {

/// Stops the case: nothing that follows would mean anything.
struct Stop {};

class Start {
 public:
  Start(const Pack& pack, std::uint64_t seed, Outcome& outcome)
      : pack_(pack), world_(pack.image, random_setup(pack, seed)), outcome_(outcome) {}

  void run() {
    try {
      drives("key on");
      carries("drives", -0.6);
      carries("recuperates", 0.4);
      carries("drives again", -0.9);
      turns_off();
      charges();
      turns_off();
      restarts();
    } catch (const Stop&) {
    }
    if (const auto closings = world_.closings_below_v(closing_limit_v); !closings.empty())
      outcome_.fail(summary(world_));
    for (const std::string& violation : world_.violations()) outcome_.texts[violation] = "violation";
    double inrush_a = 0;
    for (const auto& e : world_.truck.events()) {
      if (e.closes && (e.relay == Relay::main_plus || e.relay == Relay::main_minus))
        inrush_a = std::max(inrush_a, e.peak_a);
    }
    outcome_.values["inrush"] = inrush_a;
  }

 private:
  void must(bool holds, const std::string& what) {
    if (holds) return;
    outcome_.fail(fmt::format("{} at {:.1f} s: {}", what, world_.now_s(), summary(world_)));
    throw Stop{};
  }
  void drives(const std::string& name) {
    world_.vehicle.request = Request::drive;
    const double ms = world_.run_until(
        [&] { return world_.both_mains_closed() && world_.vehicle.allowed_discharge_a() > 0; }, start_limit_ms);
    must(ms >= 0, name + ": does not drive");
    outcome_.values[name] = 1e-3 * ms;
    world_.run_ms(500);
    must(world_.both_mains_closed() && !world_.closed(Relay::precharge), name + ": does not stay closed");
  }
  void carries(const std::string& name, double share) {
    set_drive_a(world_, share * pack_.limit_a);
    world_.run_ms(3'000);
    must(world_.both_mains_closed(), name + ": opens");
    const double a = world_.truck.current_a();
    must(share < 0 ? a < 0.8 * share * pack_.limit_a : a > 0.8 * share * pack_.limit_a, name + ": no current");
  }
  void turns_off() {
    must(key_off(world_) >= 0, "key off: stays closed");
    world_.run_ms(1'500);
    must((world_.vehicle.faults_seen() >> 26 & 7) == 0, "key off: contactor fault");
  }
  void charges() {
    world_.vehicle.request = Request::charge;
    const double ms =
        world_.run_until([&] { return world_.both_mains_closed() && world_.closed(Relay::charge); }, start_limit_ms);
    must(ms >= 0, "charge: does not close");
    outcome_.values["charge"] = 1e-3 * ms;
    set_charger_a(world_, 0.5 * pack_.limit_a);
    world_.run_ms(4'000);
    must(world_.truck.current_a() > 0.3 * pack_.limit_a, "charge: no current");
  }
  /// The DC link is still charged.
  void restarts() {
    drives("restart");
    must(key_off(world_) >= 0, "key off: stays closed");
    world_.run_ms(150);
    drives("restart at once");
    set_drive_a(world_, -0.3 * pack_.limit_a);
    world_.run_ms(1'000);
    must(world_.both_mains_closed(), "restart: opens");
  }

  const Pack& pack_;
  TruckWorld world_;
  Outcome& outcome_;
};

}  // namespace

Result run_starts(const Extent& extent) {
  const Pack pack = pack_of(truck_ah, extent.cells);
  Cases cases(extent.at_once);
  extent.set(cases, "starts", pack);
  const std::size_t count = extent.count == 0 ? 50 : extent.count;
  for (std::size_t k = 0; k < count; ++k) {
    const std::uint64_t seed = extent.seed + k;
    cases.start(fmt::format("world {}", seed), [&, seed](Outcome& outcome) { Start(pack, seed, outcome).run(); });
  }
  Result result{extent.named("starts"), "", cases.finish()};
  result.table = "| what | worlds | soonest [s] | latest [s] |\n|---|---|---|---|\n";
  for (const char* what : {"key on", "charge", "restart", "restart at once"}) {
    std::vector<double> s;
    for (const Outcome& o : result.outcomes) {
      if (o.values.contains(what)) s.push_back(o.values.at(what));
    }
    if (s.empty()) s.push_back(-1);
    const auto [least, most] = std::minmax_element(s.begin(), s.end());
    result.table += fmt::format("| {} | {} | {:.1f} | {:.1f} |\n", what, *least < 0 ? 0 : s.size(), *least, *most);
  }
  double inrush_a = 0;
  std::map<std::string, int> violations;
  for (const Outcome& o : result.outcomes) {
    inrush_a = std::max(inrush_a, o.value("inrush", 0));
    for (const auto& [violation, kind] : o.texts) ++violations[violation];
  }
  result.table += fmt::format(
      "\n{} worlds, {} complete the whole sequence. Largest current at the closing of a main contact: {:.0f} A.\n",
      result.outcomes.size(), result.outcomes.size() - result.failed(), inrush_a);
  for (const auto& [violation, worlds] : violations) {
    result.table += fmt::format("\nAgainst the manual, in {} worlds: {}.\n", worlds, violation);
    result.outcomes.emplace_back().name = "violations of a manual";
    result.outcomes.back().fail(violation);
  }
  return result;
}

}  // namespace bms::world
