// Overloads and short circuits of packs of several sizes: time until a main contact opens, and the cause on the bus.
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "tests/firmware/world/promise.hpp"
#include "tests/firmware/world/scenarios.hpp"

namespace bms::world {

namespace {

/// What the published table promises at a multiple of the limit: the integral of the square above 1.05 of the limit
/// with a current that is measured 1 % too low, and five seconds of grace; above five times the limit a short circuit,
/// which opens at once.
double promised_s(double factor) {
  constexpr double short_circuit = 5, heat_s = 30, from = 1.05, measured = 0.99;
  if (factor > 1.03 * short_circuit) return chain_s + contactor_s;
  const double times = measured * factor / from;
  return heat_s / (times * times - 1) + grace_s + chain_s + contactor_s;
}

void overload(TruckWorld& world, const Pack& pack, double factor, bool charges, Outcome& outcome) {
  const double begun_ms = world.now_ms(), limit_s = promised_s(factor);
  world.vehicle.forget();
  world.fine_steps(3'000, 0.5);
  set_drive_a(world, (charges ? 1 : -1) * factor * pack.limit_a);
  double largest_a = 0;
  const auto opened = [&] {
    largest_a = std::max(largest_a, std::abs(world.truck.current_a()));
    return world.isolated();
  };
  const double ms = world.run_until(opened, 1e3 * limit_s + 10'000);
  outcome.values["current"] = largest_a;
  outcome.values["times_limit"] = factor;
  outcome.values["promised"] = limit_s;
  world.run_ms(1'500);
  const std::uint64_t seen = world.vehicle.faults_seen();
  outcome.texts["published"] = fault_names(seen);
  if (ms < 0) {
    outcome.fail("does not open: " + summary(world));
  } else {
    outcome.values["opened"] = 1e-3 * (world.opened_ms() - begun_ms);
    if (world.opened_ms() - begun_ms > 1e3 * limit_s) outcome.fail("opens late: " + summary(world));
  }
  constexpr std::uint64_t contactor_faults = std::uint64_t{7} << 26;
  if ((seen & ~contactor_faults) == 0) outcome.fail("the published cause is not an overload: " + summary(world));
  // the request goes on: nothing may close again on the short circuit
  set_drive_a(world, 0);
  const std::size_t before = world.truck.events().size();
  world.run_ms(12'000);
  if (factor > 6 && world.both_mains_closed()) outcome.fail("closes again after a short circuit: " + summary(world));
  if (!world.closings_below_v(closing_limit_v, before).empty()) outcome.fail(summary(world));
}

}  // namespace

Result run_overloads(const Extent& extent) {
  Cases cases(extent.at_once);
  std::vector<Outcome> broken;
  for (const double capacity_ah : {40.0, 100.0, 200.0}) {
    Pack pack;
    try {
      pack = pack_of(capacity_ah, extent.cells);
      extent.set(cases, "overloads", pack);
      WorldSetup setup = typical_setup(pack, extent.seed);
      setup.truck.dc_link.lockout_v = 2;  // a short circuit, not a drive that gives up
      TruckWorld world(pack.image, setup);
      const std::string problem = cases.over() ? "" : bring_to(world, pack, Operating::drive);
      if (!problem.empty()) throw std::runtime_error(problem);
      for (const double factor : {1.2, 1.5, 2.0, 3.0, 4.0, 5.5, 8.0, 12.0, 20.0}) {
        for (const bool charges : {false, true}) {
          const std::string name = fmt::format("{:.0f} Ah, {} times the limit, {}", capacity_ah, factor,
                                               charges ? "recuperation" : "discharge");
          if ((charges && factor > 6) || !extent.has(name)) continue;
          if (!cases.over()) world.run_ms(31);
          cases.start(name, [&](Outcome& outcome) { overload(world, pack, factor, charges, outcome); });
        }
      }
    } catch (const std::exception& e) {
      broken.emplace_back().name = fmt::format("{:.0f} Ah", capacity_ah);
      broken.back().fail(std::string(e.what()).substr(0, 400));
      fmt::print("FAILED {}: {}\n", broken.back().name, broken.back().why);
    }
  }
  Result result{extent.named("overloads"), "", cases.finish()};
  result.table =
      "| pack and current | largest current [A] | contacts open after [s] | allowed [s] | published | "
      "|\n|---|---|---|---|---|---|\n";
  for (const Outcome& o : result.outcomes) {
    const double opened = o.value("opened", -1);
    result.table += fmt::format("| {} | {:.0f} | {} | {:.2f} | {} | {} |\n", o.name, o.value("current", 0),
                                opened < 0 ? "not" : fmt::format("{:.3f}", opened), o.value("promised", 0),
                                o.text("published"), o.good ? "" : "**deviation**");
  }
  result.outcomes.insert(result.outcomes.end(), broken.begin(), broken.end());
  return result;
}

}  // namespace bms::world
