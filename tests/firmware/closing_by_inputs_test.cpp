// The build of the application with BMS_CLOSES_BY_INPUTS true: key and charger plug request power without a message,
// and without any authority (T-23 of docs/safety/threats.md).
#include <algorithm>
#include <set>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/firmware/truck_day.hpp"

namespace bms::firmware {
namespace {

static_assert(hal::closes_by_inputs && hal::fitted_inputs == 31, "the board of this test (tests/CMakeLists.txt)");

constexpr std::array<std::uint8_t, 16> own_key{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};

/// A product with a key of its own, on a truck whose controller sends nothing.
struct SilentTruck : TruckDay {
  SilentTruck() : TruckDay(true, own_key, hal::fitted_inputs) { talks = false; }
  bool key_drives(double within_s = 10) {
    for (double t = 0; t < within_s && !drives(); t += 0.1) step();
    return drives();
  }
  void stop() { send(can::Stop{}.frame(counter = can::next(counter))); }
  std::uint8_t counter = 0;
};

TEST(ClosingByInputs, TheKeyDrivesAndItsEndOpens) {
  SilentTruck t;
  t.run(5);
  EXPECT_FALSE(t.any_closed()) << "the key is off";
  t.key_input = true;
  ASSERT_TRUE(t.key_drives());
  t.run(60);
  EXPECT_TRUE(t.drives()) << "a level needs no repetition";
  t.key_input = false;
  t.run(2);
  EXPECT_FALSE(t.any_closed());
  EXPECT_EQ(t.stored(), 0U);
}

TEST(ClosingByInputs, AStopOpensUntilTheKeyIsTurned) {
  SilentTruck t;
  t.key_input = true;
  ASSERT_TRUE(t.key_drives());
  t.stop();
  t.run(1);
  EXPECT_FALSE(t.any_closed());
  EXPECT_FALSE(t.key_drives(30)) << "a key that is only left on";
  t.key_input = false;
  t.run(12);
  t.key_input = true;
  EXPECT_TRUE(t.key_drives());
}

/// From before the first request through self-test, precharge and closed contactors to an emergency stop. Sent once, or
/// with every sample.
TEST(ClosingByInputs, AStopInEveryStateStandsUntilKeyOrPlugWasOff) {
  using State = can::ContactorState;
  for (const bool plug : {false, true}) {
    std::set<std::uint32_t> states;
    int cases = 0, slowest = 0;
    for (const bool once : {true, false}) {
      for (int at = 1; at < 130; ++at) {
        SilentTruck t;
        bool& input = plug ? t.seen_plug : t.key_input;
        input = true;
        for (int k = 0; k < at; ++k) {
          t.emergency_stop = k >= 100 && k < 103;
          t.step();
        }
        t.emergency_stop = false;
        states.insert(t.state());
        ++cases;
        for (int k = 0; k < 300; ++k) {
          if (k == 0 || !once) t.stop();
          t.step();
          if (t.any_closed()) slowest = std::max(slowest, k + 1);
          ASSERT_LE(slowest, 3) << at << ": closed " << 0.1 * k << " s after a stop";
        }
        if (at % 10 != 0 || at >= 100) continue;
        input = false;
        t.run(6);
        input = true;
        t.run(10);
        ASSERT_TRUE(plug ? t.charges() : t.drives()) << at << ": it was off and is on again";
      }
    }
    fmt::print("{}: {} stops in {} states, contacts open within {:.1f} s\n", plug ? "plug" : "key", cases,
               states.size(), 0.1 * slowest);
    for (const std::uint32_t state : {State::state_off, State::state_self_test, State::state_precharge,
                                      plug ? State::state_charge : State::state_drive})
      EXPECT_TRUE(states.contains(state)) << state;
  }
}

TEST(ClosingByInputs, ThePlugChargesAndKeepsTheKeyFromDriving) {
  SilentTruck t;
  t.seen_plug = true;
  t.run(10);
  EXPECT_TRUE(t.charges());
  t.key_input = true;
  t.run(10);
  EXPECT_FALSE(t.drives());
  t.seen_plug = false;
  t.run(12);
  EXPECT_TRUE(t.drives());
}

TEST(ClosingByInputs, AFaultAndAnEmergencyStopWinAgainstTheKey) {
  SilentTruck t;
  t.key_input = true;
  ASSERT_TRUE(t.key_drives());
  t.interlock = false;
  t.run(8);
  EXPECT_FALSE(t.any_closed());
  EXPECT_EQ(t.last_stored(), "interlock open");
  t.interlock = true;
  t.run(15);
  EXPECT_FALSE(t.any_closed()) << "until the key is turned";
  t.key_input = false;
  t.run(12);
  t.key_input = true;
  ASSERT_TRUE(t.key_drives());
  t.emergency_stop = true;
  t.run(0.3);
  EXPECT_FALSE(t.any_closed());
}

}  // namespace
}  // namespace bms::firmware
