// The contactors with a simulated DC link: order of the states, precharge, welded contactors.
#include "protection/contactors.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "tests/firmware/protection/contactor_bench.hpp"

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
  EXPECT_NEAR(took_s, 0.5 * std::log(50.0), 0.2) << "an RC needs 3.9 time constants to 98 %";
  EXPECT_EQ(b.contactors.outputs(), (Outputs{.main_plus = true, .main_minus = true, .precharge = true}))
      << "the relay stays closed until main+ has closed";
  b.step();
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

TEST(Precharge, FailsWhenTheDcLinkLeavesItsCurveOrEndsTooFarBelowThePack) {
  struct Case {
    const char* what;
    double time_constant_s, load_fraction;
    bool fails;
    double within_s;
  };
  for (const Case& c : {Case{"as designed", 0.5, 0, false, 2.1},
                        {"a third faster", 0.33, 0, false, 1.5},
                        {"a quarter slower", 0.62, 0, false, 2.6},
                        {"twice as slow", 1, 0, true, 3.6},
                        {"a resistor with a tenth of its value", 0.05, 0, true, 0.2},
                        {"DC link shorted", 0.5, 1, true, 0.5},
                        {"a load that keeps it at half", 0.5, 0.5, true, 1.2},
                        {"a load that keeps it at 6/8: 13.2 V are missing", 0.5, 0.25, true, 3.6},
                        {"a load that keeps it at 7/8: 6.6 V", 0.5, 0.125, false, 3.0}}) {
    ContactorBench b;
    b.time_constant_s = c.time_constant_s;
    b.load_fraction = c.load_fraction;
    b.in.request = Request::drive;
    b.until(precharge, 2);
    const double ended_s = b.until(c.fails ? opening : drive, 6);
    EXPECT_GE(ended_s, 0) << c.what;
    EXPECT_LE(ended_s, c.within_s) << c.what;
    EXPECT_EQ(b.seen.precharge_failed, c.fails) << c.what;
  }
}

TEST(Precharge, ClosesOnALinkThatADriveHoldsAbovePackByHalfTheDifferenceBelowIt) {
  for (const double above : {0.07, 0.1, 0.15}) {
    ContactorBench b;
    b.load_fraction = -above;
    b.dc_link_v = 1e-6 * rested_pack_uv * (1 + above);
    b.discharge_s = 1e6;
    b.in.request = Request::drive;
    const bool closes = above < 0.08;  // 3.7 V, else 5.3 and 7.9 V
    EXPECT_GE(b.until(closes ? drive : opening, 8), 0) << above;
    EXPECT_EQ(b.seen.precharge_failed, !closes) << above;
  }
}

TEST(Precharge, FailsBeforeTheRestIfTheRelayOrItsResistorDoesNotConduct) {
  ContactorBench b;
  b.resistor_open = true;
  b.in.request = Request::drive;
  EXPECT_GE(b.until(opening, 2), 0);
  EXPECT_TRUE(b.seen.precharge_failed);
  EXPECT_LE(b.until(off, 2), 0.5);
}

TEST(Precharge, OfALinkThatIsChargedTakesOneSample) {
  ContactorBench b;
  b.discharge_s = 1'000;
  b.drive_off();
  b.in.request = Request::none;
  ASSERT_LE(b.until(off, 2), 0.6);
  b.in.request = Request::drive;
  ASSERT_GE(b.until(precharge, 2), 0.8);
  EXPECT_NEAR(b.until(drive, 2), 0.1, 0.01);
  EXPECT_FALSE(b.seen.welded || b.seen.precharge_failed || b.seen.not_closed);
}

TEST(Precharge, NeverClosesWithoutAReadingOfTheDcLink) {
  ContactorBench b;
  b.in.request = Request::drive;
  for (int k = 0; k < 100; ++k) {
    b.in.link_plus_uv = b.in.link_minus_uv = measurement::no_reading;
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
    EXPECT_EQ(b.contactors.welded_pole(), which == 1 ? Pole::minus : Pole::plus) << which;
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

TEST(WeldedContactor, IsDetectedAfterTheOpeningByAPoleThatIsHeldWhileTheDcLinkDischarges) {
  for (const int which : {0, 1}) {
    ContactorBench b;
    b.drive_off();
    b.discharge_s = 2;
    (which == 0 ? b.plus_welded : b.minus_welded) = true;
    b.in.request = Request::none;
    b.until(opening, 1);
    EXPECT_FALSE(b.contactors.events().welded) << which;
    b.run(2.5);
    EXPECT_TRUE(b.contactors.events().welded) << which;
    EXPECT_EQ(b.contactors.welded_pole(), which == 0 ? Pole::plus : Pole::minus);
  }
}

/// Then nothing discharges the DC link.
TEST(WeldedContactor, OfBothPolesIsDetectedByTheNextStart) {
  ContactorBench b;
  b.drive_off();
  b.plus_welded = b.minus_welded = true;
  b.in.request = Request::none;
  b.run(60);
  EXPECT_FALSE(b.contactors.events().welded);
  b.in.request = Request::drive;
  EXPECT_GE(b.until(opening, 3), 0);
  EXPECT_TRUE(b.seen.welded);
  EXPECT_EQ(b.contactors.welded_pole(), Pole::unknown);
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
  ContactorBench minus;
  minus.minus_fails = true;
  minus.in.request = Request::drive;
  EXPECT_GE(minus.until(opening, 4), 0);
  EXPECT_TRUE(minus.seen.not_closed);
  EXPECT_FALSE(minus.seen.precharge_failed) << "the cause is main minus";
}

TEST(AuxiliaryContact, ThatIsOpenWhileItsOutputIsOnOpensEverythingAtOnce) {
  for (const bool plus : {true, false}) {
    ContactorBench b;
    b.in.auxiliary = {.fitted = true};
    const auto follow = [&] {
      b.in.auxiliary.main_plus_closed = b.contactors.outputs().main_plus;
      b.in.auxiliary.main_minus_closed = b.contactors.outputs().main_minus;
    };
    b.in.request = Request::drive;
    for (int k = 0; k < 60; ++k) {
      b.step();
      follow();
    }
    ASSERT_EQ(b.contactors.state(), drive);
    b.in.auxiliary = {.fitted = true, .main_plus_closed = !plus, .main_minus_closed = plus};
    b.step();
    EXPECT_EQ(b.contactors.state(), opening);
    EXPECT_EQ(b.contactors.outputs(), Outputs{});
    for (int k = 0; k < 60; ++k) {
      b.step();
      follow();
      EXPECT_TRUE(b.contactors.events().not_closed) << "until the table has it";
      EXPECT_EQ(b.contactors.state(), opening);
    }
    b.in.open_now = true;
    EXPECT_EQ(b.run(0.1), safe);
    EXPECT_FALSE(b.contactors.events().not_closed);
  }
}

TEST(AuxiliaryContact, ThatIsClosedWhileItsOutputIsOffIsAWeld) {
  for (const bool plus : {true, false}) {
    ContactorBench b;
    b.in.auxiliary = {.fitted = true, .main_plus_closed = plus, .main_minus_closed = !plus};
    b.in.request = Request::drive;
    b.run(1);
    EXPECT_EQ(b.contactors.state(), off);
    EXPECT_TRUE(b.contactors.events().welded);
    EXPECT_EQ(b.contactors.welded_pole(), plus ? Pole::plus : Pole::minus);
    b.in.auxiliary.fitted = false;
    b.run(0.1);
    EXPECT_FALSE(b.contactors.events().welded) << "not fitted";
  }
}

TEST(LostContact, OpensFromEveryStateWithAClosedMainContact) {
  for (const ContactorState s : {precharge, drive, unloading}) {
    FedContactors f;
    f.to(s == unloading ? drive : s);
    if (s == unloading) {
      f.in.current_ua = -3'000'000;
      f.to(unloading, Request::none);
    }
    f.in.contact_lost = true;
    EXPECT_EQ(f.step(0.1, rested_pack_uv), opening) << contactor_state_names[static_cast<std::size_t>(s)];
    EXPECT_EQ(f.contactors.outputs(), Outputs{});
    EXPECT_TRUE(f.contactors.events().not_closed);
  }
  FedContactors open;
  open.in.contact_lost = true;
  EXPECT_EQ(open.step(0.1), off) << "without a closed contact it does not matter";
  EXPECT_FALSE(open.contactors.events().not_closed);
}

/// A board with a single switch: no DC link, no precharge.
TEST(ContactorsWithoutDcLink, CloseDirectlyAndShowAWeldByItsCurrent) {
  PackDesign design = forklift;
  design.dc_link = false;
  const ContactorPlan plan = contactor_plan(design);
  for (const Request r : {Request::drive, Request::charge}) {
    FedContactors f(plan);
    f.in.request = r;
    EXPECT_EQ(f.step(0.1, measurement::no_reading), r == Request::drive ? drive : charge);
    EXPECT_EQ(f.contactors.outputs(), (Outputs{.main_plus = true, .main_minus = true})) << "no precharge relay";
    f.step(1, measurement::no_reading);
    EXPECT_EQ(f.contactors.outputs().charge_enable, r == Request::charge);
    f.in.request = Request::none;
    f.step(0.1, measurement::no_reading);
    ASSERT_EQ(f.step(0.1, measurement::no_reading), opening);
    f.in.current_ua = -3'000'000;
    f.step(0.3, measurement::no_reading);
    EXPECT_TRUE(f.welded());
    EXPECT_EQ(f.step(1, measurement::no_reading), opening);
    f.in.current_ua = 0;
    EXPECT_EQ(f.step(0.1, measurement::no_reading), off);
  }
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
