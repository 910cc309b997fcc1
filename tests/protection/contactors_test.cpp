#include "protection/contactors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "tests/protection/expected_rows.hpp"

namespace bms::protection {

void PrintTo(ContactorState s, std::ostream* out) { *out << contactor_state_names[static_cast<std::size_t>(s)]; }

namespace {

using enum ContactorState;
constexpr ContactorPlan pack =
    contactor_plan(forklift);  // test part 0.3 s, half time constant 0.25 s, link 5 s, rest 0.12 A
constexpr std::int32_t pack_uv = 52'800'000;

/// Contactors between a pack and a link: resistor of 50 ohm, 10 mF, a bleeder. What is welded or does not close does so
/// whatever it is told.
struct Bench {
  Contactors contactors{pack};
  ContactorInput in{.request = Request::none, .current_ua = 0, .pack_uv = pack_uv, .dc_link_uv = 0, .step_us = 100'000};
  double dc_link_v = 0, load_a = 0, time_constant_s = 0.5, discharge_s = 3, link_short = 0;
  bool plus_welded = false, minus_welded = false, precharge_welded = false, plus_fails = false;

  void step() {
    const Outputs out = contactors.update(in);
    const bool plus = (out.main_plus && !plus_fails) || plus_welded, minus = out.main_minus || minus_welded,
               relay = out.precharge || precharge_welded;
    const double step_s = in.step_us / 1e6, pack_v = pack_uv / 1e6;
    double current_a = 0;
    if (plus && minus) {
      dc_link_v = pack_v;
      current_a = load_a;
    } else if (relay && minus) {
      const double end_v = pack_v * (1 - link_short);
      dc_link_v += (end_v - dc_link_v) * (1 - std::exp(-step_s / time_constant_s));
    } else {
      dc_link_v *= std::exp(-step_s / discharge_s);
      if (load_a < 0) dc_link_v *= 0.8;
    }
    in.dc_link_uv = static_cast<std::int32_t>(1e6 * dc_link_v);
    in.current_ua = static_cast<std::int32_t>(1e6 * current_a);
    closed = plus && minus;
  }
  ContactorState run(double seconds) {
    for (double t = 0; t < seconds - 1e-9; t += in.step_us / 1e6) step();
    return contactors.state();
  }
  /// Until that state is reached; the time it took, or -1.
  double until(ContactorState s, double most_s) {
    for (double t = 0; t <= most_s; t += in.step_us / 1e6) {
      if (contactors.state() == s) return t;
      step();
      seen.welded = seen.welded || contactors.events().welded;
      seen.precharge_failed = seen.precharge_failed || contactors.events().precharge_failed;
    }
    return -1;
  }
  void drive_off(Request r = Request::drive) {
    in.request = r;
    until(r == Request::drive ? drive : charge, 10);
    run(1);
  }
  bool closed = false;
  ContactorEvents seen;
};

TEST(Contactors, StartOffWithEverythingOpen) {
  Bench b;
  EXPECT_EQ(b.run(5), off);
  EXPECT_FALSE(b.contactors.outputs().any_closed());
  EXPECT_FALSE(b.contactors.events().welded);
}

TEST(Contactors, FromOffToSelfTestToPrechargeToDriveWhenATruckAsks) {
  Bench b;
  b.in.request = Request::drive;
  b.step();
  EXPECT_EQ(b.contactors.state(), self_test);
  EXPECT_EQ(b.contactors.outputs(), Outputs{});
  b.run(0.3);
  EXPECT_EQ(b.contactors.outputs(), (Outputs{.precharge = true})) << "the relay alone";
  b.run(0.3);
  EXPECT_EQ(b.contactors.outputs(), (Outputs{.main_minus = true})) << "main- alone";
  EXPECT_GE(b.until(precharge, 1), 0.2);
  EXPECT_EQ(b.contactors.outputs(), (Outputs{.main_minus = true, .precharge = true}));
  const double took_s = b.until(drive, 5);
  EXPECT_NEAR(took_s, 0.5 * std::log(16.0), 0.2) << "an RC needs 2.8 time constants to 15/16";
  EXPECT_EQ(b.contactors.outputs(), (Outputs{.main_plus = true, .main_minus = true}));
}

TEST(Contactors, EnableTheChargerOnlyInChargeAndOnlyWhileChargingIsAllowed) {
  Bench b;
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
  Bench truck;
  truck.drive_off();
  EXPECT_FALSE(truck.contactors.outputs().charge_enable);
}

TEST(Contactors, FromDriveToUnloadingToOpeningToOffWhenNobodyAsks) {
  Bench b;
  b.drive_off();
  b.load_a = -3;
  b.run(1);
  b.in.request = Request::none;
  b.step();
  EXPECT_EQ(b.contactors.state(), unloading);
  EXPECT_EQ(b.run(60), unloading) << "a load is not opened just because the key is off";
  EXPECT_TRUE(b.closed);
  b.load_a = -0.05;
  b.run(0.2);
  EXPECT_EQ(b.contactors.state(), opening);
  EXPECT_FALSE(b.contactors.outputs().any_closed());
  b.load_a = 0;
  EXPECT_GE(b.until(off, 6), 0.3);
  EXPECT_FALSE(b.seen.welded);
}

TEST(Contactors, ChangeFromDriveToChargeByWayOfOff) {
  Bench b;
  b.drive_off();
  b.in.request = Request::charge;
  EXPECT_GE(b.until(unloading, 1), 0);
  EXPECT_GE(b.until(off, 6), 0);
  EXPECT_GE(b.until(charge, 6), 0);
}

TEST(Contactors, OfAFaultThatOpensWaitFiveSecondsForTheLoadThenOpenUnderIt) {
  Bench b;
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

TEST(Contactors, OfASecondReasonGiveNoSecondTimeOfGrace) {
  Bench b;
  b.drive_off();
  b.load_a = -3;
  b.in.discharge_forbidden = true;
  EXPECT_EQ(b.run(3), drive);
  b.in.open = true;
  b.step();
  EXPECT_EQ(b.contactors.state(), unloading);
  EXPECT_NEAR(b.until(opening, 10), 2.0, 0.21) << "of five seconds three were over";
}

TEST(Contactors, OfASevereFaultOpenWithinTheSameStepWhateverFlows) {
  for (const Request r : {Request::drive, Request::charge}) {
    Bench b;
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

TEST(Contactors, OpenWhenCurrentThatIsForbiddenFlowsForFiveSecondsAndNotBefore) {
  for (const double load_a : {-3.0, 3.0}) {
    Bench b;
    b.drive_off();
    b.load_a = load_a;
    (load_a < 0 ? b.in.discharge_forbidden : b.in.charge_forbidden) = true;
    EXPECT_NEAR(b.until(opening, 20), 5.0, 0.21) << load_a;
  }
  Bench other_way;
  other_way.drive_off();
  other_way.load_a = -3;
  other_way.in.charge_forbidden = true;
  EXPECT_EQ(other_way.run(30), drive) << "what is not forbidden may flow";
}

TEST(Contactors, AreNotClosedForATruckWithoutDischargeNorForAChargerWithoutCharge) {
  for (const Request r : {Request::drive, Request::charge}) {
    Bench b;
    b.in.request = r;
    b.in.discharge_forbidden = r == Request::drive;
    b.in.charge_forbidden = r == Request::charge;
    EXPECT_EQ(b.run(5), off);
    b.in.discharge_forbidden = b.in.charge_forbidden = false;
    EXPECT_GE(b.until(r == Request::drive ? drive : charge, 5), 0);
  }
}

TEST(Contactors, FromAnywhereWithAFaultEndInSafeAndLeaveItForOffOnlyWithoutFaultAndRequest) {
  Bench b;
  b.in.open = true;
  EXPECT_EQ(b.run(0.1), safe) << "from off";
  Bench testing;
  testing.in.request = Request::drive;
  testing.run(0.4);
  ASSERT_EQ(testing.contactors.state(), self_test);
  testing.in.open = true;
  EXPECT_GE(testing.until(safe, 6), 0) << "from the self-test";
  Bench charging;
  charging.in.request = Request::drive;
  charging.until(precharge, 2);
  charging.run(0.3);
  charging.in.open_now = true;
  EXPECT_GE(charging.until(safe, 6), 0) << "from pre-charge";
  charging.in.open_now = false;
  EXPECT_EQ(charging.run(10), safe) << "the request is still there";
  charging.in.request = Request::none;
  EXPECT_EQ(charging.run(0.1), off);
}

TEST(Contactors, CloseAgainOnlyWhenAskedAnew) {
  Bench b;
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

TEST(Contactors, OpenWhenTheRequestGoesDuringTestOrPrecharge) {
  for (const double after_s : {0.2, 0.5, 0.8, 1.5}) {
    Bench b;
    b.in.request = Request::drive;
    b.run(after_s);
    b.in.request = Request::none;
    b.step();
    EXPECT_EQ(b.contactors.state(), opening) << after_s;
    EXPECT_EQ(b.contactors.outputs(), Outputs{});
  }
}

TEST(Precharge, FailsAtOnceWhenTheLinkIsSlowerThanItsCurveAllows) {
  struct Case {
    const char* what;
    double time_constant_s, link_short;
    bool fails;
  };
  for (const Case& c : {Case{"as designed", 0.5, 0, false},
                        {"a third faster", 0.33, 0, false},
                        {"a quarter slower", 0.62, 0, false},
                        {"twice as slow", 1, 0, true},
                        {"link shorted", 0.5, 1, true},
                        {"a load that holds it at half", 0.5, 0.5, true},
                        {"a load that holds it at 7/8", 0.5, 0.125, true}}) {
    Bench b;
    b.time_constant_s = c.time_constant_s;
    b.link_short = c.link_short;
    b.in.request = Request::drive;
    b.until(precharge, 2);
    const double ended_s = b.until(c.fails ? opening : drive, 6);
    EXPECT_GE(ended_s, 0) << c.what;
    EXPECT_EQ(b.seen.precharge_failed, c.fails) << c.what;
    if (c.fails) {
      EXPECT_LE(ended_s, 3.1) << c.what << ": six time constants";
    }
    if (c.link_short >= 1) {
      EXPECT_LE(ended_s, 0.5) << "a short is seen by half a time constant";
    }
  }
}

TEST(Precharge, WithoutAReadingOfTheLinkNeverCloses) {
  Bench b;
  b.in.request = Request::drive;
  for (int k = 0; k < 100; ++k) {
    b.in.dc_link_uv = measurement::no_reading;
    b.contactors.update(b.in);
    b.seen.precharge_failed = b.seen.precharge_failed || b.contactors.events().precharge_failed;
    ASSERT_FALSE(b.contactors.outputs().main_plus);
  }
  EXPECT_TRUE(b.seen.precharge_failed);
}

TEST(WeldedContactor, IsFoundByTheSelfTestBeforeTheOtherPoleCloses) {
  for (const int which : {0, 1, 2}) {
    Bench b;
    (which == 0 ? b.plus_welded : which == 1 ? b.minus_welded : b.precharge_welded) = true;
    b.in.request = Request::drive;
    EXPECT_GE(b.until(opening, 3), 0) << which;
    EXPECT_TRUE(b.seen.welded) << which;
    EXPECT_FALSE(b.contactors.outputs().any_closed());
  }
}

TEST(WeldedContactor, FoundByTheSelfTestIsSaidUntilTheNextStart) {
  Bench b;
  b.plus_welded = true;
  b.in.request = Request::drive;
  ASSERT_GE(b.until(opening, 3), 0);
  for (int k = 0; k < 300; ++k) {
    ASSERT_TRUE(b.contactors.events().welded) << k << ": a fault that needs two samples has to see more than one";
    b.step();
  }
}

TEST(WeldedContactor, IsNotWhatACurrentThatIsNotKnownMeans) {
  Bench b;
  b.drive_off();
  b.in.request = Request::none;
  for (int k = 0; k < 40; ++k) {  // four seconds; the link has fallen by then
    b.step();
    b.in.current_ua = measurement::no_reading;
    ASSERT_FALSE(b.contactors.events().welded) << k;
  }
}

TEST(WeldedContactor, IsFoundAtOpeningByALinkThatDoesNotFall) {
  Bench b;
  b.drive_off();
  b.plus_welded = b.minus_welded = true;
  b.in.request = Request::none;
  b.until(opening, 1);
  EXPECT_EQ(b.until(off, 4.8), -1);
  EXPECT_FALSE(b.seen.welded) << "it may still fall";
  b.run(0.5);
  EXPECT_TRUE(b.contactors.events().welded);
  EXPECT_EQ(b.run(60), opening) << "never off with a link that stands";
  b.in.open_now = true;  // what the table makes of it
  EXPECT_EQ(b.run(0.1), safe);
  EXPECT_EQ((b.run(6), b.contactors.events().welded), true) << "still said in safe";
}

TEST(WeldedContactor, IsFoundWithinHalfASecondByCurrentWhileOpen) {
  Bench b;
  b.drive_off();
  b.load_a = -3;
  b.plus_welded = b.minus_welded = true;
  b.run(1);
  b.in.open_now = true;
  b.run(0.5);
  EXPECT_TRUE(b.contactors.events().welded);
  Bench idle;
  idle.in.current_ua = -500'000;
  idle.contactors.update(idle.in);
  EXPECT_TRUE(idle.contactors.events().welded) << "current in off";
}

TEST(Contactor, ThatDoesNotCloseIsToldByTheLink) {
  Bench b;
  b.drive_off();
  EXPECT_FALSE(b.contactors.events().not_closed);
  b.plus_fails = true;
  b.load_a = -3;
  b.run(0.3);
  EXPECT_TRUE(b.contactors.events().not_closed);
}

TEST(ContactorTimes, HoldAcrossAnyLengthOfAState) {
  Bench b;
  b.in.step_us = 60'000'000;
  for (int k = 0; k < 200; ++k) b.step();  // 3.3 hours in off: 2.8 times 2^32 us
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

// ---- to the last digit: readings by hand

/// Contactors that read what they are given.
struct Fed {
  explicit Fed(const ContactorPlan& plan = pack) : contactors(plan) {}
  ContactorState step(double seconds, std::int32_t dc_link_uv = 0) {
    in.step_us = static_cast<std::uint32_t>(std::lround(1e6 * seconds));
    in.dc_link_uv = dc_link_uv;
    contactors.update(in);
    return contactors.state();
  }
  /// With a link that does as it should.
  Fed& to(ContactorState s, Request r = Request::drive) {
    in.request = r;
    for (int k = 0; k < 1'000 && contactors.state() != s; ++k)
      step(0.1, contactors.state() == precharge ? pack_uv : contactors.outputs().main_plus ? pack_uv : 0);
    EXPECT_EQ(contactors.state(), s);
    return *this;
  }
  bool welded() const { return contactors.events().welded; }

  Contactors contactors;
  ContactorInput in{.request = Request::none, .current_ua = 0, .pack_uv = pack_uv, .dc_link_uv = 0, .step_us = 0};
};
constexpr std::int32_t eighth_uv = pack_uv / 8, sixteenth_uv = pack_uv / 16;

TEST(WeldedContactor, IsWhatRaisesTheLinkByAnEighthAboveTheLowestOfTheSelfTest) {
  for (const std::int32_t rise_uv : {eighth_uv, eighth_uv + 1}) {
    Fed f;
    f.in.request = Request::drive;
    // the link still falls from the last drive
    for (const std::int32_t dc_link_uv : {40'000'000, 35'000'000, 30'000'000, 25'000'000})
      EXPECT_EQ(f.step(0.1, dc_link_uv), self_test);
    // one reading missing, whichever: neither a weld nor forgotten
    f.step(0.1, measurement::no_reading);
    EXPECT_FALSE(f.welded());
    f.in.pack_uv = measurement::no_reading;
    f.step(0.05, 0);
    f.in.pack_uv = pack_uv;
    f.in.current_ua = measurement::no_reading;
    f.step(0.05, 0);
    f.in.current_ua = 0;
    EXPECT_EQ(f.step(0.1, 26'000'000), self_test) << "a little noise";
    EXPECT_EQ(f.step(0.1, 25'000'000 + rise_uv), rise_uv > eighth_uv ? opening : self_test);
    EXPECT_EQ(f.welded(), rise_uv > eighth_uv);
  }
}

TEST(WeldedContactor, WhileAllIsOpenIsAnySevenEighthsOnTheLinkAndAnyCurrentAboveRest) {
  struct Case {
    std::int32_t dc_link_uv, current_ua, pack_uv;
    bool welded;
  };
  for (const Case& c : {Case{7 * eighth_uv - 1, 0, pack_uv, false},
                        {7 * eighth_uv, 0, pack_uv, true},
                        {0, 120'000, pack_uv, false},
                        {0, -120'000, pack_uv, false},
                        {0, 120'001, pack_uv, true},
                        {0, -120'001, pack_uv, true},
                        {measurement::no_reading, 0, pack_uv, false},
                        {pack_uv, 0, measurement::no_reading, false},
                        {0, 0, 0, false},
                        {1, 0, 1, true}}) {
    Fed f;
    f.in.current_ua = c.current_ua;
    f.in.pack_uv = c.pack_uv;
    f.step(0.1, c.dc_link_uv);
    EXPECT_EQ(f.welded(), c.welded) << c.dc_link_uv << ' ' << c.current_ua << ' ' << c.pack_uv;
    f.in.request = Request::drive;
    EXPECT_EQ(f.step(0.1, c.dc_link_uv), c.welded ? off : self_test) << "what is welded is not tested";
  }
}

TEST(Contactors, TakeTheirTimesFromThePack) {
  EXPECT_EQ(pack.test_us, 300'000U) << "three samples";
  EXPECT_EQ(pack.half_time_constant_us, 250'000U);
  EXPECT_EQ(pack.dc_link_discharge_us, 5'000'000U);
  EXPECT_EQ(pack.rest_ua, 120'000);
  Fed f;
  f.in.request = Request::drive;
  EXPECT_EQ(f.step(0.1), self_test);
  for (const Outputs& part : {Outputs{}, Outputs{.precharge = true}, Outputs{.main_minus = true}}) {
    EXPECT_EQ(f.contactors.outputs(), part);
    f.step(0.299'999);
    EXPECT_EQ(f.contactors.outputs(), part);
    f.step(0.000'001);
  }
  EXPECT_EQ(f.contactors.state(), precharge);
  f.step(0.1, pack_uv);
  f.in.request = Request::none;
  f.step(0.1, pack_uv);
  ASSERT_EQ(f.step(0.1, pack_uv), opening);
  EXPECT_EQ(f.step(0.299'999, 0), opening) << "a link that has fallen at once has to stay down for a moment";
  EXPECT_EQ(f.step(0.000'001, 0), off);
  Fed charging;
  charging.to(charge, Request::charge);
  charging.step(0.299'999, pack_uv);
  EXPECT_FALSE(charging.contactors.outputs().charge_enable) << "the contactors are to have closed";
  charging.step(0.000'001, pack_uv);
  EXPECT_TRUE(charging.contactors.outputs().charge_enable);
}

/// Whichever of its times is the longest.
TEST(Contactors, ReachTheEndOfEveryStateWhateverThePlan) {
  PackDesign seldom = forklift;  // the test takes longest: 3 x 3 s
  seldom.sample_period_s = 1;
  seldom.precharge_time_constant_s = 0.02;
  const ContactorPlan slow_test = contactor_plan(seldom);
  Fed tested(slow_test);
  tested.in.request = Request::drive;
  tested.step(1);
  tested.step(8.999'999);
  EXPECT_EQ(tested.contactors.state(), self_test);
  EXPECT_EQ(tested.step(0.000'001), precharge);
  PackDesign large = forklift;  // pre-charge does: six time constants of 4 s
  large.precharge_time_constant_s = 4;
  const ContactorPlan slow_charge = contactor_plan(large);
  Fed held(slow_charge);
  held.to(precharge);
  for (int k = 0; k < 239; ++k) ASSERT_EQ(held.step(0.1, pack_uv - sixteenth_uv - 1), precharge) << k;
  EXPECT_EQ(held.step(0.1, pack_uv - sixteenth_uv - 1), opening) << "never quite there";
  EXPECT_TRUE(held.contactors.events().precharge_failed);
}

/// By the formula of an RC, less a fifth of the pack.
TEST(Precharge, FailsBelowItsCurveByAFifthOfThePackAndGoesOnAbove) {
  for (int k = 1; k < 12; ++k) {
    const double least = 1 - std::exp(-k / 2.0) - 0.2;
    for (const double off_by : {-0.001, 0.001}) {
      for (const double after_s : {0.0, 0.249'999}) {  // until the next half time constant is over the same is asked
        Fed f;
        f.to(precharge);
        EXPECT_EQ(f.step(0.25 * k + after_s, static_cast<std::int32_t>(pack_uv * (least + off_by))),
                  off_by < 0 ? opening : precharge)
            << k << ' ' << off_by;
        EXPECT_EQ(f.contactors.events().precharge_failed, off_by < 0);
      }
    }
  }
  Fed at_once;
  at_once.to(precharge);
  EXPECT_EQ(at_once.step(0.249'999, 0), precharge) << "nothing is asked of the first half time constant";
  EXPECT_EQ(at_once.step(0, pack_uv - sixteenth_uv - 1), precharge);
  EXPECT_EQ(at_once.step(0, pack_uv - sixteenth_uv), drive);
}

TEST(Precharge, WithoutAReadingOfThePackFailsWhenItsTimeIsOver) {
  Fed f;
  f.to(precharge);
  f.in.pack_uv = measurement::no_reading;
  EXPECT_EQ(f.step(2.999'999, 50'000'000), precharge);
  EXPECT_EQ(f.step(0.000'001, 50'000'000), opening);
  EXPECT_TRUE(f.contactors.events().precharge_failed);
}

TEST(Contactors, ToldToCeaseOpenAtRestToTheLastDigit) {
  for (const std::int32_t rest_ua : {120'000, -120'000}) {
    Fed f;
    f.to(drive);
    f.in.request = Request::none;
    f.in.current_ua = rest_ua + (rest_ua > 0 ? 1 : -1);
    f.step(0.1, pack_uv);
    EXPECT_EQ(f.step(100, pack_uv), unloading);
    f.in.current_ua = measurement::no_reading;
    EXPECT_EQ(f.step(100, pack_uv), unloading) << "nobody knows";
    f.in.current_ua = rest_ua;
    EXPECT_EQ(f.step(0.1, pack_uv), opening);
  }
}

TEST(Contactors, CountTheTimeOfGraceToItsEndAndAnewOnlyWhenTheCurrentCeased) {
  for (const bool in_unloading : {false, true}) {
    for (const std::int32_t current_ua : {120'001, -120'001}) {
      const ContactorState here = in_unloading ? unloading : drive;
      Fed f;
      f.to(drive);
      f.in.current_ua = current_ua;
      if (in_unloading) f.to(unloading, Request::none);
      (current_ua > 0 ? f.in.charge_forbidden : f.in.discharge_forbidden) = true;
      EXPECT_EQ(f.step(4.9, pack_uv), here);
      f.in.current_ua = measurement::no_reading;
      EXPECT_EQ(f.step(1, pack_uv), here) << "what is not known counts for nothing";
      f.in.current_ua = current_ua;
      EXPECT_EQ(f.step(0.099'999, pack_uv), here);
      EXPECT_EQ(f.step(0.000'001, pack_uv), opening) << "nor does it begin the time anew";
    }
  }
  Fed f;
  f.to(drive);
  f.in.discharge_forbidden = true;
  for (const std::int32_t current_ua : {-3'000'000, -120'000, -3'000'000}) {
    f.in.current_ua = current_ua;
    EXPECT_EQ(f.step(4.9, pack_uv), drive);
  }
  EXPECT_EQ(f.step(0.099'999, pack_uv), drive);
  EXPECT_EQ(f.step(0.000'001, pack_uv), opening);
  Fed other_way;
  other_way.to(drive);
  other_way.in.current_ua = 3'000'000;
  other_way.to(unloading, Request::none);
  other_way.in.discharge_forbidden = true;
  EXPECT_EQ(other_way.step(100, pack_uv), unloading) << "what is not forbidden may flow until it ceases";
}

/// Steps that no limit is a multiple of, and such that 2^32 us are one of.
TEST(ContactorTimes, EndWhereTheyEndWhateverTheSteps) {
  for (const bool in_unloading : {false, true}) {
    Fed f;
    f.to(drive);
    f.in.current_ua = -3'000'000;
    if (in_unloading) f.to(unloading, Request::none);
    f.in.discharge_forbidden = true;
    int steps = 0;
    while (f.step(0.7, pack_uv) != opening && steps < 100) ++steps;
    EXPECT_EQ(steps, 7) << "the eighth is beyond five seconds";
  }
  Fed charging;
  charging.to(charge, Request::charge);
  for (int k = 0; k < 130; ++k) {
    ASSERT_EQ(charging.step(67.108'864, pack_uv), charge);
    ASSERT_TRUE(charging.contactors.outputs().charge_enable) << k;
  }
}

TEST(WeldedContactor, IsSaidWhenTheTimeForItToShowIsOver) {
  Fed current;
  current.to(drive);
  current.in.current_ua = -3'000'000;
  current.in.open_now = true;
  EXPECT_EQ(current.step(0.1, pack_uv), opening);
  current.step(0.299'999, pack_uv);
  EXPECT_FALSE(current.welded()) << "an arc, a mean over the last sample";
  current.step(0.000'001, pack_uv);
  EXPECT_TRUE(current.welded());
  Fed standing;
  standing.to(drive);
  standing.in.open_now = true;
  standing.step(0.1, pack_uv);
  standing.step(4.999'999, pack_uv - eighth_uv);
  EXPECT_FALSE(standing.welded());
  EXPECT_EQ(standing.contactors.state(), opening);
  standing.step(0.000'001, pack_uv - eighth_uv);
  EXPECT_TRUE(standing.welded());
  EXPECT_EQ(standing.contactors.state(), safe);
  standing.step(4.999'999, pack_uv);
  EXPECT_FALSE(standing.welded());
  standing.step(0.000'001, pack_uv);
  EXPECT_TRUE(standing.welded()) << "in safe as well";
  Fed fallen;
  fallen.to(drive);
  fallen.in.open_now = true;
  fallen.step(0.1, pack_uv);
  EXPECT_EQ(fallen.step(0.3, pack_uv - eighth_uv - 1), safe);
}

TEST(Contactor, ThatHasNotClosedLeavesTheLinkASixteenthBelowThePack) {
  Fed f;
  f.to(charge, Request::charge);
  f.step(1, pack_uv - sixteenth_uv);
  EXPECT_FALSE(f.contactors.events().not_closed);
  EXPECT_TRUE(f.contactors.outputs().charge_enable);
  f.step(1, pack_uv - sixteenth_uv - 1);
  EXPECT_TRUE(f.contactors.events().not_closed);
  EXPECT_FALSE(f.contactors.outputs().charge_enable) << "nothing is to be charged through it";
  f.step(1, measurement::no_reading);
  EXPECT_FALSE(f.contactors.events().not_closed);
}

// ---- all states, all inputs

/// What a step depends on, as bytes: equal bytes, equal future.
std::array<std::uint8_t, sizeof(Contactors)> bytes(const Contactors& c) {
  std::array<std::uint8_t, sizeof(Contactors)> all{};
  std::memcpy(all.data(), &c, sizeof c);
  return all;
}

TEST(ContactorWalk, ThroughEveryReachableStateUnderEveryInputNeverClosesAgainstASevereFault) {
  // classes of inputs: a member of each that the machine can tell apart
  std::vector<ContactorInput> inputs;
  for (const Request r : {Request::none, Request::drive, Request::charge}) {
    for (int faults = 0; faults < 16; ++faults) {
      for (const std::int32_t current : {measurement::no_reading, -3'000'000, 0, 3'000'000}) {
        for (const std::int32_t link : {measurement::no_reading, 0, 30'000'000, 46'000'000, 49'000'000, 52'800'000}) {
          for (const std::int32_t stack : {measurement::no_reading, pack_uv}) {
            if (stack == measurement::no_reading && link > 0) continue;
            inputs.push_back({r, (faults & 1) != 0, (faults & 2) != 0, (faults & 4) != 0, (faults & 8) != 0, current,
                              stack, link, 1'000'000});
          }
        }
      }
    }
  }
  constexpr ContactorPlan coarse{.test_us = 1'000'000,
                                 .half_time_constant_us = 500'000,
                                 .dc_link_discharge_us = 3'000'000,
                                 .rest_ua = 120'000};  // of few different times
  std::set<std::array<std::uint8_t, sizeof(Contactors)>> known;
  std::vector<Contactors> open{Contactors(coarse)};
  std::set<ContactorState> visited;
  std::set<std::pair<ContactorState, ContactorState>> edges;
  std::size_t steps = 0;
  while (!open.empty()) {
    const Contactors from = open.back();
    open.pop_back();
    visited.insert(from.state());
    for (const ContactorInput& in : inputs) {
      Contactors c = from;
      const Outputs out = c.update(in);
      ++steps;
      edges.insert({from.state(), c.state()});
      ASSERT_FALSE(in.open_now && out.any_closed()) << contactor_state_names[static_cast<std::size_t>(c.state())];
      ASSERT_FALSE(out.main_plus && out.precharge);
      ASSERT_FALSE(out.main_plus && !out.main_minus);
      ASSERT_FALSE(out.charge_enable && (in.charge_forbidden || !out.main_plus || in.request == Request::none));
      ASSERT_EQ(out.any_closed() && out.main_plus, c.state() == drive || c.state() == charge || c.state() == unloading);
      if (from.state() != c.state() && c.state() == self_test) {
        ASSERT_FALSE(in.open || in.open_now || in.request == Request::none);
      }
      if (out.main_plus && from.state() == precharge) {
        ASSERT_TRUE(in.dc_link_uv >= 49'000'000 && !in.open) << "closed onto an empty link";
      }
      if (known.insert(bytes(c)).second) open.push_back(c);
    }
    ASSERT_LT(known.size(), 200'000U);
  }
  EXPECT_EQ(visited.size(), contactor_state_count);
  const std::set<std::pair<ContactorState, ContactorState>> allowed = {{off, off},
                                                                       {off, self_test},
                                                                       {off, safe},
                                                                       {self_test, self_test},
                                                                       {self_test, precharge},
                                                                       {self_test, opening},
                                                                       {precharge, precharge},
                                                                       {precharge, drive},
                                                                       {precharge, charge},
                                                                       {precharge, opening},
                                                                       {drive, drive},
                                                                       {drive, unloading},
                                                                       {drive, opening},
                                                                       {charge, charge},
                                                                       {charge, unloading},
                                                                       {charge, opening},
                                                                       {unloading, unloading},
                                                                       {unloading, opening},
                                                                       {opening, opening},
                                                                       {opening, off},
                                                                       {opening, safe},
                                                                       {safe, safe},
                                                                       {safe, off}};
  EXPECT_EQ(edges, allowed) << "a transition that nobody named, or one that never happens";
  EXPECT_GT(steps, 100'000U);
  ::testing::Test::RecordProperty("reached", static_cast<int>(known.size()));
}

// ---- flipped bits

TEST(Contactors, InAStateThatIsNoneEndInSafeThoughAllCopiesOfItAgree) {
  for (const std::uint32_t none : {8U, 9U, 0x8000'0003U, 0xFFFF'FFFFU}) {
    Fed f;
    f.to(drive);
    std::array<std::uint32_t, sizeof(Contactors) / 4> words{};
    std::memcpy(words.data(), static_cast<void*>(&f.contactors), sizeof(Contactors));
    std::size_t at = 0;
    while (at + 2 < words.size() && !(words[at] == 3 && words[at + 1] == ~3U)) ++at;
    ASSERT_LT(at + 2, words.size());
    words[at] ^= 3 ^ none;
    words[at + 1] ^= 3 ^ none;
    words[at + 2] ^= 3 ^ none;
    std::memcpy(static_cast<void*>(&f.contactors), words.data(), sizeof(Contactors));
    EXPECT_FALSE(f.contactors.intact()) << none;
    EXPECT_EQ(f.step(0.1, pack_uv), safe) << none;
    EXPECT_EQ(f.contactors.outputs(), Outputs{});
  }
}

TEST(GuardedWord, NoticesEveryOneAndEveryTwoFlippedBits) {
  static_assert(sizeof(Guarded) == 12);
  for (const std::uint32_t value : {0U, 3U, 7U, 0x8000'0001U, 0xFFFF'FFFFU}) {
    for (int a = 0; a < 96; ++a) {
      for (int b = a; b < 96; ++b) {
        Guarded g(value);
        std::array<std::uint32_t, 3> w{};
        std::memcpy(w.data(), &g, sizeof g);
        w[static_cast<std::size_t>(a / 32)] ^= 1U << (a % 32);
        if (b != a) w[static_cast<std::size_t>(b / 32)] ^= 1U << (b % 32);
        std::memcpy(static_cast<void*>(&g), w.data(), sizeof g);
        ASSERT_FALSE(g.intact()) << a << ' ' << b;
        ASSERT_EQ(g.any() & value, value) << "a fault that was there is not forgotten by fewer than three flips";
      }
    }
  }
}

}  // namespace
}  // namespace bms::protection
