// Welded contactors and leaks to the frame, each with and without the other, in random electrical worlds of 8 to 24
// cells without auxiliary contacts: a weld is found, a leak is not taken for one.
#include <cstdio>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/firmware/protection/wired_truck.hpp"

namespace bms::protection {
namespace {

using enum ContactorState;
using plant::ContactorFault;
using plant::Relay;

constexpr double string_leak_ohm = 4e3, sound_ohm = 1e6, none_ohm = plant::FrameLeaks::none;

struct Leak {
  const char* name;
  double share_below;  ///< of the cells
  double string_ohm, plus_ohm, minus_ohm;
  int may_stop = 0;  ///< of all worlds: at one voltage of the DC link no current flows through the leak
};
constexpr Leak leaks[] = {{"none", 0, none_ohm, none_ohm, none_ohm},
                          {"bottom", 0, string_leak_ohm, sound_ohm, sound_ohm},
                          {"middle", 0.5, string_leak_ohm, sound_ohm, sound_ohm},
                          {"top", 1, string_leak_ohm, sound_ohm, sound_ohm},
                          {"top, L+ 50 kohm", 1, string_leak_ohm, 50e3, sound_ohm, 2},
                          {"top, L- 50 kohm", 1, string_leak_ohm, sound_ohm, 50e3, 1},
                          {"bottom, L- 50 kohm", 0, string_leak_ohm, sound_ohm, 50e3},
                          {"middle, both 50 kohm", 0.5, string_leak_ohm, 50e3, 50e3},
                          {"top, L+ 20 kohm, L- insulated", 1, string_leak_ohm, 20e3, none_ohm},
                          {"three quarters, both 100 kohm", 0.75, string_leak_ohm, 100e3, 100e3}};

struct Weld {
  const char* name;
  std::vector<Relay> contacts;
};
const std::vector<Weld> welds = {{"K1", {Relay::main_plus}},
                                 {"K2", {Relay::main_minus}},
                                 {"K3", {Relay::precharge}},
                                 {"K1 and K2", {Relay::main_plus, Relay::main_minus}}};

constexpr std::uint64_t worlds_each = 8, worlds_of_a_weld = 4;

WiredTruck truck_with(std::size_t cells, const Leak& leak, std::uint64_t seed) {
  plant::TruckParameters world = plant::random_world(seed, {.cells = cells, .divider_tolerance = 0.01});
  world.leaks = {leak.string_ohm, static_cast<std::size_t>(leak.share_below * static_cast<double>(cells) + 0.5),
                 leak.plus_ohm, leak.minus_ohm};
  return WiredTruck(world, false);
}

void weld(WiredTruck& t, const Weld& welded) {
  for (const Relay relay : welded.contacts) t.truck.contactor(relay).set_fault(ContactorFault::welded);
}

int main_closings(const WiredTruck& t, std::size_t from) {
  int count = 0;
  for (std::size_t k = from; k < t.truck.events().size(); ++k) {
    const plant::ContactEvent& e = t.truck.events()[k];
    count += e.closes && (e.relay == Relay::main_plus || e.relay == Relay::main_minus) ? 1 : 0;
  }
  return count;
}

/// Key on and off three times. The pauses are random, so the DC link has any charge at the next start.
bool drives(WiredTruck& t, std::uint64_t seed) {
  plant::Random random(seed);
  for (int start = 0; start < 3; ++start) {
    t.request = Request::drive;
    if (t.until(drive, 8) < 0) return false;
    t.run(1);
    t.request = Request::none;
    if (t.until(off, 3) < 0) return false;
    t.run(0.1 + 30 * random.uniform());
  }
  return !t.any_event();
}

class WithCells : public ::testing::TestWithParam<std::size_t> {};

TEST_P(WithCells, ALeakIsNotTakenForAWeld) {
  for (const Leak& leak : leaks) {
    int drove = 0;
    for (std::uint64_t seed = 1; seed <= worlds_each; ++seed) {
      WiredTruck t = truck_with(GetParam(), leak, seed);
      t.run(0.5);
      drove += drives(t, seed) ? 1 : 0;
      EXPECT_LT(t.worst_closing(Relay::main_plus).across_v, 9.5) << leak.name << ", world " << seed;
    }
    std::printf("%zu cells, leak %s: %d of %d drive three times\n", GetParam(), leak.name, drove,
                static_cast<int>(worlds_each));
    EXPECT_GE(drove + leak.may_stop, static_cast<int>(worlds_each)) << leak.name;
  }
}

/// Welded before the start, and while it drives. In both cases nothing may close on an empty DC link.
TEST_P(WithCells, AWeldIsFoundWithAnyLeak) {
  int found_before = 0, found_after = 0, not_started = 0;
  for (const Weld& welded : welds) {
    for (const Leak& leak : leaks) {
      int before = 0, after = 0;
      for (std::uint64_t seed = 1; seed <= worlds_of_a_weld; ++seed) {
        const std::string where = std::string(welded.name) + ", leak " + leak.name + ", world " + std::to_string(seed);
        WiredTruck t = truck_with(GetParam(), leak, seed);
        weld(t, welded);
        t.run(0.5);
        const std::size_t first = t.truck.events().size();
        t.request = Request::drive;
        t.run(4);
        before += t.fault && t.seen.welded ? 1 : 0;
        EXPECT_EQ(main_closings(t, first), 0) << where;
        if (welded.contacts[0] == Relay::precharge) continue;  // it has opened before the truck drives
        WiredTruck driving = truck_with(GetParam(), leak, seed);
        driving.request = Request::drive;
        if (driving.until(drive, 8) < 0) {
          EXPECT_GT(leak.may_stop, 0) << where;
          ++after;
          ++not_started;
          continue;
        }
        weld(driving, welded);
        driving.run(1);
        driving.request = Request::none;
        driving.run(5);
        driving.request = Request::drive;
        driving.run(4);
        after += driving.fault && driving.seen.welded ? 1 : 0;
        EXPECT_LT(driving.worst_closing(Relay::main_minus).peak_a, 1) << where;
      }
      found_before += before;
      found_after += after;
      EXPECT_EQ(before, static_cast<int>(worlds_of_a_weld)) << welded.name << ", leak " << leak.name;
      if (welded.contacts[0] != Relay::precharge) {
        EXPECT_EQ(after, static_cast<int>(worlds_of_a_weld)) << welded.name << ", leak " << leak.name;
      }
    }
  }
  std::printf("%zu cells: %d welds before the start and %d while driving found, %d of these did not start\n",
              GetParam(), found_before, found_after, not_started);
}
INSTANTIATE_TEST_SUITE_P(WeldsAndLeaks, WithCells, ::testing::Values(8, 16, 24));

}  // namespace
}  // namespace bms::protection
