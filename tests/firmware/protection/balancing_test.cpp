#include "protection/balancing.hpp"

#include <numeric>

#include <gtest/gtest.h>

#include "tests/firmware/protection/balancing_pack.hpp"

namespace bms::protection {
namespace {

double sum(const std::vector<double>& v, std::size_t from, std::size_t to) {
  return std::accumulate(v.begin() + static_cast<std::ptrdiff_t>(from), v.begin() + static_cast<std::ptrdiff_t>(to),
                         0.0);
}

TEST(BalancingByCharge, ReducesASpreadOfFourPercentBelowTwoInTenDaysAndThenStops) {
  const BalancedPack pack = pack_out_of_balance(1, 0);
  const BalancingFigures f = balance(pack, ByCharge(0.002), 40);
  EXPECT_GT(pack.spread(), 0.04);
  EXPECT_LT(f.spread[10], 0.02);  // dead band 0.5 %, two sigma of each cell 0.8 %, error of the estimate 0.4 %
  EXPECT_LT(f.spread.back(), 0.02);
  EXPECT_EQ(sum(f.bled_ah, 20, 40), 0) << "a balanced pack is not bled";
}

/// A truck that is charged in its breaks and never reaches 95 %.
TEST(BalancingByCharge, ReducesASpreadOfEightPercentOfATruckThatIsChargedInItsBreaks) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    BalancedPack p = pack_out_of_balance(seed, 0);
    p.soc[3] += 0.06;
    const double before = p.spread();
    ByCharge rule(0.002);
    const auto until = [&](double mean, double current_a) {
      p.current_a = current_a;
      while (current_a < 0 ? p.mean_soc() > mean : p.mean_soc() < mean) p.run(8, rule(p, 8));
    };
    double highest = 0;
    for (int day = 0; day < 10; ++day) {
      for (int shift = 0; shift < 3; ++shift) {
        until(0.45, -3);
        until(0.8, 3);
        highest = std::max(highest, p.mean_soc());
        p.current_a = 0;
        for (int k = 0; k < 450; ++k) p.run(8, rule(p, 8));
      }
    }
    EXPECT_GT(before, 0.055) << seed;
    EXPECT_LT(highest, 0.85);
    EXPECT_LT(p.spread(), 0.045) << seed << ": two sigma of both at 80 % 2.6 %, dead band, error of the estimate";
    double bled_ah = 0;
    for (const double b : p.bled_ah) bled_ah += b;
    EXPECT_LT(bled_ah, 0.8) << seed;
  }
}

/// The same truck, balanced, with a cell that has 10 % less capacity.
TEST(BalancingByCharge, DoesNotBleedForACellWithLessCapacityFarBelowTheTop) {
  BalancedPack p = pack_out_of_balance(2, 0.1);
  for (std::size_t k = 0; k < balanced_cells; ++k) p.soc[k] = 1;  // level at the top
  ByCharge rule(0.002);
  const auto until = [&](double mean, double current_a) {
    p.current_a = current_a;
    while (current_a < 0 ? p.mean_soc() > mean : p.mean_soc() < mean) p.run(8, rule(p, 8));
  };
  for (int day = 0; day < 30; ++day) {
    until(0.45, -3);
    until(0.8, 3);
  }
  double bled_ah = 0;
  for (const double b : p.bled_ah) bled_ah += b;
  EXPECT_LT(bled_ah, 0.05);
}

TEST(BalancingByCharge, DoesNotBleedForACellWithLessCapacity) {
  const BalancingFigures f = balance(pack_out_of_balance(2, 0.1), ByCharge(0.002), 60);
  EXPECT_LT(f.spread.back(), 0.025);
  EXPECT_EQ(sum(f.bled_ah, 30, 60), 0);
}

TEST(BalancingByCharge, IsBetterThanVoltageOnThePlateau) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const auto pack = pack_out_of_balance(seed, 0.1);
    const BalancingFigures charge = balance(pack, ByCharge(0.002), 60), anywhere = balance(pack, ByVoltage(0), 60),
                           top = balance(pack, ByVoltage(3.4), 60);
    EXPECT_LT(charge.spread.back(), 0.5 * anywhere.spread.back()) << seed;
    EXPECT_LT(sum(charge.bled_ah, 0, 60), 0.2 * sum(anywhere.bled_ah, 0, 60)) << seed;
    EXPECT_GT(sum(anywhere.bled_ah, 50, 60), 0.05) << "bleeds permanently";
    EXPECT_LT(charge.spread[5], 0.5 * top.spread[5]) << seed << ": faster than above the knee";
    EXPECT_LT(sum(charge.bled_ah, 0, 60), 0.2 * sum(top.bled_ah, 0, 60)) << seed;
  }
}

TEST(BalancingByCharge, BleedsAlmostNothingInABalancedPackWithAnyErrorOfTheEstimate) {
  for (const double sigma : {0.002, 0.0099, 0.03}) {
    BalancedPack p = pack_out_of_balance(3, 0);
    p.soc.fill(0.5);
    p.capacity_ah.fill(6);
    const BalancingFigures f = balance(p, ByCharge(sigma), 30);
    // At 1 % the lowest of sixteen is sometimes 4.5 sigma below the highest. For comparison, self-discharge is 2 to 3 %
    // a month, 2.4 Ah.
    EXPECT_LE(sum(f.bled_ah, 0, 30), sigma > 0.01 || sigma < 0.005 ? 0.0 : 0.8) << sigma << ": in a month, of 96 Ah";
  }
}

/// Balancing at the top of a charge: the fourth cell is 3 %, the sixth and seventh are 4 % above the others.
struct AtTheTop {
  explicit AtTheTop(bool neighbours = false) : design(forklift) {
    design.neighbours_may_bleed = neighbours;
    plan = balancing_plan(design);
    uv.fill(3'330'000);
    soc[3] = 30'000'000;
    soc[5] = soc[6] = 40'000'000;
    sigma.fill(2'000'000);
  }
  std::uint32_t step(double seconds = 1) {
    return balancing.update({.cell_uv = uv,
                             .soc_ppb = soc,
                             .sigma_ppb = sigma,
                             .mean_soc_ppb = mean_ppb,
                             .current_ua = current_ua,
                             .highest_cdegc = warmest,
                             .allowed = allowed},
                            static_cast<std::uint32_t>(1e6 * seconds));
  }
  std::uint32_t both_turns() {
    std::uint32_t all = 0;
    for (int k = 0; k < 16; ++k) all |= step();
    return all;
  }
  PackDesign design;
  BalancingPlan plan;
  Balancing<16> balancing{plan};
  std::array<std::int32_t, 16> uv{}, soc{}, sigma{};
  std::int32_t mean_ppb = 960'000'000, current_ua = 3'000'000, warmest = 2'500;
  bool allowed = true;
};

TEST(Balancing, BleedsCellsAboveTheLowestByTwoSigmaAndTheDeadBand) {
  AtTheTop b;
  EXPECT_EQ(b.both_turns(), 1U << 3 | 1U << 5 | 1U << 6);
  AtTheTop edge;
  edge.soc[3] = 2 * (2'000'000 + 2'000'000) + 5'000'000;  // two sigma of each cell, and the dead band
  EXPECT_EQ(edge.both_turns(), 1U << 5 | 1U << 6);
  AtTheTop beyond;
  beyond.soc[3] = 2 * (2'000'000 + 2'000'000) + 5'000'001;
  EXPECT_EQ(beyond.both_turns(), 1U << 3 | 1U << 5 | 1U << 6);
  AtTheTop unsure;
  unsure.sigma[3] = 10'000'000;
  unsure.soc[3] = 28'000'000;
  EXPECT_EQ(unsure.both_turns(), 1U << 5 | 1U << 6);
}

TEST(Balancing, NeverBleedsNeighboursTogetherUnlessTheDesignAllowsIt) {
  AtTheTop b;
  for (int k = 0; k < 100; ++k) {
    const std::uint32_t mask = b.step();
    ASSERT_EQ(mask & (mask << 1), 0U);
  }
  AtTheTop free(true);
  EXPECT_EQ(free.step(), 1U << 3 | 1U << 5 | 1U << 6);
}

TEST(Balancing, StopsWhileDrivingWhenWarmWhenEmptyWhenForbiddenAndWhenUnknown) {
  AtTheTop b(true);
  ASSERT_NE(b.step(), 0U);
  b.current_ua = -3'000'000;
  EXPECT_EQ(b.step(), 0U);
  b.current_ua = 50'000;
  EXPECT_NE(b.step(), 0U) << "at rest";
  b.warmest = 5'501;
  EXPECT_EQ(b.step(), 0U);
  b.warmest = measurement::no_reading;
  EXPECT_EQ(b.step(), 0U);
  b.warmest = 2'500;
  b.allowed = false;
  EXPECT_EQ(b.step(), 0U);
  b.allowed = true;
  b.current_ua = measurement::no_reading;
  EXPECT_EQ(b.step(), 0U);
  b.current_ua = 0;
  b.uv[3] = 2'980'000;  // below 2.99 V
  EXPECT_EQ(b.step(), 1U << 5 | 1U << 6);
  b.mean_ppb = measurement::no_reading;
  EXPECT_EQ(b.step(), 0U);
}

TEST(Balancing, AppliesItsLimitsToTheLastDigit) {
  AtTheTop b(true);
  b.mean_ppb = 950'000'000;
  b.current_ua = -120'001;
  EXPECT_EQ(b.step(), 0U) << "more than a fiftieth of 1C is not rest";
  b.current_ua = -120'000;
  b.sigma[9] = 10'000'000;
  EXPECT_EQ(b.step(), 1U << 3 | 1U << 5 | 1U << 6) << "sigma of 1 % is sufficient";
  b.sigma[9] = 2'000'000;
  b.warmest = 5'500;
  b.uv[3] = 2'990'000;
  EXPECT_EQ(b.step(), 1U << 3 | 1U << 5 | 1U << 6);
  b.uv[3] = 2'989'999;
  EXPECT_EQ(b.step(), 1U << 5 | 1U << 6);
  b.uv[3] = 3'330'000;
  b.soc.fill(0);
  b.mean_ppb = 850'000'000;
  b.step();
  b.mean_ppb = 950'000'000;
  EXPECT_NE(b.step(), 0U) << "one measurement per charge";
  b.mean_ppb = 849'999'999;
  b.step();
  b.mean_ppb = 950'000'000;
  EXPECT_EQ(b.step(), 0U) << "measured again, the cells are level";
}

TEST(Balancing, GivesEverySecondOfThirtyTwoCellsATurnOfEightSeconds) {
  const BalancingPlan plan = balancing_plan(forklift);
  Balancing<32> balancing(plan);
  std::array<std::int32_t, 32> uv{}, soc{}, sigma{};
  uv.fill(3'330'000);
  soc.fill(30'000'000);
  soc[31] = 0;
  const auto step = [&](std::uint32_t step_us = 1'000'000) {
    return balancing.update({.cell_uv = uv,
                             .soc_ppb = soc,
                             .sigma_ppb = sigma,
                             .mean_soc_ppb = 960'000'000,
                             .current_ua = 0,
                             .highest_cdegc = 2'500,
                             .allowed = true},
                            step_us);
  };
  EXPECT_EQ(step(7'999'999), 0x5555'5555U);
  EXPECT_EQ(step(1), 0x2AAA'AAAAU);
  std::uint32_t before = step();
  while (step() == before) {
  }  // until the beginning of a turn
  before = ~before & 0x7FFF'FFFFU;
  for (int turn = 0; turn < 6; ++turn) {
    ASSERT_TRUE(before == 0x5555'5555U || before == 0x2AAA'AAAAU) << std::hex << before;
    for (int k = 1; k < 8; ++k) ASSERT_EQ(step(), before) << turn << ' ' << k;
    before = ~before & 0x7FFF'FFFFU;
    ASSERT_EQ(step(), before);
  }
}

TEST(Balancing, ReportsNoRemainingTimeWithoutChargeToBleedOrWithoutAVoltage) {
  AtTheTop b(true);
  EXPECT_EQ(b.balancing.left_s(3'330'000), 0U) << "not measured yet";
  b.step();
  EXPECT_NEAR(b.balancing.left_s(3'330'000), 32e-3 * 6 * 3'600 / (3.33 / 33), 5) << "all together, without turns";
  EXPECT_EQ(b.balancing.left_s(measurement::no_reading), 0U);
  EXPECT_EQ(b.balancing.left_s(0), 0U);
  EXPECT_EQ(b.balancing.left_s(1), b.balancing.left_s(33)) << "the current is at least a microampere";
  b.step(60);
  for (int k = 0; k < 1'000; ++k) b.step(60);  // ends within a step, so slightly more charge is bled
  EXPECT_EQ(b.balancing.left_s(3'330'000), 0U);
}

TEST(Balancing, SaturatesTheRemainingTime) {
  AtTheTop b;
  b.plan.uams_per_ppb *= 100;
  b.soc[5] = 900'000'000;
  b.step();
  EXPECT_EQ(b.balancing.left_s(1), 0xFFFF'FFFFU);
}

TEST(Balancing, CountsOnlyTheTimeInWhichACellWasBled) {
  AtTheTop even(true), odd(true);
  even.step();
  odd.step();
  for (int k = 0; k < 2'000; ++k) even.step(0.1);
  for (int k = 0; k < 1'998; ++k) odd.step(0.1001);  // fractions of milliseconds add up
  EXPECT_NEAR(even.balancing.left_s(3'330'000), odd.balancing.left_s(3'330'000), 1);
  const std::uint32_t left_s = odd.balancing.left_s(3'330'000);
  odd.balancing.stop();
  odd.step(3'600);
  EXPECT_EQ(odd.balancing.left_s(3'330'000), left_s) << "the resistors were off";
  odd.uv.fill(measurement::no_reading);
  odd.step(3'600);
  EXPECT_EQ(odd.balancing.left_s(3'330'000), left_s) << "the bled charge is unknown";
}

TEST(Balancing, RoundsTheDesignAndAssumesAtLeastOneOhm) {
  PackDesign d = forklift;
  d.bleed_ohm = 32.6;
  d.capacity_ah = 1.00015;
  EXPECT_EQ(balancing_plan(d).bleed_ohm, 33);
  EXPECT_EQ(balancing_plan(d).uams_per_ppb, 3'601) << "3600.54 As";
  d.bleed_ohm = 32.4;
  d.capacity_ah = 1.0001;
  EXPECT_EQ(balancing_plan(d).bleed_ohm, 32);
  EXPECT_EQ(balancing_plan(d).uams_per_ppb, 3'600) << "3600.36 As";
  d.bleed_ohm = 0.2;
  EXPECT_EQ(balancing_plan(d).bleed_ohm, 1) << "it is a divisor";
}

/// At 80 % each sigma has 3 % of the missing 15 % more: 0.45 %. Two sigma of both cells are 2.6 %, and the dead band.
TEST(Balancing, BelowTheTopAllowsForCellsOfOtherCapacity) {
  AtTheTop b(true);
  b.mean_ppb = 800'000'000;
  b.soc[3] = 31'000'000;
  EXPECT_EQ(b.step(), 1U << 5 | 1U << 6);
  AtTheTop beyond(true);
  beyond.mean_ppb = 800'000'000;
  beyond.soc[3] = 31'000'001;
  EXPECT_EQ(beyond.step(), 1U << 3 | 1U << 5 | 1U << 6);
  b.mean_ppb = 870'000'000;
  EXPECT_EQ(b.step(), 1U << 5 | 1U << 6) << "0.24 % instead of 0.45 % is not half";
  b.mean_ppb = 880'000'000;
  EXPECT_EQ(b.step(), 1U << 3 | 1U << 5 | 1U << 6) << "measured again";
}

TEST(Balancing, GivesWhatItHasBledOnceAndWithoutALoss) {
  AtTheTop b(true);
  EXPECT_EQ(b.balancing.take_bled_ppm(3), 0);
  std::int64_t given_ppm = 0;
  for (int k = 0; k < 6'001; ++k) {
    b.step(0.1);
    given_ppm += b.balancing.take_bled_ppm(3);
    EXPECT_EQ(b.balancing.take_bled_ppm(0), 0) << "not bled";
  }
  EXPECT_NEAR(static_cast<double>(given_ppm), 1e6 * 600 * 3.33 / 33 / (6 * 3'600), 1.5);
}

TEST(Balancing, MeasuresNothingWithAnUnknownCell) {
  AtTheTop b;
  b.soc[15] = measurement::no_reading;
  EXPECT_EQ(b.both_turns(), 0U);
  b.soc[15] = 0;
  b.sigma[15] = 10'000'001;
  EXPECT_EQ(b.both_turns(), 0U);
  b.sigma[15] = 2'000'000;
  b.current_ua = -500'000;
  b.both_turns();
  b.current_ua = 0;
  EXPECT_NE(b.both_turns(), 0U) << "not while discharging, but at rest";
}

TEST(Balancing, BleedsTheMeasuredChargeAndNoMoreUntilTheNextCharge) {
  AtTheTop b;
  const double sure_ppb = 40'000'000 - 8'000'000, expected_as = sure_ppb * 1e-9 * 6 * 3'600;  // 0.204 Ah
  b.step();
  const double left_at_first_s = b.balancing.left_s(3'330'000);
  EXPECT_NEAR(left_at_first_s, 2 * expected_as / (3.33 / 33), 20);
  double bled_as = 0, seconds = 0;
  while (b.balancing.left_s(3'330'000) > 0 && seconds < 40'000) {
    if ((b.step() >> 5 & 1) != 0) bled_as += 3.33 / 33;
    ++seconds;
  }
  EXPECT_NEAR(bled_as, expected_as, 0.3);
  EXPECT_NEAR(seconds, left_at_first_s, 20);
  EXPECT_EQ(b.both_turns(), 0U) << "one measurement at the top of a charge";
  b.mean_ppb = 800'000'000;
  b.current_ua = -3'000'000;
  b.step();
  b.current_ua = 3'000'000;
  b.mean_ppb = 960'000'000;
  EXPECT_NE(b.both_turns(), 0U) << "the next charge";
}

}  // namespace
}  // namespace bms::protection
