// Every limit of the contactors to the last digit, with readings that the test sets.
#include "protection/contactors.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/protection/contactor_bench.hpp"

namespace bms::protection {
namespace {

using enum ContactorState;
constexpr std::int32_t eighth_uv = rested_pack_uv / 8, sixteenth_uv = rested_pack_uv / 16;

TEST(WeldedContactor, IsADcLinkThatRisesByAnEighthAboveItsLowestInTheSelfTest) {
  for (const std::int32_t rise_uv : {eighth_uv, eighth_uv + 1}) {
    FedContactors f;
    f.in.request = Request::drive;
    // The DC link is still falling after the last drive.
    for (const std::int32_t dc_link_uv : {40'000'000, 35'000'000, 30'000'000, 25'000'000})
      EXPECT_EQ(f.step(0.1, dc_link_uv), self_test);
    // A missing reading does not count as a weld, and the lowest DC link is kept.
    f.step(0.1, measurement::no_reading);
    EXPECT_FALSE(f.welded());
    f.in.pack_uv = measurement::no_reading;
    f.step(0.05, 0);
    f.in.pack_uv = rested_pack_uv;
    f.in.current_ua = measurement::no_reading;
    f.step(0.05, 0);
    f.in.current_ua = 0;
    EXPECT_EQ(f.step(0.1, 26'000'000), self_test) << "noise";
    EXPECT_EQ(f.step(0.1, 25'000'000 + rise_uv), rise_uv > eighth_uv ? opening : self_test);
    EXPECT_EQ(f.welded(), rise_uv > eighth_uv);
  }
}

TEST(WeldedContactor, WhileAllAreOpenIsADcLinkAtSevenEighthsOrAnyCurrentAboveRest) {
  struct Case {
    std::int32_t dc_link_uv, current_ua, pack_uv;
    bool welded;
  };
  for (const Case& c : {Case{7 * eighth_uv - 1, 0, rested_pack_uv, false},
                        {7 * eighth_uv, 0, rested_pack_uv, true},
                        {0, 120'000, rested_pack_uv, false},
                        {0, -120'000, rested_pack_uv, false},
                        {0, 120'001, rested_pack_uv, true},
                        {0, -120'001, rested_pack_uv, true},
                        {measurement::no_reading, 0, rested_pack_uv, false},
                        {rested_pack_uv, 0, measurement::no_reading, false},
                        {0, 0, 0, false},
                        {1, 0, 1, true}}) {
    FedContactors f;
    f.in.current_ua = c.current_ua;
    f.in.pack_uv = c.pack_uv;
    f.step(0.1, c.dc_link_uv);
    EXPECT_EQ(f.welded(), c.welded) << c.dc_link_uv << ' ' << c.current_ua << ' ' << c.pack_uv;
    f.in.request = Request::drive;
    EXPECT_EQ(f.step(0.1, c.dc_link_uv), c.welded ? off : self_test) << "no self-test with a welded contactor";
  }
}

TEST(Contactors, TakeTheirTimesFromTheDesignOfThePack) {
  EXPECT_EQ(forklift_contactors.test_us, 300'000U) << "three samples";
  EXPECT_EQ(forklift_contactors.half_time_constant_us, 250'000U);
  EXPECT_EQ(forklift_contactors.dc_link_discharge_us, 5'000'000U);
  EXPECT_EQ(forklift_contactors.rest_ua, 120'000);
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
  f.step(0.1, rested_pack_uv);
  f.in.request = Request::none;
  f.step(0.1, rested_pack_uv);
  ASSERT_EQ(f.step(0.1, rested_pack_uv), opening);
  EXPECT_EQ(f.step(0.299'999, 0), opening) << "a DC link that fell at once has to stay down";
  EXPECT_EQ(f.step(0.000'001, 0), off);
  FedContactors charging;
  charging.to(charge, Request::charge);
  charging.step(0.299'999, rested_pack_uv);
  EXPECT_FALSE(charging.contactors.outputs().charge_enable) << "the contactors need time to close";
  charging.step(0.000'001, rested_pack_uv);
  EXPECT_TRUE(charging.contactors.outputs().charge_enable);
}

/// Each of the times may be the longest.
TEST(Contactors, ReachTheEndOfEveryStateWithAnyPlan) {
  PackDesign seldom = forklift;  // the self-test is longest: 3 x 3 s
  seldom.sample_period_s = 1;
  seldom.precharge_time_constant_s = 0.02;
  const ContactorPlan slow_test = contactor_plan(seldom);
  FedContactors tested(slow_test);
  tested.in.request = Request::drive;
  tested.step(1);
  tested.step(8.999'999);
  EXPECT_EQ(tested.contactors.state(), self_test);
  EXPECT_EQ(tested.step(0.000'001), precharge);
  PackDesign large = forklift;  // the precharge is longest: six time constants of 4 s
  large.precharge_time_constant_s = 4;
  const ContactorPlan slow_charge = contactor_plan(large);
  FedContactors slow(slow_charge);
  slow.to(precharge);
  for (int k = 0; k < 239; ++k) ASSERT_EQ(slow.step(0.1, rested_pack_uv - sixteenth_uv - 1), precharge) << k;
  EXPECT_EQ(slow.step(0.1, rested_pack_uv - sixteenth_uv - 1), opening) << "never reaches 15/16";
  EXPECT_TRUE(slow.contactors.events().precharge_failed);
}

/// Formula of an RC circuit, minus a fifth of the pack.
TEST(Precharge, FailsAFifthOfThePackBelowItsCurveAndContinuesAbove) {
  for (int k = 1; k < 12; ++k) {
    const double least = 1 - std::exp(-k / 2.0) - 0.2;
    for (const double off_by : {-0.001, 0.001}) {
      for (const double after_s : {0.0, 0.249'999}) {  // the limit holds until the next half time constant
        FedContactors f;
        f.to(precharge);
        EXPECT_EQ(f.step(0.25 * k + after_s, static_cast<std::int32_t>(rested_pack_uv * (least + off_by))),
                  off_by < 0 ? opening : precharge)
            << k << ' ' << off_by;
        EXPECT_EQ(f.contactors.events().precharge_failed, off_by < 0);
      }
    }
  }
  FedContactors at_once;
  at_once.to(precharge);
  EXPECT_EQ(at_once.step(0.249'999, 0), precharge) << "no limit in the first half time constant";
  EXPECT_EQ(at_once.step(0, rested_pack_uv - sixteenth_uv - 1), precharge);
  EXPECT_EQ(at_once.step(0, rested_pack_uv - sixteenth_uv), drive);
}

TEST(Precharge, FailsWithoutAReadingOfThePackWhenItsTimeIsOver) {
  FedContactors f;
  f.to(precharge);
  f.in.pack_uv = measurement::no_reading;
  EXPECT_EQ(f.step(2.999'999, 50'000'000), precharge);
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

TEST(WeldedContactor, IsReportedAfterTheTimeInWhichTheDcLinkFalls) {
  FedContactors current;
  current.to(drive);
  current.in.current_ua = -3'000'000;
  current.in.open_now = true;
  EXPECT_EQ(current.step(0.1, rested_pack_uv), opening);
  current.step(0.299'999, rested_pack_uv);
  EXPECT_FALSE(current.welded()) << "an arc, or the mean over the last sample";
  current.step(0.000'001, rested_pack_uv);
  EXPECT_TRUE(current.welded());
  FedContactors standing;
  standing.to(drive);
  standing.in.open_now = true;
  standing.step(0.1, rested_pack_uv);
  standing.step(4.999'999, rested_pack_uv - eighth_uv);
  EXPECT_FALSE(standing.welded());
  EXPECT_EQ(standing.contactors.state(), opening);
  standing.step(0.000'001, rested_pack_uv - eighth_uv);
  EXPECT_TRUE(standing.welded());
  EXPECT_EQ(standing.contactors.state(), safe);
  standing.step(4.999'999, rested_pack_uv);
  EXPECT_FALSE(standing.welded());
  standing.step(0.000'001, rested_pack_uv);
  EXPECT_TRUE(standing.welded()) << "also in safe";
  FedContactors fallen;
  fallen.to(drive);
  fallen.in.open_now = true;
  fallen.step(0.1, rested_pack_uv);
  EXPECT_EQ(fallen.step(0.3, rested_pack_uv - eighth_uv - 1), safe);
}

TEST(Contactor, ThatHasNotClosedLeavesTheDcLinkASixteenthBelowThePack) {
  FedContactors f;
  f.to(charge, Request::charge);
  f.step(1, rested_pack_uv - sixteenth_uv);
  EXPECT_FALSE(f.contactors.events().not_closed);
  EXPECT_TRUE(f.contactors.outputs().charge_enable);
  f.step(1, rested_pack_uv - sixteenth_uv - 1);
  EXPECT_TRUE(f.contactors.events().not_closed);
  EXPECT_FALSE(f.contactors.outputs().charge_enable) << "no charging through an open contactor";
  f.step(1, measurement::no_reading);
  EXPECT_FALSE(f.contactors.events().not_closed);
}

}  // namespace
}  // namespace bms::protection
