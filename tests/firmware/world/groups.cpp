// Random groups of two and four batteries, each with the flashed image of BMS_PARALLEL: charge, age, cable, capacity
// and temperature of each are drawn. Start, drive, one drops out under load, it returns, supplies dip, key off,
// restart. Judged from the circuit: true OCVs at each closing, currents between the batteries, currents against the
// limit that a battery sends.
#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "tests/firmware/world/group_world.hpp"
#include "tests/firmware/world/scenarios.hpp"

namespace bms::world {

namespace {

// firmware/parallel/README.md
constexpr double most_over_ms = 1'000, truck_follows_ms = 200;
constexpr double closes_within_ms = 20'000;

enum class Loss { fault, supply, coils, bus };
constexpr std::array loss_names{"fault", "supply of the board", "supply of the coils", "bus"};

class RandomGroup {
 public:
  RandomGroup(std::size_t count, std::uint64_t seed, Outcome& outcome)
      : random_(seed * 1'000 + count), group_(drawn(count, seed)), outcome_(outcome) {
    group_.truck_follows_ms = truck_follows_ms;
    for (const auto& world : group_.worlds) {
      const double celsius = between(18, 32);
      for (std::size_t sensor = 0; sensor < 4; ++sensor) world->set_temperature(sensor, celsius);
    }
  }

  void run() {
    group_.run_ms(2'500);
    for (const auto& world : group_.worlds) world->vehicle.forget();
    group_.request(Request::drive);
    closes("start", 1);
    const std::size_t connected = group_.connected();
    outcome_.values["left out"] = static_cast<double>(group_.worlds.size() - connected);
    drive();
    expect_as_driven("while driving");
    lose_one();
    closes("after the loss", 1);
    expect(group_.connected() + 1 >= connected, "one that dropped out does not return");
    dip_supplies();
    key_off("after the dips");
    group_.run_ms(16'000);
    group_.request(Request::drive);
    closes("restart", 1);
    outcome_.values["again"] = static_cast<double>(group_.connected());
    key_off("at the end");
    judge();
  }

 private:
  double between(double least, double most) { return least + random_.uniform() * (most - least); }

  std::vector<Group::Battery> drawn(std::size_t count, std::uint64_t seed) {
    std::vector<Group::Battery> all;
    const double soc = between(0.2, 0.9), apart = random_.uniform() < 0.33 ? 0.3 : 0.04;
    for (std::size_t k = 0; k < count; ++k) {
      Group::Battery b{random_setup(parallel_pack(), seed * 10 + k), static_cast<std::int32_t>(k) + 1,
                       static_cast<std::int32_t>(count)};
      plant::TruckParameters& truck = b.setup.truck;
      const double own_soc = std::clamp(soc + between(-apart, apart), 0.12, 0.95), capacity = between(0.8, 1.05),
                   resistance = between(1, 1.85);
      for (plant::StringCell& cell : truck.cells) {
        cell.soc = own_soc + between(-0.01, 0.01);
        cell.capacity_ah *= capacity;
        cell.resistance_factor = resistance * between(0.97, 1.03);
      }
      truck.fuse_ohm += between(0, 0.002);                    // the cable
      if (k > 0) truck.dc_link = all[0].setup.truck.dc_link;  // there is one of it
      all.push_back(b);
    }
    return all;
  }

  void expect(bool good, const std::string& what) {
    if (!good) outcome_.fail(fmt::format("{} at {:.1f} s: {}", what, group_.worlds[0]->now_s(), text_of(group_)));
  }
  void closes(const std::string& when, std::size_t least) {
    group_.demand_a = 0;
    const auto all = [&] { return group_.connected() == group_.worlds.size(); };
    const double ms = group_.run_until(all, closes_within_ms);
    if (when == "start" && ms >= 0) outcome_.values["connected"] = ms;
    expect(group_.connected() >= least, when + ": nothing closes");
  }
  void demand(double amperes, double seconds) {
    group_.demand_a = amperes;
    group_.run_ms(1e3 * seconds);
  }
  double most_a() const { return 120 * static_cast<double>(group_.worlds.size()); }

  void drive() {
    for (int k = 0; k < 5; ++k) demand(random_.uniform() < 0.3 ? 0 : between(-0.4, 1) * most_a(), between(1, 6));
    demand(most_a(), 25);
  }

  /// What a battery may publish in ordinary driving: nothing.
  void expect_as_driven(const std::string& when) {
    for (const auto& world : group_.worlds)
      expect((world->vehicle.faults_seen() & ~(std::uint64_t{1} << group_incomplete)) == 0, "a fault " + when);
  }

  std::size_t any() { return static_cast<std::size_t>(random_.uniform() * static_cast<double>(group_.worlds.size())); }

  void lose_one() {
    const std::size_t which = any();
    TruckWorld& lost = *group_.worlds[which];
    const auto loss = static_cast<Loss>(random_.uniform() * loss_names.size());
    outcome_.texts["loss"] = loss_names[static_cast<std::size_t>(loss)];
    constexpr double lasts_ms = 8'000;
    group_.demand_a = random_.uniform() < 0.7 ? most_a() : between(0.2, 1) * most_a();
    group_.run_ms(2'000);
    if (loss == Loss::fault) lost.interlock = false;
    if (loss == Loss::supply) lost.dip_vdda(1, lasts_ms, 3.3);
    if (loss == Loss::coils) lost.dip_coil_supply(1, lasts_ms, 12);
    if (loss == Loss::bus) group_.on_the_bus[which] = false;
    const bool leads = which == 0;
    group_.run_ms(1'500);
    const bool stays = loss == Loss::bus && (leads || group_.worlds.size() == 1);
    if (!stays) expect(!lost.both_mains_closed(), "does not open without the " + outcome_.text("loss"));
    group_.run_ms(lasts_ms - 1'000);
    lost.interlock = true;
    group_.on_the_bus[which] = true;
    group_.demand_a = 0;
    group_.run_ms(2'000);
    // a supply that fails while driving needs the driver's key
    key_off("after the loss");
    group_.run_ms(16'000);
    group_.request(Request::drive);
  }

  void dip_supplies() {
    for (int k = 0; k < 3; ++k) {
      TruckWorld& world = *group_.worlds[any()];
      const double delay_ms = between(1, 2'000), duration_ms = std::pow(400.0, random_.uniform());
      if (random_.uniform() < 0.4)
        world.dip_coil_supply(delay_ms, duration_ms, 12 * between(0.2, 1));
      else
        world.dip_vdda(delay_ms, duration_ms, between(0.35, 3.3));
      demand(between(-0.2, 1) * most_a(), 4);
    }
  }

  void key_off(const std::string& when) {
    group_.demand_a = 0;
    expect(group_.key_off(), "key off " + when + ": stays closed");
  }

  void judge() {
    outcome_.values["apart"] = group_.largest_closing_difference_v;
    outcome_.values["equalising"] = group_.largest_equalising_a;
    outcome_.values["sudden"] = group_.largest_sudden_a;
    outcome_.values["over"] = group_.longest_over_ms;
    outcome_.values["joined"] = static_cast<double>(group_.joined);
    expect(group_.largest_closing_difference_v <= most_apart_v, "closes on a difference above the stated one");
    expect(group_.largest_equalising_a <= most_equalising_a && group_.largest_sudden_a <= most_equalising_a,
           "equalising current above the stated one");
    expect(group_.longest_over_ms <= most_over_ms, "a battery stays above its limit");
    for (const auto& world : group_.worlds) {
      expect(world->closings_below_v(closing_limit_v).empty(), "closes on an empty DC link");
      for (const std::string& violation : world->violations()) outcome_.fail(violation);
    }
  }

  plant::Random random_;
  Group group_;
  Outcome& outcome_;
};

struct Row {
  int groups = 0, failed = 0, joined = 0, left_out = 0;
  double connected = 0, apart = 0, equalising = 0, sudden = 0, over = 0;
};

}  // namespace

Result run_groups(const Extent& extent) {
  Cases cases(extent.at_once);
  extent.set(cases, "groups", parallel_pack());
  const std::size_t all = extent.count == 0 ? 30 : extent.count;
  for (std::size_t k = 0; k < all; ++k) {
    const std::size_t count = k % 3 == 2 ? 4 : 2;  // two pairs, one of four
    const std::uint64_t seed = extent.seed + k;
    const std::string name = fmt::format("{} batteries {}", count, seed);
    if (!extent.has(name)) continue;
    cases.start(name, [&](Outcome& outcome) {
      outcome.values["batteries"] = static_cast<double>(count);
      RandomGroup(count, seed, outcome).run();
    });
  }
  Result result{"groups", "", cases.finish()};
  std::map<int, Row> rows;
  for (const Outcome& o : result.outcomes) {
    Row& row = rows[static_cast<int>(o.value("batteries", 0))];
    ++row.groups;
    row.failed += o.good ? 0 : 1;
    row.joined += static_cast<int>(o.value("joined", 0));
    row.left_out += o.value("left out", 0) > 0 ? 1 : 0;
    row.connected = std::max(row.connected, 1e-3 * o.value("connected", 0));
    row.apart = std::max(row.apart, o.value("apart", 0));
    row.equalising = std::max(row.equalising, o.value("equalising", 0));
    row.sudden = std::max(row.sudden, o.value("sudden", 0));
    row.over = std::max(row.over, 1e-3 * o.value("over", 0));
  }
  result.table =
      "| batteries | groups | left one out | all connected within [s] | closings next to another one | largest "
      "difference [V] | equalising current [A] | if the load had ended [A] | longest above a limit [s] | failed |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n";
  for (const auto& [count, r] : rows) {
    result.table +=
        fmt::format("| {} | {} | {} | {:.1f} | {} | {:.2f} | {:.1f} | {:.1f} | {:.2f} | {} |\n", count, r.groups,
                    r.left_out, r.connected, r.joined, r.apart, r.equalising, r.sudden, r.over, r.failed);
  }
  return result;
}

}  // namespace bms::world
