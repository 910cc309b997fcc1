#include "plant/circuit/contactor.hpp"

#include <gtest/gtest.h>

#include <cstdint>

namespace bms::plant {
namespace {

constexpr double step_s = 1e-4;

/// Time until the main contact has the position [s]; negative if it does not within a second.
double time_until(Contactor& contactor, bool closed) {
  for (int k = 0; k < 10'000; ++k) {
    if (contactor.closed() == closed) return k * step_s;
    contactor.advance(step_s);
  }
  return -1;
}

TEST(Contactor, ClosesBouncesAndOpensWithinItsTimes) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    Contactor contactor({}, seed);
    contactor.set_coil_v(12);
    const double closing_s = time_until(contactor, true);
    EXPECT_GE(closing_s, 0.015 - step_s);
    EXPECT_LE(closing_s, 0.030 + step_s);
    int changes = 0;
    bool last = true;
    double last_change_s = 0;
    for (int k = 1; k < 100; ++k) {
      contactor.advance(step_s / 10);
      for (int part = 1; part < 10; ++part) contactor.advance(step_s / 10);
      if (contactor.closed() == last) continue;
      last = contactor.closed();
      ++changes;
      last_change_s = k * step_s;
    }
    EXPECT_TRUE(contactor.closed());
    EXPECT_EQ(changes % 2, 0);
    EXPECT_LE(last_change_s, 0.005 + step_s);
    contactor.set_coil_v(0);
    const double opening_s = time_until(contactor, false);
    EXPECT_GE(opening_s, 0.005 - step_s);
    EXPECT_LE(opening_s, 0.015 + step_s);
  }
}

TEST(Contactor, StaysBetweenDropOutAndPullIn) {
  Contactor contactor({.rated_v = 12, .pull_in_share = 0.7, .drop_out_share = 0.3}, 1);
  contactor.set_coil_v(8.3);  // below 8.4 V
  EXPECT_LT(time_until(contactor, true), 0);
  contactor.set_coil_v(8.5);
  EXPECT_GT(time_until(contactor, true), 0);
  contactor.advance(0.02);
  contactor.set_coil_v(3.7);  // above 3.6 V
  EXPECT_LT(time_until(contactor, false), 0);
  contactor.set_coil_v(3.5);
  EXPECT_GT(time_until(contactor, false), 0);
}

TEST(Contactor, DoesNotMoveWhenTheCoilVoltageReturnsInTime) {
  Contactor contactor({}, 3);
  contactor.set_coil_v(12);
  contactor.advance(0.010);
  contactor.set_coil_v(0);
  EXPECT_LT(time_until(contactor, true), 0);
  contactor.set_coil_v(12);
  time_until(contactor, true);
  contactor.advance(0.02);
  contactor.set_coil_v(0);
  contactor.advance(0.004);  // a supply dip shorter than the opening time
  contactor.set_coil_v(12);
  EXPECT_LT(time_until(contactor, false), 0);
}

TEST(Contactor, HasTheFaultsOfContactors) {
  Contactor welded({}, 1), open_coil({}, 1), no_drop_out({}, 1), no_contact({}, 1), slow({}, 1), stuck({}, 1);
  welded.set_fault(ContactorFault::welded);
  EXPECT_TRUE(welded.closed());
  EXPECT_TRUE(welded.auxiliary_closed());
  open_coil.set_fault(ContactorFault::open_coil);
  open_coil.set_coil_v(12);
  EXPECT_LT(time_until(open_coil, true), 0);
  EXPECT_EQ(open_coil.coil_a(), 0);
  no_drop_out.set_fault(ContactorFault::no_drop_out);
  EXPECT_FALSE(no_drop_out.closed());
  no_drop_out.set_coil_v(12);
  EXPECT_GT(time_until(no_drop_out, true), 0);
  no_drop_out.advance(0.02);
  no_drop_out.set_coil_v(0);
  EXPECT_LT(time_until(no_drop_out, false), 0);
  no_contact.set_fault(ContactorFault::no_contact);
  no_contact.set_coil_v(12);
  EXPECT_LT(time_until(no_contact, true), 0);
  EXPECT_FALSE(no_contact.auxiliary_closed());
  slow.set_slowness(10);
  slow.set_coil_v(12);
  EXPECT_GT(time_until(slow, true), 0.14);
  stuck.set_auxiliary_fault(AuxiliaryFault::stuck_closed);
  EXPECT_TRUE(stuck.auxiliary_closed());
  EXPECT_FALSE(stuck.closed());
}

TEST(Contactor, CurrentOfTheCoilRisesToVoltageOverResistance) {
  Contactor contactor({.coil_ohm = 24, .rated_v = 24}, 1);
  contactor.set_coil_v(24);
  for (int k = 0; k < 1'000; ++k) contactor.advance(step_s);
  EXPECT_NEAR(contactor.coil_a(), 1, 1e-3);
}

}  // namespace
}  // namespace bms::plant
