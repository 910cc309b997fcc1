// Dips of the controller's supply and of the coils' supply at random times, in every state. No main contact may close
// on a DC link far below the pack, neither at once nor at the next start.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "tests/firmware/world/scenarios.hpp"

namespace bms::world {

namespace {

constexpr double restarted_share = 0.35;

struct Dip {
  bool coils = false;
  double duration_ms = 0, depth_v = 0;
};

/// Of VDDA: from just below the detector's threshold to nothing. Of the coils: of any depth.
Dip random_dip(plant::Random& random, const TruckWorld& world, double coil_v) {
  Dip dip;
  dip.coils = random.uniform() < 0.4;
  dip.duration_ms = std::pow(200.0, random.uniform());
  const double vdda_v = world.truck.pins().vdda_v;
  const double least_v = vdda_v - 2.95, share = random.uniform();
  dip.depth_v = dip.coils ? coil_v * (0.2 + 0.8 * share) : least_v + share * share * (vdda_v - least_v);
  return dip;
}

/// The driver turns the key, and the truck is to drive again without a clear command.
void restart(TruckWorld& world, Outcome& outcome) {
  set_drive_a(world, 0);
  set_charger_a(world, 0);
  world.vehicle.request = Request::none;
  world.run_until([&] { return !world.any_main_closed(); }, 2'500);
  world.run_ms(300);
  const auto ready = [&] { return world.vehicle.faults() == 0 && world.vehicle.state() == 0; };
  world.run_until(ready, 16'000);
  world.vehicle.request = Request::drive;
  const double ms = world.run_until([&] { return world.both_mains_closed(); }, 12'000);
  if (ms < 0) outcome.fail("does not drive again: " + summary(world));
  world.run_ms(200);
  outcome.values["restarted"] = 1;
}

/// The request goes on for four seconds after the dip.
void survive(TruckWorld& world, const Dip& dip, bool restarts, Outcome& outcome) {
  const std::size_t before = world.truck.events().size();
  const double start_ms = world.now_ms();
  if (dip.coils) {
    world.dip_coil_supply(0.5, dip.duration_ms, dip.depth_v);
  } else {
    world.dip_vdda(0.5, dip.duration_ms, dip.depth_v);
  }
  world.run_ms(dip.duration_ms + 300);
  world.run_until([&] { return world.both_mains_closed(); }, 3'700);
  world.run_ms(200);
  outcome.values["state after"] = world.vehicle.state();
  outcome.values["resets"] = static_cast<double>(world.board.resets.size());
  if (restarts) restart(world, outcome);
  int below = 0, above = 0;
  for (const auto& closing : world.closings_below_v(closing_limit_v, before)) {
    ++(closing.dc_link_v < world.pack_v() ? below : above);
  }
  outcome.values["below"] = below;
  outcome.values["above"] = above;
  if (below + above > 0) {
    outcome.fail(fmt::format("{} dip of {:.1f} ms by {:.2f} V at {:.1f} ms: {}", dip.coils ? "coil" : "VDDA",
                             dip.duration_ms, dip.depth_v, start_ms, summary(world)));
  }
  outcome.values["faults"] = static_cast<double>(world.vehicle.faults_seen());
}

/// One run of a truck through all states, with dips at random times in copies of it.
class Timeline {
 public:
  Timeline(const Pack& pack, std::uint64_t seed, std::size_t dips, Cases& cases)
      : pack_(pack),
        setup_(random_setup(pack, seed)),
        world_(pack.image, setup_),
        random_(seed + 99),
        dips_(dips),
        cases_(cases) {}

  /// Returns why the run had to end, or "".
  std::string run() {
    world_.run_ms(100);
    world_.vehicle.request = Request::drive;
    pass("start", 700, share(12));
    const auto closed = [&] { return world_.both_mains_closed(); };
    pass_until("self-test and precharge", closed, 50);
    if (!closed()) return summary(world_);
    pass("main contactors close", 200, share(8));
    set_drive_a(world_, -0.5 * pack_.limit_a);
    pass("drive", 2'000, share(10));
    set_drive_a(world_, 0.4 * pack_.limit_a);
    pass("recuperation", 1'500, share(6));
    set_drive_a(world_, 0);
    world_.vehicle.request = Request::none;
    pass("key off", 1'500, share(8));
    world_.vehicle.request = Request::charge;
    pass_until("precharge for charging", closed, 30);
    if (!closed()) return summary(world_);
    set_charger_a(world_, 0.5 * pack_.limit_a);
    pass("charge", 2'000, dips_ - started_);
    return "";
  }

 private:
  void dip(const std::string& state) {
    if (started_ >= dips_) return;
    const Dip falls = random_dip(random_, world_, setup_.truck.supply.coil_v);
    const bool restarts = random_.uniform() < restarted_share;
    cases_.start(fmt::format("{} {} {}", state, setup_.seed, started_++), [&](Outcome& outcome) {
      outcome.texts["state"] = state;
      outcome.values["coils"] = falls.coils;
      outcome.values["world"] = static_cast<double>(setup_.seed);
      survive(world_, falls, restarts, outcome);
    });
  }
  /// weight: number of dips in this state of 132 altogether
  double part(int weight) const { return static_cast<double>(dips_) * weight / 132; }
  std::size_t share(int weight) { return static_cast<std::size_t>(part(weight) + random_.uniform()); }
  void pass(const std::string& state, double ms, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) {
      world_.run_ms(ms / static_cast<double>(count) * random_.uniform() * 2);
      dip(state);
    }
    if (count == 0) world_.run_ms(ms);
  }
  /// The time that it takes is not known before: the dips are this far apart, and fewer if it is short.
  void pass_until(const std::string& state, const std::function<bool()>& holds, int weight) {
    const double apart_ms = 4'000 / std::max(1.0, part(weight));
    std::size_t left = share(weight);
    for (double passed_ms = 0; !holds() && passed_ms < start_limit_ms;) {
      const double ms = apart_ms * random_.uniform() * 2;
      world_.run_until(holds, ms);
      passed_ms += ms;
      if (left > 0) dip(state);
      left -= left > 0 ? 1 : 0;
    }
  }

  const Pack& pack_;
  WorldSetup setup_;
  TruckWorld world_;
  plant::Random random_;
  std::size_t dips_, started_ = 0;
  Cases& cases_;
};

/// Number of good outcomes in a world.
std::size_t good_in(const std::vector<Outcome>& outcomes, std::uint64_t seed) {
  const auto is_it = [&](const Outcome& o) { return o.good && o.value("world", 0) == static_cast<double>(seed); };
  return static_cast<std::size_t>(std::count_if(outcomes.begin(), outcomes.end(), is_it));
}

}  // namespace

Result run_supply_dips(const Extent& extent) {
  const Pack pack = pack_of(truck_ah, extent.cells);
  const std::size_t count = extent.count == 0 ? 1'000 : extent.count, worlds = std::max<std::size_t>(1, count / 50);
  Cases cases(extent.at_once);
  extent.set(cases, fmt::format("dips_{}", count / worlds), pack);
  const std::vector<Outcome> earlier = cases.all_kept();
  std::vector<Outcome> broken;
  for (std::size_t k = 0; k < worlds && !cases.over(); ++k) {
    const std::size_t dips = count / worlds;
    if (cases.elsewhere(dips) || good_in(earlier, extent.seed + k) == dips) {
      cases.leave_out(dips);
      continue;
    }
    const std::string problem = Timeline(pack, extent.seed + k, dips, cases).run();
    if (problem.empty()) continue;
    broken.emplace_back().name = fmt::format("world {}", extent.seed + k);
    broken.back().fail(problem);
    fmt::print("FAILED {}: {}\n", broken.back().name, problem);
  }
  Result result{extent.named("supply dips"), "", cases.finish()};
  if (!cases.kept.empty()) result.outcomes = cases.all_kept();
  struct Line {
    int dips = 0, coils = 0, resets = 0, below = 0, above = 0, restarts = 0, stuck = 0;
  };
  std::map<std::string, Line> lines;
  for (const Outcome& o : result.outcomes) {
    Line& line = lines[o.text("state")];
    ++line.dips;
    line.coils += o.value("coils", 0) > 0 ? 1 : 0;
    line.resets += o.value("resets", 0) > 0 ? 1 : 0;
    line.below += o.value("below", 0) > 0 ? 1 : 0;
    line.above += o.value("above", 0) > 0 ? 1 : 0;
    line.restarts += o.value("restarted", 0) > 0 ? 1 : 0;
    line.stuck += !o.good && o.value("below", 0) + o.value("above", 0) == 0 ? 1 : 0;
  }
  result.table =
      "| state | dips | of the coil supply | with a reset | closings on a DC link 8 V below the pack | 8 V above it | "
      "started again | do not start |\n"
      "|---|---|---|---|---|---|---|---|\n";
  int all = 0;
  for (const auto& [state, l] : lines) {
    result.table += fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} |\n", state, l.dips, l.coils, l.resets,
                                l.below, l.above, l.restarts, l.stuck);
    all += l.dips;
  }
  result.table += fmt::format("\n{} dips.\n", all);
  result.outcomes.insert(result.outcomes.end(), broken.begin(), broken.end());
  return result;
}

}  // namespace bms::world
