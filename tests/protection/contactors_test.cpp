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
constexpr ContactorPlan pack = contactor_plan(forklift);  // test part 0.3 s, half time constant 0.25 s, link 5 s, rest 0.12 A
constexpr std::int32_t pack_uv = 52'800'000;

/// Contactors between a pack and a link: resistor of 50 ohm, 10 mF, a bleeder. What is welded or does not close does so whatever it is told.
struct Bench {
  Contactors contactors{pack};
  ContactorInput in{.request = Request::none, .current_ua = 0, .pack_uv = pack_uv, .link_uv = 0, .step_us = 100'000};
  double link_v = 0, load_a = 0, time_constant_s = 0.5, discharge_s = 3, link_short = 0;
  bool plus_welded = false, minus_welded = false, precharge_welded = false, plus_fails = false;

  void step() {
    const Outputs out = contactors.update(in);
    const bool plus = (out.main_plus && !plus_fails) || plus_welded, minus = out.main_minus || minus_welded, relay = out.precharge || precharge_welded;
    const double step_s = in.step_us / 1e6, pack_v = pack_uv / 1e6;
    double current_a = 0;
    if (plus && minus) {
      link_v = pack_v;
      current_a = load_a;
    } else if (relay && minus) {
      const double end_v = pack_v * (1 - link_short);
      link_v += (end_v - link_v) * (1 - std::exp(-step_s / time_constant_s));
    } else {
      link_v *= std::exp(-step_s / discharge_s);
      if (load_a < 0) link_v *= 0.8;
    }
    in.link_uv = static_cast<std::int32_t>(1e6 * link_v);
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
  for (const Case& c : {Case{"as designed", 0.5, 0, false}, {"a third faster", 0.33, 0, false}, {"a quarter slower", 0.62, 0, false}, {"twice as slow", 1, 0, true},
                        {"link shorted", 0.5, 1, true}, {"a load that holds it at half", 0.5, 0.5, true}, {"a load that holds it at 7/8", 0.5, 0.125, true}}) {
    Bench b;
    b.time_constant_s = c.time_constant_s;
    b.link_short = c.link_short;
    b.in.request = Request::drive;
    b.until(precharge, 2);
    const double ended_s = b.until(c.fails ? opening : drive, 6);
    EXPECT_GE(ended_s, 0) << c.what;
    EXPECT_EQ(b.seen.precharge_failed, c.fails) << c.what;
    if (c.fails) { EXPECT_LE(ended_s, 3.1) << c.what << ": six time constants"; }
    if (c.link_short >= 1) { EXPECT_LE(ended_s, 0.5) << "a short is seen by half a time constant"; }
  }
}

TEST(Precharge, WithoutAReadingOfTheLinkNeverCloses) {
  Bench b;
  b.in.request = Request::drive;
  for (int k = 0; k < 100; ++k) {
    b.in.link_uv = no_reading;
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
    b.in.current_ua = no_reading;
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
      for (const std::int32_t current : {no_reading, -3'000'000, 0, 3'000'000}) {
        for (const std::int32_t link : {no_reading, 0, 30'000'000, 46'000'000, 49'000'000, 52'800'000}) {
          for (const std::int32_t stack : {no_reading, pack_uv}) {
            if (stack == no_reading && link > 0) continue;
            inputs.push_back({r, (faults & 1) != 0, (faults & 2) != 0, (faults & 4) != 0, (faults & 8) != 0, current, stack, link, 1'000'000});
          }
        }
      }
    }
  }
  constexpr ContactorPlan coarse{.test_us = 1'000'000, .half_time_constant_us = 500'000, .link_discharge_us = 3'000'000, .rest_ua = 120'000};  // of few different times
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
      if (from.state() != c.state() && c.state() == self_test) { ASSERT_FALSE(in.open || in.open_now || in.request == Request::none); }
      if (out.main_plus && from.state() == precharge) { ASSERT_TRUE(in.link_uv >= 49'000'000 && !in.open) << "closed onto an empty link"; }
      if (known.insert(bytes(c)).second) open.push_back(c);
    }
    ASSERT_LT(known.size(), 200'000U);
  }
  EXPECT_EQ(visited.size(), contactor_state_count);
  const std::set<std::pair<ContactorState, ContactorState>> allowed = {
      {off, off}, {off, self_test}, {off, safe}, {self_test, self_test}, {self_test, precharge}, {self_test, opening}, {precharge, precharge}, {precharge, drive}, {precharge, charge}, {precharge, opening},
      {drive, drive}, {drive, unloading}, {drive, opening}, {charge, charge}, {charge, unloading}, {charge, opening}, {unloading, unloading}, {unloading, opening}, {opening, opening}, {opening, off},
      {opening, safe}, {safe, safe}, {safe, off}};
  EXPECT_EQ(edges, allowed) << "a transition that nobody named, or one that never happens";
  EXPECT_GT(steps, 100'000U);
  ::testing::Test::RecordProperty("reached", static_cast<int>(known.size()));
}

// ---- flipped bits

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
