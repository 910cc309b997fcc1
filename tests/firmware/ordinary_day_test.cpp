// What happens to a truck on an ordinary day needs no workshop: nothing latches, and the driver's next key-on drives.
// The stored faults say what it was.
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/firmware/truck_day.hpp"

namespace bms::firmware {
namespace {

class OrdinaryDay : public ::testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(WithAndWithoutAuxiliaryContacts, OrdinaryDay, ::testing::Bool(),
                         [](const auto& p) { return std::string(p.param ? "With" : "Without"); });

TEST_P(OrdinaryDay, EmergencyStopPressedInDrive) {
  for (const double load_a : {0.0, 8.0, 150.0}) {
    for (const double pressed_s : {0.1, 0.5, 3.0, 60.0}) {
      TruckDay t(GetParam());
      ASSERT_TRUE(t.key_on());
      t.run(5);
      t.load_a = load_a;
      t.run(3);
      t.emergency_stop = true;
      t.run(pressed_s);
      EXPECT_FALSE(t.any_closed());
      t.emergency_stop = false;
      for (int k = 0; k < 50; ++k) {
        t.step();
        ASSERT_FALSE(t.any_closed()) << "never by itself while the key is on";
      }
      EXPECT_EQ(t.last_stored(), "contactor not closed") << load_a << " A for " << pressed_s << " s";
      EXPECT_TRUE(t.next_key_on_drives()) << load_a << " A for " << pressed_s << " s";
      EXPECT_EQ(t.faults(), 0U);
    }
  }
}

TEST_P(OrdinaryDay, EmergencyStopPressedAtKeyOn) {
  for (const double pressed_s : {2.0, 10.0, 600.0}) {
    TruckDay t(GetParam());
    t.emergency_stop = true;
    EXPECT_FALSE(t.key_on(pressed_s));
    EXPECT_EQ(t.last_stored(), "precharge failed") << pressed_s;
    t.emergency_stop = false;
    EXPECT_TRUE(t.next_key_on_drives()) << pressed_s;
    EXPECT_EQ(t.faults(), 0U);
  }
}

/// At any moment from key-on to key-off, of one sample to a second.
TEST_P(OrdinaryDay, SupplyDips) {
  for (double at_s = 0; at_s < 12; at_s += 0.3) {
    for (const int samples : {1, 3, 10}) {
      TruckDay t(GetParam());
      t.key = true;
      for (double s = 0; s < at_s; s += 0.1) {
        t.key = s < 10;
        t.load_a = t.drives() ? 100 : 0;
        t.step();
      }
      t.dip_supply(samples);
      t.run(0.1);
      EXPECT_FALSE(t.any_closed());
      t.run(0.2);
      EXPECT_EQ(t.last_stored(), "supply dip") << at_s;
      EXPECT_TRUE(t.next_key_on_drives()) << at_s << " s, " << samples << " samples";
      EXPECT_EQ(t.faults(), 0U);
    }
  }
}

/// Coils that lose their supply for a moment.
TEST_P(OrdinaryDay, CoilSupplyDips) {
  for (double at_s = 0; at_s < 12; at_s += 0.3) {
    for (const int samples : {1, 2, 5}) {
      TruckDay t(GetParam());
      for (double s = 0; s < at_s; s += 0.1) {
        t.key = s < 10;
        t.load_a = t.drives() ? 100 : 0;
        t.step();
      }
      t.emergency_stop = true;
      t.run(0.1 * samples);
      t.emergency_stop = false;
      t.run(2);
      EXPECT_TRUE(t.next_key_on_drives()) << at_s << " s, " << samples << " samples, " << t.last_stored();
      EXPECT_EQ(t.faults(), 0U);
    }
  }
}

/// 5.6 A count as no current.
TEST_P(OrdinaryDay, KeyOffWithALoadThatGoesOn) {
  for (const double load_a : {5.0, 6.0, 8.0, 10.0}) {
    TruckDay t(GetParam());
    ASSERT_TRUE(t.key_on());
    t.load_a = load_a;
    t.run(5);
    t.key = false;
    double opened_s = 0;
    for (; opened_s < 100 && t.any_closed(); opened_s += 0.1) t.step();
    EXPECT_LE(opened_s, load_a > 5.6 ? 67 : 2) << load_a;
    EXPECT_EQ(t.last_stored(), load_a > 5.6 ? "current unrequested" : "none");
    t.run(60);
    EXPECT_TRUE(t.next_key_on_drives()) << load_a;
    EXPECT_EQ(t.faults(), 0U);
  }
}

/// With 50 ohm no load of constant power above 13 W can be precharged: the truck does not drive before the load is
/// gone.
TEST_P(OrdinaryDay, ALoadDuringPrecharge) {
  for (const double idle_w : {20.0, 30.0, 60.0}) {
    TruckDay t(GetParam());
    for (int attempt = 0; attempt < 4; ++attempt) {
      t.idle_w = idle_w;
      EXPECT_FALSE(t.key_on()) << idle_w;
      EXPECT_EQ(t.last_stored(), "precharge failed") << idle_w;
      t.key = false;
      t.run(11);
    }
    EXPECT_TRUE(t.next_key_on_drives()) << idle_w;
    EXPECT_EQ(t.faults(), 0U);
  }
}

/// A drive from second 1 to 16 with 100 A from second 9 to 13; the charger is plugged in at any moment.
TEST_P(OrdinaryDay, ChargerPluggedInAndOutAtAnyMoment) {
  for (double in_s = 0; in_s < 22; in_s += 0.7) {
    for (const double for_s : {0.8, 4.0, 30.0}) {
      TruckDay t(GetParam());
      for (double s = 0; s < in_s + for_s; s += 0.1) {
        t.key = s >= 1 && s < 16;
        t.load_a = s >= 9 && s < 13 && t.drives() ? 100 : 0;
        t.charger.plugged = s >= in_s;
        t.step();
        ASSERT_FALSE(t.drives() && s > in_s + 2 && s > 14) << "a truck does not drive with its charger";
      }
      t.load_a = 0;
      t.key = false;
      if (for_s == 30) {
        EXPECT_TRUE(t.charges()) << "plugged in at " << in_s;
      }
      t.charger.plugged = false;
      t.run(5);
      EXPECT_FALSE(t.any_closed()) << in_s << ' ' << for_s;
      EXPECT_EQ(t.stored(), 0U) << t.last_stored() << ", plugged in at " << in_s << " for " << for_s;
      EXPECT_TRUE(t.next_key_on_drives()) << in_s << ' ' << for_s;
    }
  }
}

TEST_P(OrdinaryDay, ChargerSwitchedOffBeforeThePlugIsDrawnAndAfterIt) {
  for (const bool before : {true, false}) {
    for (const double apart_s : {0.1, 1.0, 5.0, 100.0}) {
      TruckDay t(GetParam());
      t.charger.plugged = true;
      t.run(30);
      ASSERT_TRUE(t.charges());
      (before ? t.charger.on : t.charger.plugged) = false;
      t.run(apart_s);
      (before ? t.charger.plugged : t.charger.on) = false;
      t.run(10);
      EXPECT_FALSE(t.any_closed());
      EXPECT_EQ(t.stored(), 0U) << t.last_stored();
      EXPECT_TRUE(t.next_key_on_drives()) << before << ' ' << apart_s;
      t.charger = {.plugged = true, .on = true};
      t.key = false;
      t.run(30);
      EXPECT_TRUE(t.charges()) << "the next evening";
    }
  }
}

}  // namespace
}  // namespace bms::firmware
