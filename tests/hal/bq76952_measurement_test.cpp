// The chip model by itself: what it measures, how fast, and where its ranges end. Expected values are computed by hand
// from the manual's units.
#include <cmath>

#include "tests/hal/bq76952_host.hpp"

namespace bms {
namespace {

class ChipMeasurement : public ChipWithHost {
 protected:
  using ChipWithHost::ChipWithHost;
  /// CC Gain for a shunt of 0.1 mOhm.
  static std::uint32_t gain(double value) { return std::bit_cast<std::uint32_t>(static_cast<float>(value)); }
  void configure_shunt(std::uint32_t user_amps, Values values = {}) {
    Values all{{bq::cc_gain, gain(75.684)},
               {bq::capacity_gain, gain(75.684 * 298'261.6178)},
               {bq::da_configuration, 4 | user_amps}};
    all.insert(all.end(), values.begin(), values.end());
    configure(all);
  }
  void set_current_a(double a) { in.shunt_v = 0.1e-3 * a; }
};

TEST_F(ChipMeasurement, CellsStackPackAndLdHaveTheirOwnUnitsAndRegisters) {
  for (std::size_t k = 0; k < 16; ++k) in.cell_v[k] = 2.5 + 0.1 * static_cast<double>(k);
  in.stack_v = 52.34;
  in.pack_v = 51.02;
  in.ld_v = 49.5;
  wait_s(0.2);
  for (std::size_t k = 0; k < 16; ++k) EXPECT_EQ(read(static_cast<std::uint8_t>(0x14 + 2 * k), 2), 2'500 + 100 * k);
  EXPECT_EQ(read(0x34, 2), 5'234U);  // userV of 10 mV
  EXPECT_EQ(read(0x36, 2), 5'102U);
  EXPECT_EQ(read(0x38, 2), 4'950U);
  configure({{bq::da_configuration, 0x01}});  // userV of 1 mV
  wait_s(0.2);
  EXPECT_EQ(read(0x34, 2), 32'767U) << "16 bits of 1 mV end at 32.767 V";
}

TEST_F(ChipMeasurement, ACellAboveTheRangeReadsNegative) {
  in.cell_v[3] = 5.5;
  in.cell_v[4] = 6.2;
  wait_s(0.2);
  EXPECT_EQ(read_signed(0x1A), 5'500);
  EXPECT_EQ(read_signed(0x1C), -6'060);
}

TEST_F(ChipMeasurement, CellsCanReadZeroOrKeepTheirValue) {
  wait_s(0.2);
  chip_.zero_cells = 0x03F0;
  chip_.stale_cells = 0x0001;
  in.cell_v.fill(3.4);
  wait_s(0.2);
  EXPECT_EQ(read(0x14, 2), 3'300U);
  EXPECT_EQ(read(0x16, 2), 3'400U);
  EXPECT_EQ(read(0x1C, 2), 0U);
}

TEST_F(ChipMeasurement, AScanTakes63msAndFastAdcHalvesIt) {
  for (const std::uint32_t power : {0x2882U, 0x28C2U}) {
    const Values three_thermistors{{{0x92FD, 1, 0}, 7}, {{0x92FF, 1, 0}, 7}, {{0x9300, 1, 0}, 7}};
    Values all = three_thermistors;
    all.push_back({bq::power_config, power});
    all.push_back({bq::default_alarm_mask, 0x0002});
    configure(all);
    write({0x62, 0xFF, 0xFF});
    int scans = 0;
    for (int ms = 0; ms < 1'000; ++ms) {
      wait_us(1'000);
      if (chip_.alert_level() == PinLevel::floating && (read(0x62, 2) & 2) != 0) {
        ++scans;
        write({0x62, 0x02, 0x00});
      }
    }
    EXPECT_NEAR(scans, power == 0x2882U ? 1'100 / 63 : 1'100 / 31.5, 4);
  }
}

TEST_F(ChipMeasurement, CurrentIsReportedInUserAmpsAndSaturatesAt16Bits) {
  const double unit_a[] = {0.0001, 0.001, 0.01, 0.1};
  for (std::uint32_t k = 0; k < 4; ++k) {
    configure_shunt(k);
    for (const double a : {0.0, 2.5, -3.1, 300.0, -300.0, 400.0, -400.0}) {
      set_current_a(a);
      wait_s(0.3);
      EXPECT_NEAR(read_signed(0x3A), std::clamp(std::round(a / unit_a[k]), -32768.0, 32767.0),
                  1 + 1e-4 * std::abs(a) / unit_a[k])
          << a << " A in units of " << unit_a[k];
    }
  }
}

TEST_F(ChipMeasurement, TheCoulombCounterSaturatesAtItsFullScale) {
  configure_shunt(3);
  set_current_a(3'000);  // 300 mV
  wait_s(0.3);
  EXPECT_NEAR(read_signed(0x3A), 24'800, 5) << "248 mV / 0.1 mOhm in units of 100 mA";
  EXPECT_EQ(block(0x0075, 24, 4), 0x7FFFFFU) << "24 bits of raw counts, sign extended";
  set_current_a(-3'000);
  wait_s(0.3);
  EXPECT_EQ(block(0x0075, 24, 4), 0xFF800000U);
}

class WrappingChip : public ChipMeasurement {
 protected:
  WrappingChip() : ChipMeasurement({.user_current_wraps = true, .adc_limit_v = 0.2}) {}
};

TEST_F(WrappingChip, ACurrentOutsideOf16BitsChangesItsSign) {
  configure_shunt(2);
  set_current_a(400);
  wait_s(0.3);
  EXPECT_NEAR(read_signed(0x3A), 40'000 - 65'536, 5);
  configure_shunt(3);
  set_current_a(3'000);
  wait_s(0.3);
  EXPECT_NEAR(read_signed(0x3A), 20'000, 5);
}

TEST_F(ChipMeasurement, TheThreeFiltersFollowAStepAfterTheirOwnTimes) {
  configure_shunt(2, {{bq::cc3_samples, 67}});
  wait_s(1);
  set_current_a(100);
  wait_us(6'100);
  EXPECT_NEAR(read_signed(0x3A), 10'000, 2) << "CC2 after two conversions of 3 ms";
  EXPECT_LE(block(0x0075, 20, 2), 10'000U * 3 / 67) << "CC3 is the mean of 67";
  wait_s(0.5);
  EXPECT_NEAR(static_cast<std::int16_t>(block(0x0075, 20, 2)), 10'000, 2);
  EXPECT_NEAR(static_cast<std::int16_t>(block(0x0075, 22, 2)), 10'000, 2) << "CC1, 250 ms";
  // VREF2 / 5 / 2^23 = 29.56 nV
  EXPECT_NEAR(static_cast<std::int32_t>(block(0x0075, 24, 4)), 0.01 / 29.5639e-9, 10);
}

TEST_F(ChipMeasurement, ChargeIsCountedInUserAhWithAFractionOf32Bits) {
  configure_shunt(2);
  subcommand(0x0082);
  set_current_a(-72);
  wait_s(100);
  const auto whole = static_cast<std::int32_t>(block(0x0076, 0, 4));
  const unsigned fraction = block(0x0076, 4, 4);
  const double user_ah = whole + fraction / 4294967296.0 - 0.5;
  EXPECT_NEAR(user_ah, -72 * 100 / 36.0, 0.6) << "units of 10 mAh";
  EXPECT_NEAR(block(0x0076, 8, 4), 100, 1);
}

TEST_F(ChipMeasurement, TheBoardOffsetIsSubtracted) {
  configure_shunt(1, {{bq::board_offset, 6'400}});  // 100 counts of 29.56 nV, 2.956 uV
  wait_s(0.1);
  EXPECT_NEAR(read_signed(0x3A), -29.6, 1);
}

TEST_F(ChipMeasurement, ThermistorsFollowTheirCurveAndBrokenOnesReadTheEnds) {
  configure({{{0x92FA, 1, 0}, 7}, {{0x92FD, 1, 0}, 7}, {{0x92FF, 1, 0}, 7}, {{0x9300, 1, 0}, 7}});
  set_thermistor(ThermistorPin::cfetoff, 25);
  set_thermistor(ThermistorPin::ts1, -20);
  in.thermistor_ohm[static_cast<std::size_t>(ThermistorPin::hdq)] = 0;
  in.internal_c = 31;
  wait_s(0.3);
  EXPECT_NEAR(read(0x6A, 2), 2'981.5, 1);
  EXPECT_NEAR(read(0x70, 2), 2'531.5, 1);
  EXPECT_EQ(read(0x74, 2), 0U) << "open";
  EXPECT_EQ(read(0x76, 2), 32'767U) << "shorted";
  EXPECT_EQ(read(0x72, 2), 0U) << "TS2 is not configured";
  EXPECT_NEAR(read(0x68, 2), 3'041.5, 1);
}

/// A cell between 3.328 V (0x0D00) and 3.327 V (0x0CFF), read again and again.
int torn_readings(Bq76952Model& chip, Bq76952Inputs in) {
  int torn = 0;
  for (int k = 0; k < 20'000; ++k) {
    in.cell_v[15] = k / 200 % 2 == 0 ? 3.328 : 3.327;
    chip.advance(10, in);
    std::array<std::uint8_t, 2> got{};
    chip.transfer(0x08, std::array<std::uint8_t, 1>{0x32}, got);
    const int mv = got[0] | got[1] << 8;
    torn += mv != 0 && mv != 3'327 && mv != 3'328 ? 1 : 0;
  }
  return torn;
}

TEST(ChipRegisters, TearOnlyInTheVariantThatDoesNotLatchTheHighByte) {
  Bq76952Inputs in;
  in.cell_v.fill(3.3);
  Bq76952Model latching, tearing({.tears_within_transfer = true});
  EXPECT_EQ(torn_readings(latching, in), 0);
  EXPECT_GT(torn_readings(tearing, in), 0);
}

TEST_F(ChipMeasurement, TwoTransfersOfOneByteTearAlways) {
  int torn = 0;
  for (int k = 0; k < 100; ++k) {
    in.cell_v[15] = 3.328;
    wait_us(60'000);
    const unsigned low = read(0x32);
    in.cell_v[15] = 3.327;
    wait_us(30'000);
    const unsigned mv = low | read(0x33) << 8;
    torn += mv == 0x0C00 ? 1 : 0;
  }
  EXPECT_GT(torn, 0);
}

class ChipWithShortTransfers : public ChipMeasurement {
 protected:
  ChipWithShortTransfers() : ChipMeasurement({.transfer_spans_commands = false}) {}
};

TEST_F(ChipWithShortTransfers, ATransferEndsAfterOneDirectCommand) {
  wait_s(0.2);
  EXPECT_EQ(read(0x14, 4), 0xFFFF0CE4U);
}

TEST_F(ChipMeasurement, BalancingByTheHostEndsAfter20s) {
  write_block(0x0083, 2, 0x0010);
  EXPECT_EQ(block(0x0083, 0, 2), 0x0010U);
  wait_s(19.9);
  EXPECT_EQ(chip_.balancing(), 0x0010);
  wait_s(0.2);
  EXPECT_EQ(chip_.balancing(), 0);
}

}  // namespace
}  // namespace bms
