// The contactors in the electrical world of evidence/plant/circuit, which has no sequence and no threshold: random
// worlds drive, and every fault of a contactor is found, or is not visible as firmware/protection/README.md states.
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/firmware/protection/wired_truck.hpp"

namespace bms::protection {
namespace {

using enum ContactorState;
using plant::AuxiliaryFault;
using plant::ContactorFault;
using plant::Relay;

plant::TruckParameters world_of(std::uint64_t seed) {
  return plant::random_world(seed, {.cells = 16, .divider_tolerance = 0.001});
}

constexpr int worlds = 100;

/// Key on, precharge, drive, recuperate, key off, restart with a charged DC link, key off.
void drive_twice(WiredTruck& t, const std::string& name) {
  for (int start = 0; start < 2; ++start) {
    t.request = Request::drive;
    const double took_s = t.until(drive, 6);
    ASSERT_GE(took_s, 0) << name << ", start " << start << ", welded " << t.seen.welded << ", precharge failed "
                         << t.seen.precharge_failed << ", not closed " << t.seen.not_closed;
    t.run(0.5);
    t.truck.set_drive({.power_w = 8'000});
    t.run(1);
    t.truck.set_drive({.power_w = -3'000});
    t.run(0.5);
    t.truck.set_drive({});
    t.run(0.3);
    ASSERT_EQ(t.state(), drive) << name;
    t.request = Request::none;
    ASSERT_GE(t.until(off, 3), 0) << name;
  }
}

/// Returns true if the precharge relay is closed at every touch of main plus, also while it bounces.
bool makes_before_break(const plant::Truck& truck) {
  bool relay_closed = false;
  for (const plant::ContactEvent& e : truck.events()) {
    if (e.relay == Relay::precharge) relay_closed = e.closes;
    if (e.relay == Relay::main_plus && e.closes && !relay_closed) return false;
  }
  return true;
}

class EveryWorld : public ::testing::TestWithParam<bool> {};

TEST_P(EveryWorld, DrivesRecuperatesStopsAndStartsAgainWithAChargedLink) {
  for (std::uint64_t seed = 1; seed <= worlds; ++seed) {
    const std::string name = "world " + std::to_string(seed);
    WiredTruck t(world_of(seed), GetParam());
    t.run(0.5);
    drive_twice(t, name);
    if (HasFatalFailure()) return;
    EXPECT_FALSE(t.any_event()) << name << ", welded " << t.seen.welded << ", not closed " << t.seen.not_closed;
    EXPECT_LT(t.worst_closing(Relay::main_plus).across_v, 9.0 + 0.5) << name;
    EXPECT_TRUE(makes_before_break(t.truck)) << name;
    EXPECT_LT(t.worst_closing(Relay::main_minus).peak_a, 1) << name << ": main minus closes without current";
  }
}
INSTANTIATE_TEST_SUITE_P(WithAndWithoutAuxiliaryContacts, EveryWorld, ::testing::Bool(),
                         [](const auto& p) { return std::string(p.param ? "With" : "Without"); });

/// Loads of the table in evidence/plant/circuit/README.md at the voltage of an almost empty battery.
TEST(WiredPrecharge, EndsWithEveryLoadOfTheTable) {
  struct Load {
    const char* name;
    double bleeder_ohm, idle_w;
  };
  constexpr double none = std::numeric_limits<double>::infinity();
  for (const Load& load : {Load{"none", none, 0}, Load{"10 kohm", 10e3, 0}, Load{"1 kohm", 1e3, 0},
                           Load{"1 W", none, 1}, Load{"5 W", none, 5}, Load{"5 W and 1 kohm", 1e3, 5}}) {
    for (const double soc : {0.02, 0.5}) {  // 47 V and 52.6 V
      plant::TruckParameters world = plant::typical_world();
      for (plant::StringCell& cell : world.cells) cell.soc = soc;
      world.dc_link.bleeder_ohm = load.bleeder_ohm;
      world.dc_link.idle_w = load.idle_w;
      WiredTruck t(world);
      t.request = Request::drive;
      EXPECT_GE(t.until(drive, 6), 0) << load.name << " at " << t.cells_v() << " V";
      t.run(0.2);
      const auto closing = t.worst_closing(Relay::main_plus);
      EXPECT_LE(closing.across_v, 9.0 + 0.5) << load.name;
      EXPECT_LE(closing.peak_a, 600) << load.name << ", 10 mohm in the capacitor";
    }
  }
}

TEST(WiredPrecharge, FailsWithALoadThatLeavesTooMuchVoltageForTheClosing) {
  plant::TruckParameters world = plant::typical_world();
  world.dc_link.bleeder_ohm = 150;
  WiredTruck t(world);
  t.request = Request::drive;
  EXPECT_GE(t.until(safe, 6), 0);
  EXPECT_TRUE(t.seen.precharge_failed);
  EXPECT_TRUE(t.truck.events().empty() || t.worst_closing(Relay::main_plus).peak_a == 0);
}

/// The DC link stays at the charger's voltage in every state of the contactors, above or below the battery.
TEST(WiredTrucks, DriveWithAChargerThatHoldsTheLinkUp) {
  for (const double held_v : {20.0, 45.0, 52.0, 52.6, 53.0, 56.0, 60.0}) {
    plant::TruckParameters world = plant::typical_world();
    world.charger.idle_v = held_v;
    world.dc_link.start_v = held_v;
    WiredTruck t(world);
    t.truck.contactor(Relay::charge).set_fault(ContactorFault::welded);
    t.run(0.5);
    drive_twice(t, "held at " + std::to_string(held_v));
    EXPECT_FALSE(t.any_event()) << held_v;
    EXPECT_LT(t.worst_closing(Relay::main_plus).across_v, 9.5) << held_v;
  }
}

TEST(WiredTrucks, DriveWithContactorsThatBounceAndWithoutAnyBleeder) {
  plant::TruckParameters world = plant::typical_world();
  for (plant::ContactorParameters& relay : world.relay) relay.bounce = {0.005, 0.015};
  WiredTruck t(world);
  t.run(0.5);
  drive_twice(t, "bounce");
  EXPECT_FALSE(t.any_event());
}

/// A fault that is there from the start, and how it is found.
enum class Found { welded, precharge_failed, not_closed };
struct WiredFault {
  const char* name;
  void (*happens)(plant::Truck&);
  Found found;
  bool or_not_closed = false;
  bool needs_auxiliary = false, needs_empty_link = false, needs_current = false;
  Pole pole = Pole::none;
};
template <Relay Which, ContactorFault Fault>
void breaks(plant::Truck& t) {
  t.contactor(Which).set_fault(Fault);
}
template <Relay Which, AuxiliaryFault Fault>
void sticks(plant::Truck& t) {
  t.contactor(Which).set_auxiliary_fault(Fault);
}
const WiredFault wired_faults[] = {
    {.name = "MainPlusWelded",
     .happens = breaks<Relay::main_plus, ContactorFault::welded>,
     .found = Found::welded,
     .pole = Pole::plus},
    {.name = "MainMinusWelded",
     .happens = breaks<Relay::main_minus, ContactorFault::welded>,
     .found = Found::welded,
     .pole = Pole::minus},
    {.name = "PrechargeRelayWelded",
     .happens = breaks<Relay::precharge, ContactorFault::welded>,
     .found = Found::welded,
     .pole = Pole::plus},
    {.name = "PrechargeRelayCoilOpen",
     .happens = breaks<Relay::precharge, ContactorFault::open_coil>,
     .found = Found::precharge_failed},
    {.name = "PrechargeResistorBurnt",
     .happens = [](plant::Truck& t) { t.break_wire(plant::Wire::precharge_resistor); },
     .found = Found::precharge_failed},
    {.name = "PrechargeResistorShorted",
     .happens = [](plant::Truck& t) { t.set_precharge_ohm(0.5); },
     .found = Found::precharge_failed,
     .needs_empty_link = true},
    {.name = "FuseMelted",
     .happens = [](plant::Truck& t) { t.break_wire(plant::Wire::fuse); },
     .found = Found::precharge_failed},
    {.name = "DividerOfLinkPlusBroken",
     .happens = [](plant::Truck& t) { t.break_wire(plant::Wire::plus_divider); },
     .found = Found::precharge_failed},
    {.name = "DividerOfLinkMinusBroken",
     .happens = [](plant::Truck& t) { t.break_wire(plant::Wire::minus_divider); },
     .found = Found::welded,  // its pin stays near 0 V, as that of a welded main minus
     .or_not_closed = true},  // by more than 1 V, as that of one that does not close
    {.name = "MainMinusCoilOpen",
     .happens = breaks<Relay::main_minus, ContactorFault::open_coil>,
     .found = Found::not_closed},
    {.name = "MainMinusBurnt",
     .happens = breaks<Relay::main_minus, ContactorFault::no_contact>,
     .found = Found::not_closed},
    {.name = "MainPlusCoilOpen",
     .happens = breaks<Relay::main_plus, ContactorFault::open_coil>,
     .found = Found::not_closed,
     .needs_current = true},
    {.name = "MainPlusBurnt",
     .happens = breaks<Relay::main_plus, ContactorFault::no_contact>,
     .found = Found::not_closed,
     .needs_current = true},
    {.name = "AuxiliaryContactOfMainPlusStuckOpen",
     .happens = sticks<Relay::main_plus, AuxiliaryFault::stuck_open>,
     .found = Found::not_closed,
     .needs_auxiliary = true},
    {.name = "AuxiliaryContactOfMainMinusStuckOpen",
     .happens = sticks<Relay::main_minus, AuxiliaryFault::stuck_open>,
     .found = Found::not_closed,
     .needs_auxiliary = true},
    {.name = "AuxiliaryContactOfMainPlusStuckClosed",
     .happens = sticks<Relay::main_plus, AuxiliaryFault::stuck_closed>,
     .found = Found::welded,
     .needs_auxiliary = true,
     .pole = Pole::plus},
    {.name = "AuxiliaryContactOfMainMinusStuckClosed",
     .happens = sticks<Relay::main_minus, AuxiliaryFault::stuck_closed>,
     .found = Found::welded,
     .needs_auxiliary = true,
     .pole = Pole::minus},
};

class FaultFromTheStart : public ::testing::TestWithParam<WiredFault> {
 protected:
  static void expect_found(WiredTruck& t, const std::string& where) {
    const WiredFault& fault = GetParam();
    EXPECT_TRUE(t.fault) << where << ", state " << contactor_state_names[static_cast<std::size_t>(t.state())];
    const bool other = fault.or_not_closed && t.seen.not_closed;
    EXPECT_EQ(t.seen.welded, fault.found == Found::welded && !other) << where;
    EXPECT_EQ(t.seen.precharge_failed, fault.found == Found::precharge_failed) << where;
    EXPECT_EQ(t.seen.not_closed, fault.found == Found::not_closed || other) << where;
    EXPECT_FALSE(t.outputs().any_closed()) << where;
    if (fault.pole != Pole::none) {
      EXPECT_TRUE(t.welded_pole() == fault.pole || t.welded_pole() == Pole::unknown) << where;
    }
  }
};

TEST_P(FaultFromTheStart, IsFoundInEveryWorldBeforeTheTruckDrives) {
  const WiredFault& fault = GetParam();
  int known = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const bool auxiliary = fault.needs_auxiliary || seed % 2 == 0;
    const std::string where = "world " + std::to_string(seed) + (auxiliary ? "" : " without auxiliary contacts");
    plant::TruckParameters world = world_of(seed);
    if (fault.needs_empty_link) world.dc_link.start_v = 0;
    WiredTruck t(world, auxiliary);
    fault.happens(t.truck);
    t.run(0.5);
    t.request = Request::drive;
    t.until(drive, 6);
    if (fault.needs_current && !auxiliary) {
      t.run(0.5);
      t.truck.set_drive({.power_w = 2'000});
    }
    t.run(1.5);
    expect_found(t, where);
    if (HasFailure()) return;
    known += t.welded_pole() == fault.pole ? 1 : 0;
  }
  if (fault.pole != Pole::none) {
    EXPECT_GE(known, 30) << "worlds in which the pole is known";
  }
}
INSTANTIATE_TEST_SUITE_P(On, FaultFromTheStart, ::testing::ValuesIn(wired_faults),
                         [](const auto& p) { return std::string(p.param.name); });

/// A contactor that welds while it carries current. Everything is open when it is found, and stays open.
TEST(WeldWhileDriving, IsFoundAfterTheOpeningWhateverThePole) {
  struct Case {
    std::vector<Relay> welded;
    Pole pole;
  };
  for (const Case& c : {Case{{Relay::main_plus}, Pole::plus}, Case{{Relay::main_minus}, Pole::minus},
                        Case{{Relay::main_plus, Relay::main_minus}, Pole::unknown}}) {
    int found = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const std::string where = "world " + std::to_string(seed) + ", pole " + std::to_string(static_cast<int>(c.pole));
      WiredTruck t(world_of(seed), false);
      t.request = Request::drive;
      ASSERT_GE(t.until(drive, 6), 0) << where;
      for (const Relay relay : c.welded) t.truck.contactor(relay).set_fault(ContactorFault::welded);
      t.run(1);
      ASSERT_FALSE(t.any_event()) << where;
      t.request = Request::none;
      for (int k = 0; k < 600 && !t.fault; ++k) t.sample();  // until the DC link has lost half of the voltage
      found += t.fault ? 1 : 0;
      t.request = Request::drive;  // else the next start finds it
      t.run(2);
      EXPECT_TRUE(t.fault && t.seen.welded) << where;
      EXPECT_TRUE(t.welded_pole() == c.pole || t.welded_pole() == Pole::unknown) << where;
      EXPECT_FALSE(t.outputs().any_closed()) << where;
    }
    if (c.pole != Pole::unknown) {
      EXPECT_GE(found, 6) << "of 20 within a minute after the opening: those whose DC link discharges";
    }
  }
}

/// The coils lose their supply for a moment, under load, at any time between two samples. The contacts drop out and the
/// outputs are still on when the supply returns.
TEST(InterruptedCoils, NeverCloseMainPlusOnAnEmptyLink) {
  for (const double lasts_s : {0.02, 0.05, 0.1, 0.15, 0.22, 0.29}) {
    for (const double phase_s : {0.0, 0.03, 0.06, 0.09}) {
      plant::TruckParameters world = plant::typical_world();
      WiredTruck t(world);
      t.request = Request::drive;
      ASSERT_GE(t.until(drive, 6), 0);
      t.run(1);
      t.truck.set_drive({.power_w = 5'000});
      t.run(0.5);
      const std::size_t before = t.truck.events().size();
      t.truck.add_coil_supply_dip({.start_s = t.truck.time_s() + phase_s, .duration_s = lasts_s, .depth_v = 12});
      t.run(2);
      for (std::size_t k = before; k < t.truck.events().size(); ++k)
        EXPECT_FALSE(t.truck.events()[k].closes) << lasts_s << " s, phase " << phase_s << " s";
      EXPECT_TRUE(t.fault && t.seen.not_closed);
    }
  }
}

/// Without auxiliary contacts the voltages show it, if a sample falls into the interruption.
TEST(InterruptedCoils, AreFoundByTheVoltagesFromASamplePeriodOn) {
  for (const double lasts_s : {0.13, 0.2, 0.29}) {
    for (const double phase_s : {0.0, 0.03, 0.06, 0.09}) {
      WiredTruck t(plant::typical_world(), false);
      t.request = Request::drive;
      ASSERT_GE(t.until(drive, 6), 0);
      t.run(1);
      t.truck.set_drive({.power_w = 5'000});
      t.run(0.5);
      const std::size_t before = t.truck.events().size();
      t.truck.add_coil_supply_dip({.start_s = t.truck.time_s() + phase_s, .duration_s = lasts_s, .depth_v = 12});
      t.run(2);
      for (std::size_t k = before; k < t.truck.events().size(); ++k) {
        const plant::ContactEvent& e = t.truck.events()[k];
        EXPECT_FALSE(e.closes) << lasts_s << " s, phase " << phase_s << " s";
      }
      EXPECT_TRUE(t.fault && t.seen.not_closed) << lasts_s << " s, phase " << phase_s << " s";
    }
  }
}

}  // namespace
}  // namespace bms::protection
