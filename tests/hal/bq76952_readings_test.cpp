// The range of the current, readings that change while they are read, packs with fewer cells, and the calibration.
// Expected values come from Ohm's law at the shunt and the wiring of the cells.
#include <bit>
#include <random>

#include "hal/bq76952/pack_readings.hpp"
#include "tests/hal/bq76952_bench.hpp"

namespace bms {
namespace {

using hal::bq76952::Board;
using hal::bq76952::Configuration;
using measurement::no_reading;

// ---- range of the current ----

TEST_F(Bq76952, ACurrentBeyondTheRangeReadsAsItsEndWithItsSign) {
  start();
  // 16 bits of 10 mA end at 327.67 A; the chip's converter at 2,000 A or 2,480 A (200 or 248 mV at 0.1 mOhm)
  for (const double a : {320.0, -320.0, 328.0, -328.0, 400.0, -400.0, 655.4, -655.4, 983.0, 2'600.0, -2'600.0, 20.0}) {
    model.current_a = a;
    model.advance(300'000);
    next(400'000);
    if (std::abs(a) > 327.67) {
      EXPECT_EQ(sample.current_ua, a > 0 ? 327'670'000 : -327'670'000) << a;
    } else {
      EXPECT_NEAR(sample.current_ua * 1e-6, a, 0.0023 * 650) << "after a step: 0.23 % of it";
    }
    EXPECT_NE(sample.cell_uv[0], no_reading);
  }
  model.current_a = 500;
  for (int k = 0; k < 100; ++k) {
    next();
    if (k > 3) {
      ASSERT_EQ(sample.current_ua, 327'670'000) << k << ", whatever charge is counted";
    }
  }
}

TEST_F(Bq76952, TwoFormsOfTheCurrentThatContradictEachOtherGiveNoReading) {
  start();
  model.current_a = 50;
  model.advance(300'000);
  next(400'000);
  EXPECT_NEAR(sample.current_ua * 1e-6, 50, 0.1);
  model.set(bq::cc_gain, std::bit_cast<std::uint32_t>(75.684F * 1.05F));  // a bit of the chip's memory flips
  model.advance(300'000);
  next(400'000);
  EXPECT_EQ(sample.current_ua, no_reading);
  EXPECT_EQ(front_end.counters().current_differs, 1U);
}

constexpr Board large{.current_range_a = 1'060,
                      .overvoltage_v = 3.8,
                      .undervoltage_v = 2.0,
                      .voltage_delay_s = 1,
                      .overcurrent_a = 1'200,
                      .overcurrent_delay_s = 0.42,
                      .high_overcurrent_a = 1'500,
                      .high_overcurrent_delay_s = 0.3,
                      .short_circuit_a = 2'000};
constexpr auto large_settings = hal::bq76952::settings(large);
constexpr Configuration large_configuration = hal::bq76952::configuration(large, large_settings);

class LargePack : public Bq76952 {
 protected:
  LargePack() : Bq76952(large_configuration) {}
};

TEST_F(LargePack, MeasuresCurrentsOfUpTo2000AToAHundredthOfAnAmpereAtRest) {
  for (const double a : {0.0, 1.234, -327.7, 700.05, -1'000.0, 1'990.0}) {
    model.current_a = a;
    model.advance(200'000);
    model.reset();  // restarts the comparison with the counted charge
    ASSERT_LE(samples_until_complete(), 40);
    for (int k = 0; k < 100; ++k) ASSERT_NEAR(next().current_ua * 1e-6, a, 0.005 + 0.001 * std::abs(a)) << k;
  }
  for (const double a : {-2'100.0, 2'400.0}) {
    model.current_a = a;
    model.advance(300'000);
    next(400'000);
    EXPECT_NEAR(sample.current_ua * 1e-6, a < 0 ? -2'000 : 2'000, 1) << "200 mV at the shunt";
  }
}

TEST_F(LargePack, CountsTheChargeInItsOwnUnit) {
  model.current_a = -800;
  model.cc3_loses = 0.01;  // the mean misses 8 A, the counted charge does not
  start();
  for (int k = 0; k < 4'000; ++k) next();
  double sum_a = 0;
  for (int k = 0; k < 100; ++k) sum_a += next().current_ua * 1e-6;
  EXPECT_NEAR(sum_a / 100, -800, 0.1 + 0.0008 * 800);
}

// ---- a register that changes while it is read ----

TEST_F(Bq76952, AValueAcrossAByteBoundaryIsNeverOffByAByte) {
  set_cells(3.327, 0);
  model.stack_v = 51.19;
  start();
  std::mt19937 random(4);
  std::uniform_int_distribution<std::uint64_t> before_us(1'000, 31'000);
  for (int run = 0; run < 3'000; ++run) {
    const std::uint64_t us = before_us(random);
    model.advance(90'000 - us - model.time_us % 100);
    const double v = run % 2 == 0 ? 3.328 : 3.327;  // 0x0D00 and 0x0CFF, of this scan or of the last one
    for (double& cell : model.cell_v) cell = v;
    model.stack_v = run % 2 == 0 ? 51.2 : 51.19;  // 0x1400 and 0x13FF in steps of 10 mV
    next();
    for (const std::int32_t uv : sample.cell_uv) {
      if (uv != no_reading) {
        ASSERT_NEAR(uv, 3'327'500, 600) << run;
      }
    }
    if (sample.pack_uv != no_reading) {
      ASSERT_NEAR(sample.pack_uv, 51'195'000, 6'000) << run;
    }
  }
}

// ---- packs with fewer cells ----

class SmallPack : public Bq76952, public ::testing::WithParamInterface<std::size_t> {
 protected:
  static Board board_of(std::size_t cells) {
    Board b = board_under_test;
    b.cell_inputs = hal::bq76952::inputs_of_pack(cells);
    return b;
  }
  struct Parts {
    explicit Parts(std::size_t cells)
        : settings(hal::bq76952::settings(board_of(cells))),
          configuration(hal::bq76952::configuration(board_of(cells), settings)) {}
    decltype(hal::bq76952::settings(board_under_test)) settings;
    Configuration configuration;
  };
  static const Parts& parts(std::size_t cells) {
    static const Parts eight(8), fifteen(15);
    return cells == 8 ? eight : fifteen;
  }
  SmallPack() : Bq76952(parts(GetParam()).configuration) {
    // Unused inputs are connected to their neighbour: 0 V. The highest cell is at input 16.
    const std::size_t cells = GetParam();
    model.cell_v.fill(0);
    for (std::size_t k = 0; k + 1 < cells; ++k) model.cell_v[k] = 3.2 + 0.01 * static_cast<double>(k);
    model.cell_v[15] = 3.2 + 0.01 * static_cast<double>(cells - 1);
    model.stack_v = std::accumulate(model.cell_v.begin(), model.cell_v.end(), 0.0);
  }
  template <std::size_t Cells>
  void expect_cells() {
    for (int k = 0; k < 30; ++k) next();
    measurement::PackSample<Cells> pack;
    hal::bq76952::read_pack(sample, configuration, {}, pack);
    for (std::size_t k = 0; k < Cells; ++k) EXPECT_NEAR(pack.cell_uv[k], 3'200'000 + 10'000 * static_cast<int>(k), 501);
    EXPECT_NEAR(pack.pack_uv * 1e-6, model.stack_v, 0.006);
    EXPECT_EQ(pack.current_ua, sample.current_ua);
    EXPECT_EQ(pack.temperature_cdegc, sample.temperature_cdegc);
  }
};

TEST_P(SmallPack, CellsAreInTheOrderOfThePackAndUnusedInputsDoNotTrip) {
  if (GetParam() == 8)
    expect_cells<8>();
  else
    expect_cells<15>();
  EXPECT_EQ(model.memory(0x9304, 2), GetParam() == 8 ? 0x807FU : 0xBFFFU) << "Vcell Mode";
  EXPECT_EQ(sample.cell_uv[14], no_reading) << "an input without a cell";
  EXPECT_EQ(front_end.trips(), 0U);
  EXPECT_TRUE(model.enables_contactors());
}

TEST_P(SmallPack, BalancingReachesTheInputOfTheCell) {
  for (int k = 0; k < 30; ++k) next();
  front_end.bleed(hal::bq76952::inputs_of(configuration, 0x0005));
  next();
  EXPECT_EQ(model.balancing(), 0x0005);
  front_end.bleed(hal::bq76952::inputs_of(configuration, 1U << (GetParam() - 1)));
  next();
  EXPECT_EQ(model.balancing(), 0x8000) << "the highest cell";
}

INSTANTIATE_TEST_SUITE_P(Cells, SmallPack, ::testing::Values(8, 15),
                         [](const auto& p) { return std::to_string(p.param); });

// ---- calibration ----

TEST(PackReadings, AreCorrectedByGainAndOffsetAndStayMissing) {
  measurement::PackSample<16> inputs;
  inputs.time_us = 5;
  inputs.current_ua = -100'000'000;
  inputs.pack_uv = 52'800'000;
  inputs.cell_uv.fill(3'300'000);
  inputs.cell_uv[2] = no_reading;
  measurement::PackSample<16> pack;
  hal::bq76952::read_pack(inputs, hal::bq76952::board_configuration, {1'000, -2'000, 60'000, 25'000}, pack);
  EXPECT_EQ(pack.time_us, 5U);
  EXPECT_EQ(pack.current_ua, -105'975'000) << "6 % more, and 25 mA";
  EXPECT_EQ(pack.cell_uv[0], 3'301'300) << "0.1 % more, and -2 mV";
  EXPECT_EQ(pack.cell_uv[2], no_reading);
  EXPECT_EQ(pack.pack_uv, 52'852'800 - 16 * 2'000) << "the sum of corrected cells";
  inputs.current_ua = no_reading;
  hal::bq76952::read_pack(inputs, hal::bq76952::board_configuration, {0, 0, 60'000, 25'000}, pack);
  EXPECT_EQ(pack.current_ua, no_reading);
  inputs.current_ua = 2'100'000'000;
  hal::bq76952::read_pack(inputs, hal::bq76952::board_configuration, {0, 0, 50'000, 0}, pack);
  EXPECT_EQ(pack.current_ua, 2'147'000'000) << "the end of 32 bits";
}

}  // namespace
}  // namespace bms
