// Every limit of the contactors to the last digit, with readings that the test sets.
#include "protection/contactors.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/firmware/protection/contactor_bench.hpp"

namespace bms::protection {
namespace {

using enum ContactorState;
constexpr std::int32_t eighth_uv = rested_pack_uv / 8, sixteenth_uv = rested_pack_uv / 16;

constexpr std::int32_t least_move_uv = rested_pack_uv / 256;

/// A pole that stays where it was, to 1/256 of the pack, when the precharge relay closes.
TEST(WeldedContactor, IsAPoleThatThePrechargeRelayDoesNotMove) {
  constexpr std::int32_t pack = rested_pack_uv, away = 30'000'000;
  struct Case {
    std::int32_t plus_before_uv, minus_before_uv, plus_uv, minus_uv;
    Pole pole;
  };
  for (const Case& c : {Case{pack - 500'000, away, pack - 500'000 + least_move_uv, away, Pole::plus},
                        {pack - 500'000, away, pack - 500'000 + least_move_uv + 1, away, Pole::none},
                        {pack, away, pack - least_move_uv, away, Pole::plus},
                        {pack, away, pack - least_move_uv - 1, away, Pole::none},
                        {away, 500'000, pack, 500'000 + least_move_uv, Pole::minus},
                        {away, 500'000, pack, 500'000 + least_move_uv + 1, Pole::none},
                        {away, 1'000'001, pack, 1'000'000, Pole::none},
                        {1'000'000, 0, 6'000'000, 0, Pole::none},
                        {1'000'000, 0, 6'000'001, 0, Pole::minus},
                        {pack, 0, pack, 0, Pole::unknown}}) {
    FedContactors f;
    f.in.request = Request::drive;
    for (int k = 0; k < 4; ++k) f.step_with_poles(0.1, c.plus_before_uv, c.minus_before_uv);
    ASSERT_EQ(f.contactors.outputs(), (Outputs{.precharge = true}));
    f.step_with_poles(0.1, c.plus_uv, c.minus_uv);
    EXPECT_EQ(f.welded(), c.pole != Pole::none) << c.plus_uv << ' ' << c.minus_uv;
    EXPECT_EQ(f.contactors.state(), self_test) << "one sample does not prove it";
    f.step_with_poles(0.1, c.plus_uv, c.minus_uv);
    EXPECT_EQ(f.contactors.state(), c.pole != Pole::none ? opening : self_test) << c.plus_uv << ' ' << c.minus_uv;
    EXPECT_EQ(f.contactors.welded_pole(), c.pole) << c.plus_uv << ' ' << c.minus_uv;
  }
}

/// A pole is held while the DC link loses half of the pack's voltage.
TEST(WeldedContactor, WhileAllAreOpenIsAPoleThatIsHeldOrAnyCurrentAboveRest) {
  struct Case {
    std::int32_t plus_uv, minus_uv, plus_then_uv, minus_then_uv;
    Pole pole;
  };
  constexpr std::int32_t pack = rested_pack_uv, half = pack / 2, none = measurement::no_reading;
  for (const Case& c : {Case{pack, 2'000'000, pack, 2'000'000 + half, Pole::plus},
                        {pack, 2'000'000, pack, 2'000'000 + half - 1, Pole::none},
                        {pack, 2'000'000, pack - least_move_uv, 2'000'000 + half, Pole::plus},
                        {pack, 2'000'000, pack - least_move_uv - 1, 2'000'000 + half, Pole::none},
                        {45'000'000, 0, 45'000'000 - half, 0, Pole::minus},
                        {45'000'000, 0, 45'000'000 - half + 1, 0, Pole::none},
                        {45'000'000, 0, 45'000'000 - half, least_move_uv + 1, Pole::none},
                        {pack, 0, pack, 0, Pole::none},
                        {pack, none, pack, half, Pole::none},
                        {200'000'001, 0, pack, half, Pole::none},
                        {1'278'000, 1'278'000, 1'278'000, 1'278'000, Pole::none}}) {
    FedContactors f;
    f.step_with_poles(0.1, c.plus_uv, c.minus_uv);
    EXPECT_FALSE(f.welded());
    f.step_with_poles(0.1, none, none);
    f.step_with_poles(0.1, c.plus_then_uv, c.minus_then_uv);
    EXPECT_EQ(f.welded(), c.pole != Pole::none) << c.plus_then_uv << ' ' << c.minus_then_uv;
    EXPECT_EQ(f.contactors.welded_pole(), c.pole) << c.plus_then_uv << ' ' << c.minus_then_uv;
    f.in.request = Request::drive;
    EXPECT_EQ(f.step_with_poles(0.1, c.plus_then_uv, c.minus_then_uv), c.pole == Pole::none ? self_test : off)
        << "no self-test with a welded contactor";
  }
  for (const std::int32_t current_ua : {120'000, -120'000, 120'001, -120'001}) {
    FedContactors f;
    f.in.current_ua = current_ua;
    f.step_with_poles(0.1, 0, 0);
    EXPECT_EQ(f.welded(), magnitude(current_ua) > 120'000) << current_ua;
  }
}

TEST(Contactors, TakeTheirTimesFromTheDesignOfThePack) {
  EXPECT_EQ(forklift_contactors.test_us, 300'000U) << "three samples";
  EXPECT_EQ(forklift_contactors.half_time_constant_us, 250'000U);
  EXPECT_EQ(forklift_contactors.rest_ua, 120'000);
  EXPECT_EQ(forklift_contactors.max_closing_gap_uv, 9'000'000) << "600 A, 15 mohm";
  FedContactors f;
  f.in.request = Request::drive;
  EXPECT_EQ(f.step(0.1), self_test);
  for (const Outputs& part : {Outputs{}, Outputs{.precharge = true}, Outputs{.main_minus = true}}) {
    EXPECT_EQ(f.contactors.outputs(), part);
    f.step(0.299'999);
    EXPECT_EQ(f.contactors.outputs(), part);
    f.step(0.000'001);
  }
  EXPECT_EQ(f.contactors.state(), precharge);
  f.step(0.3, rested_pack_uv);
  EXPECT_EQ(f.contactors.state(), drive);
  f.in.request = Request::none;
  f.step(0.1, rested_pack_uv);
  ASSERT_EQ(f.step(0.1, rested_pack_uv), opening);
  EXPECT_EQ(f.step(0.299'999, 0), opening) << "a DC link that fell at once has to stay down";
  EXPECT_EQ(f.step(0.000'001, 0), off);
  FedContactors charging;
  charging.to(charge, Request::charge);
  EXPECT_TRUE(charging.contactors.outputs().precharge);
  charging.step(0.074'999, rested_pack_uv);
  EXPECT_TRUE(charging.contactors.outputs().precharge) << "main plus needs time to close";
  charging.step(0.000'001, rested_pack_uv);
  EXPECT_FALSE(charging.contactors.outputs().precharge);
  charging.step(0.224'999, rested_pack_uv);
  EXPECT_FALSE(charging.contactors.outputs().charge_enable) << "the contactors need time to close";
  charging.step(0.000'001, rested_pack_uv);
  EXPECT_TRUE(charging.contactors.outputs().charge_enable);
}

/// Each of the times may be the longest.
TEST(Contactors, ReachTheEndOfEveryStateWithAnyPlan) {
  PackDesign seldom = forklift;  // the self-test is longest: 3 x 6 s
  seldom.sample_period_s = 2;
  seldom.precharge_time_constant_s = 0.02;
  const ContactorPlan slow_test = contactor_plan(seldom);
  FedContactors tested(slow_test);
  tested.in.request = Request::drive;
  tested.step(1);
  for (int part = 0; part < 3; ++part) {
    tested.step(5.999'999);
    EXPECT_EQ(tested.contactors.state(), self_test);
    tested.step(0.000'001);
  }
  EXPECT_EQ(tested.contactors.state(), precharge);
  PackDesign large = forklift;  // the precharge is longest: seven time constants of 4 s
  large.precharge_time_constant_s = 4;
  const ContactorPlan slow_charge = contactor_plan(large);
  FedContactors slow(slow_charge);
  slow.to(precharge);
  for (int k = 0; k < 279; ++k) {
    // 9.1 V below the pack, and 0.6 % of it more in every other half time constant
    const std::int32_t gap_uv = 9'100'000 + (k / 20 % 2 == 0 ? 320'000 : 0);
    ASSERT_EQ(slow.step(0.1, k < 19 ? 0 : rested_pack_uv - gap_uv), precharge) << k;
  }
  EXPECT_EQ(slow.step(0.1, rested_pack_uv - 9'100'000), opening) << "never full";
  EXPECT_TRUE(slow.contactors.events().precharge_failed);
}

/// From an empty DC link and from a half full one: exp(-2 t / 3 RC) of the first gap, plus a fifth of the pack.
TEST(Precharge, FailsBelowItsCurveAndContinuesAbove) {
  for (const double first : {1.0, 0.5}) {
    for (int k = 1; k < 14; ++k) {
      const double most = first * std::exp(-k / 3.0) + 0.2;
      if (most >= first) continue;
      for (const double off_by : {-0.001, 0.001}) {
        for (const double after_s : {0.0, 0.249'999}) {  // the limit holds until the next half time constant
          FedContactors f;
          f.to(precharge, Request::drive, static_cast<std::int32_t>((1 - first) * rested_pack_uv));
          EXPECT_EQ(f.step(0.25 * k + after_s, static_cast<std::int32_t>(rested_pack_uv * (1 - most - off_by))),
                    off_by > 0 ? opening : precharge)
              << k << ' ' << off_by << ' ' << first;
          EXPECT_EQ(f.contactors.events().precharge_failed, off_by > 0);
        }
      }
    }
  }
  FedContactors at_once;
  at_once.to(precharge);
  EXPECT_EQ(at_once.step(0.249'999, 0), precharge) << "no limit in the first half time constant";
}

TEST(Precharge, EndsAtTwoPercentOfThePack) {
  FedContactors f;
  f.to(precharge);
  f.step(0.25, 30'000'000);
  EXPECT_EQ(f.step(0.01, rested_pack_uv - rested_pack_uv / 50 - 1), precharge);
  EXPECT_EQ(f.step(0.01, rested_pack_uv - rested_pack_uv / 50), drive);
  FedContactors above;
  above.to(precharge);
  above.step(0.25, 30'000'000);
  EXPECT_EQ(above.step(0.01, rested_pack_uv + rested_pack_uv / 50 + 1), precharge) << "a DC link above the pack";
  EXPECT_EQ(above.step(0.01, rested_pack_uv + rested_pack_uv / 50), drive);
}

TEST(Precharge, EndsAfterThreeTimeConstantsWhenTheLinkRestsAtNineVoltsOrLess) {
  constexpr std::int32_t still_uv = rested_pack_uv / 200;
  for (const std::int32_t gap_uv : {9'000'000, 9'000'001}) {
    for (const std::int32_t move_uv : {still_uv - 1, still_uv}) {
      FedContactors f;
      f.to(precharge);
      f.step(1.25, rested_pack_uv - gap_uv - move_uv);
      EXPECT_EQ(f.step(0.249'999, rested_pack_uv - gap_uv), precharge);
      const bool full = gap_uv == 9'000'000 && move_uv < still_uv;
      EXPECT_EQ(f.step(0.000'001, rested_pack_uv - gap_uv), full ? drive : precharge) << gap_uv << ' ' << move_uv;
    }
  }
}

TEST(Precharge, IsTooFastBelowAnEighthOfItsFirstGapWithinHalfATimeConstant) {
  FedContactors slow_enough;
  slow_enough.to(precharge);
  EXPECT_EQ(slow_enough.step(0.249'999, rested_pack_uv - eighth_uv), precharge);
  FedContactors fast;
  fast.to(precharge);
  EXPECT_EQ(fast.step(0.249'999, rested_pack_uv - eighth_uv + 1), opening);
  EXPECT_TRUE(fast.contactors.events().precharge_failed);
  FedContactors late;
  late.to(precharge);
  EXPECT_EQ(late.step(0.25, rested_pack_uv - eighth_uv + 1), precharge);
  FedContactors small;  // too little to be judged
  small.to(precharge, Request::drive, rested_pack_uv - eighth_uv);
  EXPECT_EQ(small.step(0.1, rested_pack_uv), drive);
}

TEST(Precharge, FailsWithoutAReadingOfThePackWhenItsTimeIsOver) {
  FedContactors f;
  f.to(precharge);
  f.in.pack_uv = measurement::no_reading;
  EXPECT_EQ(f.step(3.499'999, 50'000'000), precharge);
  EXPECT_EQ(f.step(0.000'001, 50'000'000), opening);
  EXPECT_TRUE(f.contactors.events().precharge_failed);
}

TEST(Contactors, InUnloadingOpenAtRestToTheLastDigit) {
  for (const std::int32_t rest_ua : {120'000, -120'000}) {
    FedContactors f;
    f.to(drive);
    f.in.request = Request::none;
    f.in.current_ua = rest_ua + (rest_ua > 0 ? 1 : -1);
    f.step(0.1, rested_pack_uv);
    EXPECT_EQ(f.step(100, rested_pack_uv), unloading);
    f.in.current_ua = measurement::no_reading;
    EXPECT_EQ(f.step(100, rested_pack_uv), unloading) << "unknown current";
    f.in.current_ua = rest_ua;
    EXPECT_EQ(f.step(0.1, rested_pack_uv), opening);
  }
}

TEST(Contactors, CountTheGraceTimeToItsEndAndRestartItOnlyWhenTheCurrentCeased) {
  for (const bool in_unloading : {false, true}) {
    for (const std::int32_t current_ua : {120'001, -120'001}) {
      const ContactorState here = in_unloading ? unloading : drive;
      FedContactors f;
      f.to(drive);
      f.in.current_ua = current_ua;
      if (in_unloading) f.to(unloading, Request::none);
      (current_ua > 0 ? f.in.charge_forbidden : f.in.discharge_forbidden) = true;
      EXPECT_EQ(f.step(4.9, rested_pack_uv), here);
      f.in.current_ua = measurement::no_reading;
      EXPECT_EQ(f.step(1, rested_pack_uv), here) << "an unknown current does not count";
      f.in.current_ua = current_ua;
      EXPECT_EQ(f.step(0.099'999, rested_pack_uv), here);
      EXPECT_EQ(f.step(0.000'001, rested_pack_uv), opening) << "the grace time is not restarted";
    }
  }
  FedContactors f;
  f.to(drive);
  f.in.discharge_forbidden = true;
  for (const std::int32_t current_ua : {-3'000'000, -120'000, -3'000'000}) {
    f.in.current_ua = current_ua;
    EXPECT_EQ(f.step(4.9, rested_pack_uv), drive);
  }
  EXPECT_EQ(f.step(0.099'999, rested_pack_uv), drive);
  EXPECT_EQ(f.step(0.000'001, rested_pack_uv), opening);
  FedContactors other_way;
  other_way.to(drive);
  other_way.in.current_ua = 3'000'000;
  other_way.to(unloading, Request::none);
  other_way.in.discharge_forbidden = true;
  EXPECT_EQ(other_way.step(100, rested_pack_uv), unloading)
      << "a current that is not forbidden may flow until it ceases";
}

/// No limit is a multiple of these steps; 2^32 us is a multiple of the second one.
TEST(ContactorTimes, EndAtTheSameTimeWithAnySteps) {
  for (const bool in_unloading : {false, true}) {
    FedContactors f;
    f.to(drive);
    f.in.current_ua = -3'000'000;
    if (in_unloading) f.to(unloading, Request::none);
    f.in.discharge_forbidden = true;
    int steps = 0;
    while (f.step(0.7, rested_pack_uv) != opening && steps < 100) ++steps;
    EXPECT_EQ(steps, 7) << "the eighth is beyond five seconds";
  }
  FedContactors charging;
  charging.to(charge, Request::charge);
  for (int k = 0; k < 130; ++k) {
    ASSERT_EQ(charging.step(67.108'864, rested_pack_uv), charge);
    ASSERT_TRUE(charging.contactors.outputs().charge_enable) << k;
  }
}

TEST(WeldedContactor, IsReportedThreeSamplesAfterTheOpening) {
  FedContactors current;
  current.to(drive);
  current.in.current_ua = -3'000'000;
  current.in.open_now = true;
  EXPECT_EQ(current.step(0.1, rested_pack_uv), opening);
  current.step(0.299'999, rested_pack_uv);
  EXPECT_FALSE(current.welded()) << "an arc, or the mean over the last sample";
  current.step(0.000'001, rested_pack_uv);
  EXPECT_TRUE(current.welded());
  FedContactors pole;
  pole.to(drive);
  pole.in.open_now = true;
  pole.step(0.1, rested_pack_uv);
  pole.step_with_poles(0.1, rested_pack_uv, 2'000'000);
  pole.step_with_poles(0.199'999, rested_pack_uv, 30'000'000);
  EXPECT_FALSE(pole.welded());
  EXPECT_EQ(pole.contactors.state(), opening);
  pole.step_with_poles(0.000'001, rested_pack_uv, 30'000'000);
  EXPECT_TRUE(pole.welded());
  EXPECT_EQ(pole.contactors.state(), safe);
  pole.step_with_poles(0.1, rested_pack_uv, 2'000'000);
  pole.step_with_poles(0.199'999, rested_pack_uv, 30'000'000);
  EXPECT_FALSE(pole.welded());
  pole.step_with_poles(0.000'001, rested_pack_uv, 30'000'000);
  EXPECT_TRUE(pole.welded()) << "also in safe";
  FedContactors charged;
  charged.to(drive);
  charged.in.open_now = true;
  charged.step(0.1, rested_pack_uv);
  EXPECT_EQ(charged.step(0.3, rested_pack_uv), safe) << "a DC link that stays charged is not a weld";
  EXPECT_FALSE(charged.welded());
}

TEST(Contactors, EndTheOpeningWithoutReadingsAfterFiveSeconds) {
  for (const bool faulted : {false, true}) {
    FedContactors f;
    f.to(drive);
    f.in.request = faulted ? Request::drive : Request::none;
    f.in.open_now = faulted;
    f.step(0.1, rested_pack_uv);
    if (!faulted) f.step(0.1, rested_pack_uv);
    ASSERT_EQ(f.contactors.state(), opening);
    EXPECT_EQ(f.step(4.999'999, measurement::no_reading), opening);
    EXPECT_EQ(f.step(0.000'001, measurement::no_reading), faulted ? safe : off);
  }
}

TEST(Contactor, ThatHasNotClosedLeavesAPoleASixteenthFromThePack) {
  struct Case {
    std::int32_t plus_uv, minus_uv;
    bool differs, lost;
  };
  constexpr std::int32_t pack = rested_pack_uv;
  for (const Case& c : {Case{pack - sixteenth_uv, 0, false, false},
                        {pack - sixteenth_uv - 1, 0, true, false},
                        {pack + sixteenth_uv, 0, false, false},
                        {pack + sixteenth_uv + 1, 0, true, false},
                        {pack, sixteenth_uv, false, false},
                        {pack, -sixteenth_uv - 1, true, false},
                        {pack / 4 * 3, 0, true, false},
                        {pack / 4 * 3 - 1, 0, true, true},
                        {pack, pack / 4, true, false},
                        {pack, pack / 4 + 1, true, true},
                        {22'300'000, -30'500'000, true, true}}) {
    FedContactors f;
    f.to(charge, Request::charge);
    f.step(1, rested_pack_uv);
    EXPECT_TRUE(f.contactors.outputs().charge_enable);
    EXPECT_EQ(f.step_with_poles(1, c.plus_uv, c.minus_uv), c.lost ? opening : charge) << c.plus_uv << ' ' << c.minus_uv;
    EXPECT_EQ(f.contactors.events().not_closed, c.differs) << c.plus_uv << ' ' << c.minus_uv;
    EXPECT_EQ(f.contactors.outputs().charge_enable, !c.differs) << "no charging through an open contactor";
    f.step(1, measurement::no_reading);
    EXPECT_EQ(f.contactors.events().not_closed, c.lost) << "kept until the table has it";
  }
}

}  // namespace
}  // namespace bms::protection
