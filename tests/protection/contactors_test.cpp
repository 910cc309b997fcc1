// The contactors with a simulated DC link: order of the states, precharge, welded contactors.
#include "protection/contactors.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/protection/contactor_bench.hpp"

namespace bms::protection {
namespace {

using enum ContactorState;

TEST(Contactors, StartOffWithEverythingOpen) {
  ContactorBench b;
  EXPECT_EQ(b.run(5), off);
  EXPECT_FALSE(b.contactors.outputs().any_closed());
  EXPECT_FALSE(b.contactors.events().welded);
}

TEST(Contactors, FromOffToSelfTestToPrechargeToDriveOnTheRequestOfATruck) {
  ContactorBench b;
  b.in.request = Request::drive;
  b.step();
  EXPECT_EQ(b.contactors.state(), self_test);
  EXPECT_EQ(b.contactors.outputs(), Outputs{});
  b.run(0.3);
  EXPECT_EQ(b.contactors.outputs(), (Outputs{.precharge = true})) << "the precharge relay alone";
  b.run(0.3);
  EXPECT_EQ(b.contactors.outputs(), (Outputs{.main_minus = true})) << "main- alone";
  EXPECT_GE(b.until(precharge, 1), 0.2);
  EXPECT_EQ(b.contactors.outputs(), (Outputs{.main_minus = true, .precharge = true}));
  const double took_s = b.until(drive, 5);
  EXPECT_NEAR(took_s, 0.5 * std::log(16.0), 0.2) << "an RC needs 2.8 time constants to 15/16";
  EXPECT_EQ(b.contactors.outputs(), (Outputs{.main_plus = true, .main_minus = true}));
}

TEST(Contactors, EnableTheChargerOnlyInChargeAndOnlyWhileChargingIsAllowed) {
  ContactorBench b;
  b.drive_off(Request::charge);
  ASSERT_EQ(b.contactors.state(), charge);
  EXPECT_TRUE(b.contactors.outputs().charge_enable);
  b.in.charge_forbidden = true;
  b.step();
  EXPECT_EQ(b.contactors.state(), charge);
  EXPECT_FALSE(b.contactors.outputs().charge_enable);
  b.in.charge_forbidden = false;
  b.step();
  EXPECT_TRUE(b.contactors.outputs().charge_enable);
  ContactorBench truck;
  truck.drive_off();
  EXPECT_FALSE(truck.contactors.outputs().charge_enable);
}

TEST(Contactors, FromDriveToUnloadingToOpeningToOffWhenTheRequestEnds) {
  ContactorBench b;
  b.drive_off();
  b.load_a = -3;
  b.run(1);
  b.in.request = Request::none;
  b.step();
  EXPECT_EQ(b.contactors.state(), unloading);
  EXPECT_EQ(b.run(60), unloading) << "a withdrawn request does not open under load";
  EXPECT_TRUE(b.closed);
  b.load_a = -0.05;
  b.run(0.2);
  EXPECT_EQ(b.contactors.state(), opening);
  EXPECT_FALSE(b.contactors.outputs().any_closed());
  b.load_a = 0;
  EXPECT_GE(b.until(off, 6), 0.3);
  EXPECT_FALSE(b.seen.welded);
}

TEST(Contactors, ChangeFromDriveToChargeThroughOff) {
  ContactorBench b;
  b.drive_off();
  b.in.request = Request::charge;
  EXPECT_GE(b.until(unloading, 1), 0);
  EXPECT_GE(b.until(off, 6), 0);
  EXPECT_GE(b.until(charge, 6), 0);
}

TEST(Contactors, AtAFaultThatOpensWaitFiveSecondsForTheLoadThenOpenUnderIt) {
  ContactorBench b;
  b.drive_off();
  b.load_a = -3;
  b.run(1);
  b.in.open = true;
  b.step();
  EXPECT_EQ(b.contactors.state(), unloading);
  EXPECT_NEAR(b.until(opening, 10), 5.0, 0.11);
  b.load_a = 0;
  EXPECT_GE(b.until(safe, 6), 0);
}

TEST(Contactors, DoNotRestartTheGraceTimeForASecondReason) {
  ContactorBench b;
  b.drive_off();
  b.load_a = -3;
  b.in.discharge_forbidden = true;
  EXPECT_EQ(b.run(3), drive);
  b.in.open = true;
  b.step();
  EXPECT_EQ(b.contactors.state(), unloading);
  EXPECT_NEAR(b.until(opening, 10), 2.0, 0.21) << "three of five seconds were used";
}

TEST(Contactors, AtASevereFaultOpenWithinTheSameStepUnderAnyCurrent) {
  for (const Request r : {Request::drive, Request::charge}) {
    ContactorBench b;
    b.drive_off(r);
    b.load_a = r == Request::drive ? -30 : 6;
    b.run(1);
    ASSERT_TRUE(b.contactors.outputs().main_plus);
    b.in.open_now = true;
    b.contactors.update(b.in);
    EXPECT_EQ(b.contactors.state(), opening);
    EXPECT_EQ(b.contactors.outputs(), Outputs{});
  }
}

TEST(Contactors, OpenAfterFiveSecondsOfForbiddenCurrentAndNotBefore) {
  for (const double load_a : {-3.0, 3.0}) {
    ContactorBench b;
    b.drive_off();
    b.load_a = load_a;
    (load_a < 0 ? b.in.discharge_forbidden : b.in.charge_forbidden) = true;
    EXPECT_NEAR(b.until(opening, 20), 5.0, 0.21) << load_a;
  }
  ContactorBench other_way;
  other_way.drive_off();
  other_way.load_a = -3;
  other_way.in.charge_forbidden = true;
  EXPECT_EQ(other_way.run(30), drive) << "a current that is not forbidden may flow";
}

TEST(Contactors, DoNotCloseForATruckWithoutDischargeNorForAChargerWithoutCharge) {
  for (const Request r : {Request::drive, Request::charge}) {
    ContactorBench b;
    b.in.request = r;
    b.in.discharge_forbidden = r == Request::drive;
    b.in.charge_forbidden = r == Request::charge;
    EXPECT_EQ(b.run(5), off);
    b.in.discharge_forbidden = b.in.charge_forbidden = false;
    EXPECT_GE(b.until(r == Request::drive ? drive : charge, 5), 0);
  }
}

TEST(Contactors, FromEveryStateEndInSafeAtAFaultAndLeaveItOnlyWithoutFaultAndRequest) {
  ContactorBench b;
  b.in.open = true;
  EXPECT_EQ(b.run(0.1), safe) << "from off";
  ContactorBench testing;
  testing.in.request = Request::drive;
  testing.run(0.4);
  ASSERT_EQ(testing.contactors.state(), self_test);
  testing.in.open = true;
  EXPECT_GE(testing.until(safe, 6), 0) << "from the self-test";
  ContactorBench charging;
  charging.in.request = Request::drive;
  charging.until(precharge, 2);
  charging.run(0.3);
  charging.in.open_now = true;
  EXPECT_GE(charging.until(safe, 6), 0) << "from precharge";
  charging.in.open_now = false;
  EXPECT_EQ(charging.run(10), safe) << "the request is still active";
  charging.in.request = Request::none;
  EXPECT_EQ(charging.run(0.1), off);
}

TEST(Contactors, CloseAgainOnlyOnANewRequest) {
  ContactorBench b;
  b.drive_off();
  b.load_a = -3;
  b.in.discharge_forbidden = true;
  b.until(opening, 10);
  b.in.discharge_forbidden = false;
  b.load_a = 0;
  EXPECT_GE(b.until(off, 10), 0);
  EXPECT_EQ(b.run(30), off);
  b.in.request = Request::none;
  b.step();
  b.in.request = Request::drive;
  EXPECT_GE(b.until(drive, 5), 0);
}

TEST(Contactors, OpenWhenTheRequestEndsDuringTestOrPrecharge) {
  for (const double after_s : {0.2, 0.5, 0.8, 1.5}) {
    ContactorBench b;
    b.in.request = Request::drive;
    b.run(after_s);
    b.in.request = Request::none;
    b.step();
    EXPECT_EQ(b.contactors.state(), opening) << after_s;
    EXPECT_EQ(b.contactors.outputs(), Outputs{});
  }
}

TEST(Precharge, FailsAtOnceWhenTheDcLinkIsSlowerThanItsCurve) {
  struct Case {
    const char* what;
    double time_constant_s, load_fraction;
    bool fails;
  };
  for (const Case& c : {Case{"as designed", 0.5, 0, false},
                        {"a third faster", 0.33, 0, false},
                        {"a quarter slower", 0.62, 0, false},
                        {"twice as slow", 1, 0, true},
                        {"DC link shorted", 0.5, 1, true},
                        {"a load that keeps it at half", 0.5, 0.5, true},
                        {"a load that keeps it at 7/8", 0.5, 0.125, true}}) {
    ContactorBench b;
    b.time_constant_s = c.time_constant_s;
    b.load_fraction = c.load_fraction;
    b.in.request = Request::drive;
    b.until(precharge, 2);
    const double ended_s = b.until(c.fails ? opening : drive, 6);
    EXPECT_GE(ended_s, 0) << c.what;
    EXPECT_EQ(b.seen.precharge_failed, c.fails) << c.what;
    if (c.fails) {
      EXPECT_LE(ended_s, 3.1) << c.what << ": six time constants";
    }
    if (c.load_fraction >= 1) {
      EXPECT_LE(ended_s, 0.5) << "a short circuit is detected after half a time constant";
    }
  }
}

TEST(Precharge, NeverClosesWithoutAReadingOfTheDcLink) {
  ContactorBench b;
  b.in.request = Request::drive;
  for (int k = 0; k < 100; ++k) {
    b.in.dc_link_uv = measurement::no_reading;
    b.contactors.update(b.in);
    b.seen.precharge_failed = b.seen.precharge_failed || b.contactors.events().precharge_failed;
    ASSERT_FALSE(b.contactors.outputs().main_plus);
  }
  EXPECT_TRUE(b.seen.precharge_failed);
}

TEST(WeldedContactor, IsDetectedByTheSelfTestBeforeTheOtherPoleCloses) {
  for (const int which : {0, 1, 2}) {
    ContactorBench b;
    b.plus_welded = which == 0;
    b.minus_welded = which == 1;
    b.precharge_welded = which == 2;
    b.in.request = Request::drive;
    EXPECT_GE(b.until(opening, 3), 0) << which;
    EXPECT_TRUE(b.seen.welded) << which;
    EXPECT_FALSE(b.contactors.outputs().any_closed());
  }
}

TEST(WeldedContactor, DetectedByTheSelfTestIsReportedUntilTheNextStart) {
  ContactorBench b;
  b.plus_welded = true;
  b.in.request = Request::drive;
  ASSERT_GE(b.until(opening, 3), 0);
  for (int k = 0; k < 300; ++k) {
    ASSERT_TRUE(b.contactors.events().welded) << k << ": two samples are needed to raise the fault";
    b.step();
  }
}

TEST(WeldedContactor, IsNotReportedForAnUnknownCurrent) {
  ContactorBench b;
  b.drive_off();
  b.in.request = Request::none;
  for (int k = 0; k < 40; ++k) {  // four seconds, in which the DC link falls
    b.step();
    b.in.current_ua = measurement::no_reading;
    ASSERT_FALSE(b.contactors.events().welded) << k;
  }
}

TEST(WeldedContactor, IsDetectedAtOpeningByADcLinkThatDoesNotFall) {
  ContactorBench b;
  b.drive_off();
  b.plus_welded = b.minus_welded = true;
  b.in.request = Request::none;
  b.until(opening, 1);
  EXPECT_EQ(b.until(off, 4.8), -1);
  EXPECT_FALSE(b.seen.welded) << "the DC link may still fall";
  b.run(0.5);
  EXPECT_TRUE(b.contactors.events().welded);
  EXPECT_EQ(b.run(60), opening) << "not off while the DC link stays up";
  b.in.open_now = true;  // the reaction of the table
  EXPECT_EQ(b.run(0.1), safe);
  b.run(6);
  EXPECT_TRUE(b.contactors.events().welded) << "still reported in safe";
}

TEST(WeldedContactor, IsDetectedWithinHalfASecondByCurrentWhileOpen) {
  ContactorBench b;
  b.drive_off();
  b.load_a = -3;
  b.plus_welded = b.minus_welded = true;
  b.run(1);
  b.in.open_now = true;
  b.run(0.5);
  EXPECT_TRUE(b.contactors.events().welded);
  ContactorBench idle;
  idle.in.current_ua = -500'000;
  idle.contactors.update(idle.in);
  EXPECT_TRUE(idle.contactors.events().welded) << "current in off";
}

TEST(Contactor, ThatDoesNotCloseIsDetectedByTheDcLink) {
  ContactorBench b;
  b.drive_off();
  EXPECT_FALSE(b.contactors.events().not_closed);
  b.plus_fails = true;
  b.load_a = -3;
  b.run(0.3);
  EXPECT_TRUE(b.contactors.events().not_closed);
}

TEST(ContactorTimes, AreRightForAnyDurationOfAState) {
  ContactorBench b;
  b.in.step_us = 60'000'000;
  for (int k = 0; k < 200; ++k) b.step();  // 3.3 hours in off, 2.8 times 2^32 us
  b.in.step_us = 100'000;
  b.drive_off();
  EXPECT_EQ(b.contactors.state(), drive);
  for (int k = 0; k < 200; ++k) {
    b.in.step_us = 60'000'000;
    b.step();
    ASSERT_EQ(b.contactors.state(), drive);
  }
  b.in.step_us = 100'000;
  b.load_a = -3;
  b.in.open = true;
  b.step();
  b.step();
  EXPECT_NEAR(b.until(opening, 10), 5.0, 0.21);
}

}  // namespace
}  // namespace bms::protection
