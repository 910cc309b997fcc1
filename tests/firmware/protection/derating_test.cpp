#include "protection/derating.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "plant/random.hpp"
#include "tests/firmware/protection/expected_rows.hpp"

namespace bms::protection {
namespace {

constexpr DeratingPlan plan6a = derating_plan(forklift);
constexpr DeratingInput far_from_limits{.highest_cell_uv = 3'300'000,
                                        .lowest_cell_uv = 3'290'000,
                                        .highest_cdegc = 2'500,
                                        .lowest_cdegc = 2'400,
                                        .soc_ppb = 500'000'000};

AllowedCurrent steady_state(const DeratingInput& in) {
  Derating d(plan6a);
  AllowedCurrent a;
  for (int k = 0; k < 100; ++k) a = d.update(in, 100'000);
  return a;
}

struct Point {
  const char* what;
  DeratingInput in;
  double charge_a, discharge_a;
};

DeratingInput with(void (*change)(DeratingInput&)) {
  DeratingInput in = far_from_limits;
  change(in);
  return in;
}

/// Calculated by hand from the ramps: span 1.65 V, -20 to 60 degrees C, 6 A.
const Point points[] = {
    {"far from all limits", far_from_limits, 6, 6},
    {"6 % of the span below the upper limit", with([](auto& i) { i.highest_cell_uv = 3'551'000; }), 6, 6},
    {"3 % below the upper limit", with([](auto& i) { i.highest_cell_uv = 3'600'500; }), 3, 6},
    {"at the upper limit", with([](auto& i) { i.highest_cell_uv = 3'650'000; }), 0, 6},
    {"above it", with([](auto& i) { i.highest_cell_uv = 3'900'000; }), 0, 6},
    {"30 % of the span above the lower limit", with([](auto& i) { i.lowest_cell_uv = 2'495'000; }), 6, 6},
    {"15 % above the lower limit", with([](auto& i) { i.lowest_cell_uv = 2'247'500; }), 6, 3},
    {"at the lower limit", with([](auto& i) { i.lowest_cell_uv = 2'000'000; }), 6, 0},
    {"freezing", with([](auto& i) { i.lowest_cdegc = 0; }), 0, 6},
    {"5 degrees", with([](auto& i) { i.lowest_cdegc = 500; }), 3, 6},
    {"10 degrees", with([](auto& i) { i.lowest_cdegc = 1'000; }), 6, 6},
    {"-12.5 degrees", with([](auto& i) { i.lowest_cdegc = -1'250; }), 0, 3},
    {"40 degrees", with([](auto& i) { i.highest_cdegc = 4'000; }), 6, 6},
    {"42.5 degrees", with([](auto& i) { i.highest_cdegc = 4'250; }), 3, 6},
    {"45 degrees", with([](auto& i) { i.highest_cdegc = 4'500; }), 0, 6},
    {"55 degrees", with([](auto& i) { i.highest_cdegc = 5'500; }), 0, 3},
    {"95 %", with([](auto& i) { i.soc_ppb = 950'000'000; }), 6, 6},
    {"100 %: a fifth remains", with([](auto& i) { i.soc_ppb = 1'000'000'000; }), 1.2, 6},
    {"120 %", with([](auto& i) { i.soc_ppb = 1'200'000'000; }), 1.2, 6},
    {"10 %", with([](auto& i) { i.soc_ppb = 100'000'000; }), 6, 6},
    {"0 %: a fifth remains", with([](auto& i) { i.soc_ppb = 0; }), 6, 1.2},
    {"10 %, sigma 5 %", with([](auto& i) {
       i.soc_ppb = 100'000'000;
       i.soc_sigma_ppb = 50'000'000;
     }),
     6, 3.6},
    {"95 %, sigma 2.5 %", with([](auto& i) {
       i.soc_ppb = 950'000'000;
       i.soc_sigma_ppb = 25'000'000;
     }),
     3.6, 6},
    {"40 %, sigma 60 %", with([](auto& i) {
       i.soc_ppb = 400'000'000;
       i.soc_sigma_ppb = 600'000'000;
     }),
     1.2, 1.2},
    {"50 %, sigma 200 %", with([](auto& i) { i.soc_sigma_ppb = 2'000'000'000; }), 1.2, 1.2},
    {"210 %, sigma 210 %", with([](auto& i) {
       i.soc_ppb = 2'100'000'000;
       i.soc_sigma_ppb = 2'100'000'000;
     }),
     1.2, 1.2},
    {"-200 %, sigma 200 %", with([](auto& i) {
       i.soc_ppb = -2'000'000'000;
       i.soc_sigma_ppb = 2'000'000'000;
     }),
     1.2, 1.2},
    {"95 %, negative sigma", with([](auto& i) {
       i.soc_ppb = 950'000'000;
       i.soc_sigma_ppb = -50'000'000;
     }),
     6, 6},
    {"unknown soc", with([](auto& i) { i.soc_ppb = measurement::no_reading; }), 6, 6},
    {"the model allows 2 A and 4 A", with([](auto& i) {
       i.model_charge_ua = 2'000'000;
       i.model_discharge_ua = 4'000'000;
     }),
     2, 4},
    {"the model allows negative currents", with([](auto& i) { i.model_charge_ua = i.model_discharge_ua = -1'000'000; }),
     0, 0},
    {"the model allows 2 A, and a fault derates", with([](auto& i) {
       i.model_charge_ua = 2'000'000;
       i.derate = true;
     }),
     1, 3},
    {"the model allows 0 A", with([](auto& i) { i.model_charge_ua = i.model_discharge_ua = 0; }), 0, 0},
    {"a fault derates", with([](auto& i) { i.derate = true; }), 3, 3},
    {"charge forbidden", with([](auto& i) { i.charge_forbidden = true; }), 0, 6},
    {"discharge forbidden", with([](auto& i) { i.discharge_forbidden = true; }), 6, 0},
    {"unknown temperature", with([](auto& i) { i.highest_cdegc = i.lowest_cdegc = measurement::no_reading; }), 0, 3},
};

TEST(Derating, RampsDownBeforeEachLimit) {
  for (const Point& p : points) {
    const AllowedCurrent a = steady_state(p.in);
    EXPECT_NEAR(a.charge_ua / 1e6, p.charge_a, 0.004) << p.what;  // less than 1/1024 of 6 A
    EXPECT_NEAR(a.discharge_ua / 1e6, p.discharge_a, 0.004) << p.what;
    // The full current and 0 are exact.
    if (p.charge_a == 0 || p.charge_a == 6) {
      EXPECT_EQ(a.charge_ua, 1e6 * p.charge_a) << p.what;
    }
    if (p.discharge_a == 0 || p.discharge_a == 6) {
      EXPECT_EQ(a.discharge_ua, 1e6 * p.discharge_a) << p.what;
    }
  }
}

TEST(Derating, NeverExceedsItsSlewRate) {
  plant::Random random(5);
  Derating d(plan6a);
  AllowedCurrent before;
  const auto any = [&](std::int32_t low, std::int32_t high) {
    return random.uniform() < 0.05 ? measurement::no_reading
                                   : low + static_cast<std::int32_t>(random.uniform() * (high - low));
  };
  for (int k = 0; k < 20'000; ++k) {
    DeratingInput in{.highest_cell_uv = any(1'000'000, 4'000'000),
                     .lowest_cell_uv = any(1'000'000, 4'000'000),
                     .highest_cdegc = any(-3'000, 7'000),
                     .lowest_cdegc = any(-3'000, 7'000),
                     .soc_ppb = any(-200'000'000, 1'200'000'000),
                     .soc_sigma_ppb = any(0, 900'000'000),
                     .model_charge_ua = any(0, 10'000'000),
                     .model_discharge_ua = any(0, 10'000'000),
                     .derate = random.uniform() < 0.3};
    const std::uint32_t step_us = static_cast<std::uint32_t>(random.uniform() * 200'000);
    const AllowedCurrent now = d.update(in, step_us);
    const double down_a = 6 * step_us * 1e-6 + 2e-6, up_a = down_a / 5 + 2e-6;
    for (const auto& [a, b] :
         {std::pair{before.charge_ua, now.charge_ua}, std::pair{before.discharge_ua, now.discharge_ua}}) {
      ASSERT_LE((b - a) / 1e6, up_a);
      ASSERT_LE((a - b) / 1e6, down_a);
      ASSERT_GE(b, 0);
      ASSERT_LE(b, 6'000'000);
    }
    before = now;
  }
}

TEST(Derating, IsContinuousInItsInputs) {
  const auto sweep = [](std::int32_t DeratingInput::*field, std::int32_t from, std::int32_t to, std::int32_t step) {
    DeratingInput in = far_from_limits;
    in.*field = from;
    AllowedCurrent before = steady_state(in);
    for (std::int32_t v = from; v <= to; v += step) {
      in.*field = v;
      const AllowedCurrent now = steady_state(in);
      ASSERT_LE(std::abs(now.charge_ua - before.charge_ua), 100'000) << v;
      ASSERT_LE(std::abs(now.discharge_ua - before.discharge_ua), 100'000) << v;
      before = now;
    }
  };
  sweep(&DeratingInput::highest_cell_uv, 3'500'000, 3'700'000, 1'000);
  sweep(&DeratingInput::lowest_cell_uv, 1'900'000, 2'600'000, 5'000);
  sweep(&DeratingInput::highest_cdegc, 3'500, 6'500, 5);
  sweep(&DeratingInput::lowest_cdegc, -2'500, 1'500, 5);
  sweep(&DeratingInput::soc_ppb, -100'000'000, 1'100'000'000, 1'000'000);
}

/// Derating counts 2^20 us as a second, which is 5 % slower.
TEST(Derating, DecreasesInASecondAndIncreasesInFive) {
  for (const auto& [derate_again, expected_s] : {std::pair{false, 2.5 * 1.05}, std::pair{true, 0.5 * 1.05}}) {
    Derating d(plan6a);
    DeratingInput in = far_from_limits;
    in.derate = !derate_again;
    for (int k = 0; k < 1'000; ++k) d.update(in, 10'000);
    in.derate = derate_again;
    double took_s = 0;
    while (d.update(in, 10'000).discharge_ua != (derate_again ? 3'000'000 : 6'000'000) && took_s < 10) took_s += 0.01;
    EXPECT_NEAR(took_s, expected_s, 0.02);
  }
  Derating d(plan6a);
  EXPECT_EQ(d.update(far_from_limits, 60'000'000).charge_ua, 1'200'000) << "a step of a minute counts as a second";
}

/// A cell with different limits for charge and discharge, and a minimum temperature above freezing.
TEST(Derating, OfAnotherCellUsesItsLimits) {
  PackDesign design = forklift;
  design.limits = {.voltage_min_v = 2.5,
                   .voltage_max_v = 4.2,
                   .charge_current_max_a = 1.5,
                   .discharge_current_max_a = 3,
                   .temperature_min_c = 5,
                   .temperature_max_c = 50};
  const DeratingPlan plan = derating_plan(design);
  const auto allowed = [&](DeratingInput in) {
    Derating d(plan);
    for (int k = 0; k < 100; ++k) d.update(in, 100'000);
    return d.update(in, 100'000);
  };
  DeratingInput in{
      .highest_cell_uv = 3'700'000, .lowest_cell_uv = 3'700'000, .highest_cdegc = 2'500, .lowest_cdegc = 2'500};
  EXPECT_EQ(allowed(in).charge_ua, 1'500'000);
  EXPECT_EQ(allowed(in).discharge_ua, 3'000'000);
  in.lowest_cdegc = 500;
  EXPECT_EQ(allowed(in).charge_ua, 0) << "charging starts above its own minimum temperature";
  EXPECT_EQ(allowed(in).discharge_ua, 0);
  in.lowest_cdegc = 1'000;
  EXPECT_NEAR(allowed(in).charge_ua, 750'000, 2'000);
  EXPECT_NEAR(allowed(in).discharge_ua, 1'000'000, 3'000);
}

TEST(Derating, ForbidsAtOnceAndAllowsSlowly) {
  Derating d(plan6a);
  for (int k = 0; k < 100; ++k) d.update(far_from_limits, 100'000);
  DeratingInput in = far_from_limits;
  in.charge_forbidden = true;
  EXPECT_EQ(d.update(in, 100'000).charge_ua, 0);
  EXPECT_NEAR(d.update(far_from_limits, 100'000).charge_ua, 120'000, 10'000) << "full current after five seconds";
}

}  // namespace
}  // namespace bms::protection
