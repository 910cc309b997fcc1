// Batteries in parallel: the flashed image of stm32f405_80v with BMS_PARALLEL, two to four times, in one circuit.
#include "tests/firmware/world/group_world.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

namespace bms::world {
namespace {

using ::testing::IsEmpty;

constexpr double limit_a = 100;

Group::Battery battery(std::int32_t node, double soc, double resistance = 1, std::int32_t batteries = 2) {
  Group::Battery b{typical_setup(parallel_pack(), static_cast<std::uint64_t>(node)), node, batteries};
  for (plant::StringCell& cell : b.setup.truck.cells) {
    cell.soc = soc;
    cell.resistance_factor = resistance;
  }
  return b;
}

void expect_no_fault(const Group& group) {
  for (const auto& world : group.worlds) {
    EXPECT_EQ(fault_names(world->vehicle.faults_seen() & ~(std::uint64_t{1} << group_incomplete)), "none");
    EXPECT_THAT(world->closings_below_v(closing_limit_v), IsEmpty());
    EXPECT_THAT(world->violations(), IsEmpty());
  }
}

/// Two batteries that drive together. The second one has cells with 1.5 times the resistance.
class TwoBoards : public ::testing::Test {
 protected:
  void connect(double within_ms = 30'000) {
    group.run_ms(2'500);
    for (const auto& world : group.worlds) world->vehicle.forget();
    group.request(Request::drive);
    took_ms = group.run_until([&] { return group.connected() == 2; }, within_ms);
    ASSERT_GE(took_ms, 0) << text_of(group);
  }
  void drive(double demand_a, double seconds) {
    group.demand_a = demand_a;
    group.run_ms(1e3 * seconds);
    ASSERT_EQ(group.connected(), 2U) << text_of(group);
  }

  Group group{{battery(1, 0.55), battery(2, 0.56, 1.5)}};
  double took_ms = 0;
};

TEST_F(TwoBoards, ConnectOneAfterTheOtherAndShareTheLoad) {
  connect();
  drive(0, 6);
  std::printf("connected after %.1f s, equalising at most %.1f A, %.2f V apart\n", 1e-3 * took_ms,
              group.largest_equalising_a, group.largest_closing_difference_v);
  EXPECT_LE(group.largest_equalising_a, most_equalising_a);
  EXPECT_LE(group.largest_closing_difference_v, most_apart_v);
  EXPECT_GT(group.worlds[0]->vehicle.allowed_discharge_a(), limit_a) << "of both, by the leader";
  EXPECT_EQ(group.worlds[1]->vehicle.allowed_discharge_a(), 0) << "the other one leaves it to the leader";
  drive(1'000, 60);
  std::printf("load %.0f A: %.1f A and %.1f A, the most used one has %.0f %% of its limit\n", group.load_a(),
              group.presence[0].current_a, group.presence[1].current_a, 100 * group.largest_use);
  EXPECT_GT(group.load_a(), 1.4 * limit_a) << "more than one battery alone";
  EXPECT_LE(group.largest_use, 1.05);
  EXPECT_NEAR(-group.presence[0].current_a - group.presence[1].current_a, group.load_a(), 5);
  EXPECT_TRUE(group.key_off()) << text_of(group);
  expect_no_fault(group);
  for (const auto& world : group.worlds) EXPECT_FALSE(world->vehicle.fault(group_incomplete));
}

TEST_F(TwoBoards, ALostBusOpensTheOneThatDoesNotLeadAndIsNamed) {
  connect();
  drive(120, 10);
  group.on_the_bus[1] = false;
  const double ms = group.run_until([&] { return !group.worlds[1]->both_mains_closed(); }, 3'000);
  std::printf("opened %.0f ms after the bus was cut\n", ms);
  EXPECT_GE(ms, 900) << "1 s since the last message";
  EXPECT_LE(ms, 1'200) << "and a sample, and the contactor";
  group.run_ms(2'000);
  EXPECT_TRUE(group.worlds[0]->both_mains_closed());
  EXPECT_LE(std::abs(group.worlds[0]->truck.current_a()), 1.05 * limit_a);
  for (const auto& world : group.worlds) EXPECT_TRUE(world->vehicle.fault(group_incomplete));
  group.run_ms(5'000);
  EXPECT_FALSE(group.worlds[1]->any_main_closed()) << "nothing closes without the bus";
  group.on_the_bus[1] = true;
  group.demand_a = 0;
  EXPECT_GE(group.run_until([&] { return group.connected() == 2; }, 30'000), 0) << text_of(group);
  group.run_ms(6'000);
  for (const auto& world : group.worlds) EXPECT_FALSE(world->vehicle.fault(group_incomplete));
  expect_no_fault(group);
}

TEST_F(TwoBoards, OneThatDropsOutUnderFullLoadLeavesTheOtherWithinItsLimit) {
  connect();
  drive(1'000, 40);
  for (const std::size_t which : {1U, 0U}) {
    SCOPED_TRACE(which);
    TruckWorld &lost = *group.worlds[which], &other = *group.worlds[1 - which];
    lost.interlock = false;  // a fault that opens at once
    ASSERT_GE(group.run_until([&] { return !lost.any_main_closed(); }, 1'000), 0);
    const double ms = group.run_until(
        [&] { return !other.both_mains_closed() || std::abs(other.truck.current_a()) <= 1.02 * limit_a; }, 2'000);
    std::printf("the other one is within its limit after %.0f ms\n", ms);
    EXPECT_GE(ms, 0);
    EXPECT_LE(ms, 600);
    group.run_ms(5'000);
    if (which == 1) {
      EXPECT_TRUE(other.both_mains_closed()) << text_of(group);
    }
    lost.interlock = true;
    group.demand_a = 0;
    ASSERT_GE(group.run_until([&] { return group.connected() == 2; }, 60'000), 0) << text_of(group);
    group.demand_a = 1'000;
    group.run_ms(40'000);
  }
  EXPECT_LE(group.largest_equalising_a, most_equalising_a);
}

/// Three and four batteries with 1 to 2 times the resistance. The leader has the least, so it carries most.
class MoreBoards : public ::testing::TestWithParam<std::int32_t> {
 protected:
  static std::vector<Group::Battery> batteries() {
    constexpr std::array<double, 4> soc{0.55, 0.56, 0.555, 0.565}, resistance{1, 1.5, 1.25, 1.9};
    std::vector<Group::Battery> all;
    for (std::size_t k = 0; k < static_cast<std::size_t>(GetParam()); ++k)
      all.push_back(battery(static_cast<std::int32_t>(k) + 1, soc[k], resistance[k], GetParam()));
    return all;
  }
  std::size_t count() const { return group.worlds.size(); }
  void all_connect(double within_ms) {
    const double ms = group.run_until([&] { return group.connected() == count(); }, within_ms);
    ASSERT_GE(ms, 0) << text_of(group);
    std::printf("%zu connected after %.1f s\n", count(), 1e-3 * ms);
  }
  void load(double demand_a, double seconds) {
    group.demand_a = demand_a;
    group.run_ms(1e3 * seconds);
  }
  void expect_bounded(const char* when) {
    std::printf(
        "%s: %.0f A of the truck; equalising at most %.1f A, %.1f A if the load had ended, %.2f V apart; above "
        "a limit for at most %.0f ms\n",
        when, group.load_a(), group.largest_equalising_a, group.largest_sudden_a, group.largest_closing_difference_v,
        group.longest_over_ms);
    EXPECT_LE(group.largest_equalising_a, most_equalising_a) << when;
    EXPECT_LE(group.largest_sudden_a, most_equalising_a) << when;
    EXPECT_LE(group.largest_closing_difference_v, most_apart_v) << when;
    EXPECT_LE(group.longest_over_ms, 600) << when;
  }

  Group group{batteries()};
};

TEST_P(MoreBoards, ShareTheLoadDropOutLoseTheBusAndReturn) {
  group.truck_follows_ms = 200;
  group.run_ms(2'500);
  for (const auto& world : group.worlds) world->vehicle.forget();
  group.request(Request::drive);
  all_connect(30'000);
  load(1'000, 50);
  group.largest_use = 0;  // that of a battery whose limits rise after its closing
  load(1'000, 10);
  expect_bounded("full load");
  EXPECT_NEAR(group.largest_use, 0.95, 0.04);
  EXPECT_GT(group.load_a(), 0.55 * limit_a * static_cast<double>(count()));
  for (const std::size_t which : {std::size_t{0}, count() - 1}) {  // the leader, and the last one
    group.worlds[which]->interlock = false;
    ASSERT_GE(group.run_until([&] { return !group.worlds[which]->any_main_closed(); }, 1'000), 0);
    load(1'000, 5);
    EXPECT_EQ(group.connected(), count() - 1) << text_of(group);
    expect_bounded("one has dropped out");
    group.worlds[which]->interlock = true;
    load(0, 0);
    all_connect(60'000);
    load(1'000, 20);
  }
  group.on_the_bus.back() = false;
  const double ms = group.run_until([&] { return !group.worlds.back()->both_mains_closed(); }, 3'000);
  EXPECT_GE(ms, 900) << "1 s since the last message";
  EXPECT_LE(ms, 1'200) << "and a sample, and the contactor";
  load(1'000, 5);
  EXPECT_EQ(group.connected(), count() - 1) << text_of(group);
  expect_bounded("the bus of one is cut");
  group.on_the_bus.back() = true;
  load(0, 0);
  all_connect(60'000);
  load(1'000, 20);
  group.on_the_bus.assign(count(), false);
  load(1'000, 5);
  EXPECT_EQ(group.connected(), 1U) << "the leader remains" << text_of(group);
  EXPECT_TRUE(group.worlds[0]->both_mains_closed());
  expect_bounded("no bus");
  group.on_the_bus.assign(count(), true);
  load(0, 0);
  all_connect(60'000);
  EXPECT_TRUE(group.key_off()) << text_of(group);
  for (const auto& world : group.worlds) {
    EXPECT_THAT(world->closings_below_v(closing_limit_v), IsEmpty());
    EXPECT_THAT(world->violations(), IsEmpty());
  }
}

INSTANTIATE_TEST_SUITE_P(OfAGroup, MoreBoards, ::testing::Values(3, 4));

/// The fuller battery has 1.5 times the resistance; a charger of either protocol on the bus of all.
class ChargedGroup : public ::testing::TestWithParam<const char*> {
 protected:
  static std::vector<Group::Battery> batteries() {
    std::vector<Group::Battery> all{battery(1, 0.985), battery(2, 0.988, 1.5)};
    for (Group::Battery& b : all) b.setup.truck.ocv_v = firmware::ocv_beyond_full();
    return all;
  }
  double soc(std::size_t k) const { return group.worlds[k]->truck.cells().soc(0); }
  double highest_v() const { return std::max(group.worlds[0]->highest_cell_v(), group.worlds[1]->highest_cell_v()); }

  firmware::Charger& charger() {
    return std::string(GetParam()) == "elcon" ? static_cast<firmware::Charger&>(elcon) : canopen;
  }

  firmware::ElconCharger elcon;
  firmware::CanopenCharger canopen{24 * 3.55};
  Group group{batteries(), GetParam()};
};

TEST_P(ChargedGroup, IsFilledByTheLeaderAndEndsTogether) {
  charger().rated_a = 120;
  group.charger = &charger();
  const double begun_ms = group.run_until([&] { return group.load_a() < -40; }, 60'000);
  ASSERT_GE(begun_ms, 0) << text_of(group);
  EXPECT_EQ(group.connected(), 2U);
  group.to_charger.fill(0);  // at key-on another one may have led for a sample
  double highest = 0, largest_use = 0;
  const double ended_ms = group.run_until(
      [&] {
        highest = std::max(highest, highest_v());
        for (std::size_t k = 0; k < 2; ++k) {
          const SeenPresence& p = group.presence[k];
          if (p.charge_a > 10) largest_use = std::max(largest_use, group.worlds[k]->truck.current_a() / p.charge_a);
        }
        return group.connected() == 0;
      },
      1'800'000);
  ASSERT_GE(ended_ms, 0) << text_of(group);
  std::printf(
      "%s: 40 A after %.1f s, over after %.0f s at %.1f %% and %.1f %%, highest cell %.3f V, the most used one "
      "%.0f %% of its limit, frames %zu and %zu\n",
      GetParam(), 1e-3 * begun_ms, 1e-3 * ended_ms, 100 * soc(0), 100 * soc(1), highest, 100 * largest_use,
      group.to_charger[0], group.to_charger[1]);
  EXPECT_GT(soc(0), 0.995);
  EXPECT_GT(soc(1), 0.995);
  EXPECT_LT(highest, 3.65);
  EXPECT_LE(largest_use, 1.05);
  EXPECT_GT(group.to_charger[0], 100U);
  EXPECT_EQ(group.to_charger[1], 0U) << "only the leader speaks";
  group.run_ms(20'000);
  EXPECT_EQ(group.connected(), 0U) << "still plugged in: the charge is over";
  expect_no_fault(group);
}

TEST_P(ChargedGroup, OneThatDropsOutLeavesTheOtherWithinItsLimit) {
  for (const auto& world : group.worlds) {
    for (std::size_t cell = 0; cell < world->truck.cell_count(); ++cell) world->truck.cells().set_soc(cell, 0.6);
  }
  charger().rated_a = 300;
  group.charger = &charger();
  ASSERT_GE(group.run_until([&] { return group.load_a() < -1.2 * limit_a; }, 60'000), 0) << text_of(group);
  const double before_a = -group.load_a();
  group.longest_over_ms = 0;
  group.worlds[1]->interlock = false;
  group.run_ms(5'000);
  std::printf("%s: %.0f A before, %.0f A after it, above its limit for %.0f ms\n", GetParam(), before_a,
              -group.load_a(), group.longest_over_ms);
  EXPECT_TRUE(group.worlds[0]->both_mains_closed()) << text_of(group);
  EXPECT_LE(-group.load_a(), 1.02 * limit_a);
  EXPECT_GT(-group.load_a(), 0.3 * limit_a) << "the charge goes on";
  EXPECT_LE(group.longest_over_ms, 1'000);
}

INSTANTIATE_TEST_SUITE_P(By, ChargedGroup, ::testing::Values("elcon", "cia418"),
                         [](const auto& profile) { return std::string(profile.param); });

TEST(Boards, ThatDifferStayApart) {
  Group group({battery(1, 0.20), battery(2, 0.95)});
  group.run_ms(2'500);
  group.request(Request::drive);
  group.run_ms(20'000);
  EXPECT_GT(group.open_circuit_v(1) - group.open_circuit_v(0), 1) << "the premise";
  EXPECT_FALSE(group.worlds[0]->any_main_closed());
  EXPECT_TRUE(group.worlds[1]->both_mains_closed()) << "the fuller one drives" << text_of(group);
  expect_no_fault(group);
}

TEST(Boards, CloseNothingUntilTheyAreSet) {
  Group group({battery(0, 0.5, 1, 0)});
  group.request(Request::drive);
  group.run_ms(10'000);
  EXPECT_FALSE(group.worlds[0]->any_main_closed());
  EXPECT_TRUE(group.worlds[0]->vehicle.fault(group_incomplete));
}

/// The other battery is in repair: nothing closes until the number is 1, which acts at once.
TEST(Boards, DriveAloneAfterTheirGroupHasShrunk) {
  Group group({battery(1, 0.5)});
  group.run_ms(2'500);
  group.request(Request::drive);
  group.run_ms(10'000);
  EXPECT_FALSE(group.worlds[0]->any_main_closed());
  EXPECT_TRUE(group.worlds[0]->vehicle.fault(group_incomplete));
  group.request(Request::none);
  group.run_ms(1'500);
  ASSERT_TRUE(set_group(*group.worlds[0], 1, 1));
  group.request(Request::drive);
  ASSERT_GE(group.run_until([&] { return group.connected() == 1; }, 20'000), 0) << text_of(group);
  group.demand_a = 80;
  group.run_ms(5'000);
  EXPECT_NEAR(group.load_a(), 80, 1);
  EXPECT_FALSE(group.worlds[0]->vehicle.fault(group_incomplete));
  expect_no_fault(group);
}

/// One battery of a group of two that receives from a third one, or from one that has its own node.
TEST(Boards, CloseNothingNextToOneThatIsNotOfTheGroup) {
  for (const std::int32_t node : {1, 3}) {
    SCOPED_TRACE(node);
    Group group({battery(1, 0.5), battery(2, 0.5)});
    Group stranger({battery(node, 0.5, 1, 3)});
    group.run_ms(2'500);
    group.request(Request::drive);
    for (int k = 0; k < 2'000; ++k) {
      group.run_ms(5);
      auto& can = stranger.worlds[0]->charger_bus->can;
      stranger.worlds[0]->run_ms(5);
      can.others_acknowledge = true;
      for (const firmware::SeenFrame& seen : std::exchange(can.seen, {})) {
        for (const auto& world : group.worlds)
          world->charger_bus->can.others.push_back({firmware::wire_frame(seen.frame), 0, true});
      }
    }
    EXPECT_EQ(group.connected(), 0U) << text_of(group);
    EXPECT_TRUE(group.worlds[0]->vehicle.fault(group_incomplete));
  }
}

/// What is published about a battery under current, against the curve at the true charge of its cells. Three batteries
/// with 1, 1.5 and 2 times the resistance of the cell file.
TEST(Boards, PublishTheirOpenCircuitVoltageUnderLoad) {
  Group group({battery(1, 0.55, 1, 3), battery(2, 0.555, 1.5, 3), battery(3, 0.56, 2, 3)});
  group.run_ms(2'500);
  group.request(Request::drive);
  ASSERT_GE(group.run_until([&] { return group.connected() == 3; }, 30'000), 0) << text_of(group);
  std::array<double, 3> worst_v{};
  for (const double demand_a : {0.0, 220.0, 40.0, 240.0, 0.0, 130.0}) {
    group.demand_a = demand_a;
    for (int k = 0; k < 40; ++k) {
      group.run_ms(500);
      for (std::size_t b = 0; b < 3; ++b)
        worst_v[b] = std::max(worst_v[b], std::abs(group.presence[b].open_circuit_v - group.open_circuit_v(b)));
    }
    for (std::size_t b = 0; b < 3; ++b) {
      std::printf("%.0f A: largest error of the OCV %.3f V; SOC %.2f %% of %.2f %%\n", group.presence[b].current_a,
                  worst_v[b], group.worlds[b]->vehicle.soc_percent(), 100 * group.worlds[b]->truck.cells().soc(0));
    }
  }
  EXPECT_LE(worst_v[0], 0.1);
  EXPECT_LE(worst_v[1], 0.1);
  EXPECT_LE(worst_v[2], 0.2);
  const double r0_ohm = 1 / group.worlds[0]->truck.link_source().siemens;
  for (std::size_t b = 1; b < 3; ++b) {
    const double ohm = r0_ohm + 1 / group.worlds[b]->truck.link_source().siemens;
    std::printf("%.1f mohm\n", 1e3 * ohm);
    EXPECT_LE((0.5 + worst_v[0] + worst_v[b]) / ohm, most_equalising_a);
  }
}

}  // namespace
}  // namespace bms::world
