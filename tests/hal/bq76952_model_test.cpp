// The chip model by itself: protections, latches, permanent failures and outputs. Expected values are computed by hand
// from the descriptions of the settings in TI's manual.
#include <cmath>
#include <functional>

#include "tests/hal/bq76952_host.hpp"

namespace bms {
namespace {

using bq::Setting;

/// A fault of the circuit that a comparator of the chip detects.
struct Comparator {
  const char* name;
  std::uint8_t bit;
  Values settings;
  std::uint64_t delay_us;
  std::function<void(Bq76952Inputs&)> below, above;  ///< just not, and just exceeded
  bool opens_dsg, opens_chg;
};

void set_cell(Bq76952Inputs& in, double v) { in.cell_v[6] = v; }
void set_shunt_mv(Bq76952Inputs& in, double mv) { in.shunt_v = 1e-3 * mv; }

std::vector<Comparator> comparators() {
  const auto cell = [](double v) { return [=](Bq76952Inputs& in) { set_cell(in, v); }; };
  const auto shunt = [](double mv) { return [=](Bq76952Inputs& in) { set_shunt_mv(in, mv); }; };
  return {
      // 49 x 50.6 mV = 2.4794 V; 3.3 ms x (2 + 10) = 39.6 ms
      {"CUV", bq::cuv, {{bq::cuv_threshold, 49}, {bq::cuv_delay, 10}}, 39'600, cell(2.480), cell(2.479), true, false},
      // 75 x 50.6 mV = 3.795 V; 3.3 ms x (2 + 301) = 999.9 ms
      {"COV",
       bq::cov,
       {{bq::cov_threshold, 75}, {bq::cov_delay, 301}},
       999'900,
       cell(3.7949),
       cell(3.7951),
       false,
       true},
      // 10 x 2 mV; 3.3 ms x (2 + 4) = 19.8 ms
      {"OCC", bq::occ, {{bq::occ_threshold, 10}, {bq::occ_delay, 4}}, 19'800, shunt(19.9), shunt(20.1), false, true},
      {"OCD1",
       bq::ocd1,
       {{bq::ocd1_threshold, 20}, {bq::ocd1_delay, 1}},
       9'900,
       shunt(-39.9),
       shunt(-40.1),
       true,
       false},
      {"OCD2",
       bq::ocd2,
       {{bq::ocd2_threshold, 16}, {bq::ocd2_delay, 127}},
       425'700,
       shunt(-31.9),
       shunt(-32.1),
       true,
       false},
      // setting 3 is 60 mV, (31 - 1) x 15 us
      {"SCD", bq::scd, {{bq::scd_threshold, 3}, {bq::scd_delay, 31}}, 450, shunt(-59.9), shunt(-60.1), true, true},
  };
}

class Comparators : public ChipWithHost, public ::testing::WithParamInterface<std::uint64_t> {
 protected:
  /// Waits with the time step of the parameter.
  void wait_in_steps(std::uint64_t us) {
    for (std::uint64_t left = us; left > 0;) {
      const std::uint64_t now = std::min(left, GetParam());
      wait_us(now);
      left -= now;
    }
  }
};

TEST_P(Comparators, TripAboveTheirThresholdAfterTheirDelayWhateverTheTimeStep) {
  for (const Comparator& c : comparators()) {
    SCOPED_TRACE(c.name);
    Values values = c.settings;
    values.push_back({bq::enabled_protections_a, c.bit});
    configure_outputs(values);
    EXPECT_TRUE(chip_.enables_contactors());
    c.below(in);
    wait_in_steps(2 * c.delay_us);
    EXPECT_EQ(safety_a(), 0U);
    c.above(in);
    wait_in_steps(c.delay_us - 1);
    EXPECT_EQ(safety_a(), 0U);
    EXPECT_EQ(chip_.protections().alert(bq::Protections::a), c.bit);
    EXPECT_TRUE(chip_.enables_contactors());
    wait_in_steps(1);
    EXPECT_EQ(safety_a(), c.bit);
    EXPECT_EQ(chip_.protections().alert(bq::Protections::a), 0U);
    EXPECT_EQ(chip_.ddsg(), !c.opens_dsg);
    EXPECT_EQ(chip_.dchg(), !c.opens_chg);
    EXPECT_EQ(read(0x03), c.bit);
    restore();
  }
}

TEST_P(Comparators, DoNotTripIfTheFaultEndsBeforeTheDelay) {
  for (const Comparator& c : comparators()) {
    SCOPED_TRACE(c.name);
    Values values = c.settings;
    values.push_back({bq::enabled_protections_a, c.bit});
    configure_outputs(values);
    for (int k = 0; k < 3; ++k) {
      c.above(in);
      wait_in_steps(c.delay_us - 1);
      c.below(in);
      wait_in_steps(1);
    }
    EXPECT_EQ(safety_a(), 0U);
    restore();
  }
}

INSTANTIATE_TEST_SUITE_P(TimeSteps, Comparators, ::testing::Values(10, 137, 1'000, 1'000'000));

class ChipModel : public ChipWithHost {};

TEST_F(ChipModel, AProtectionThatIsNotEnabledDoesNotTrip) {
  configure_outputs({{bq::scd_threshold, 0}});
  set_shunt_mv(in, -400);
  set_cell(in, 5.4);
  wait_s(10);
  set_cell(in, 0.1);
  wait_s(10);
  EXPECT_EQ(safety_a() | safety_b() | safety_c(), 0U);
  EXPECT_TRUE(chip_.enables_contactors());
}

TEST_F(ChipModel, EveryThresholdOfShortCircuitIsThatOfTheTable) {
  const double mv[] = {10, 20, 40, 60, 80, 100, 125, 150, 175, 200, 250, 300, 350, 400, 450, 500};
  for (unsigned k = 0; k < 16; ++k) {
    restore();
    configure_outputs({{bq::scd_threshold, k}, {bq::scd_delay, 2}, {bq::enabled_protections_a, bq::scd}});
    set_shunt_mv(in, -mv[k] + 0.1);
    wait_us(1'000);
    EXPECT_EQ(safety_a(), 0U) << k;
    set_shunt_mv(in, -mv[k] - 0.1);
    wait_us(14);
    EXPECT_EQ(safety_a(), 0U) << k;
    wait_us(1);
    EXPECT_EQ(safety_a(), bq::scd) << k;
  }
}

TEST_F(ChipModel, AfterPowerOnShortCircuitAndOvervoltageAreEnabledWithTheDefaults) {
  set_shunt_mv(in, -10.1);
  wait_us(15);
  EXPECT_EQ(read(0x03), bq::scd);
  in.shunt_v = 0;
  set_cell(in, 86 * 0.0506 + 0.001);
  wait_us(3'300 * 76);
  EXPECT_EQ(read(0x03) & bq::cov, bq::cov);
  EXPECT_EQ(chip_.ddsg_level(), PinLevel::floating) << "the pins have no function yet";
}

TEST_F(ChipModel, CellVoltageFaultsRecoverBeyondTheirHysteresisAfterTheRecoveryTime) {
  configure_outputs({{bq::enabled_protections_a, bq::cuv | bq::cov},
                     {bq::cuv_threshold, 40},
                     {bq::cov_threshold, 70},
                     {bq::cuv_hysteresis, 4},
                     {bq::cov_hysteresis, 4}});
  set_cell(in, 1.9);  // threshold 2.024 V, with hysteresis 2.2264 V
  wait_s(1);
  ASSERT_EQ(safety_a(), bq::cuv);
  set_cell(in, 2.226);
  wait_s(10);
  EXPECT_EQ(safety_a(), bq::cuv);
  set_cell(in, 2.227);
  wait_s(2.999);
  EXPECT_FALSE(chip_.ddsg());
  wait_s(0.001);
  EXPECT_TRUE(chip_.ddsg());
  set_cell(in, 3.6);  // threshold 3.542 V, with hysteresis 3.3396 V
  wait_s(1);
  ASSERT_EQ(safety_a(), bq::cov);
  EXPECT_TRUE(chip_.ddsg() && !chip_.dchg());
  set_cell(in, 3.340);
  wait_s(10);
  EXPECT_EQ(safety_a(), bq::cov);
  set_cell(in, 3.339);
  wait_s(3);
  EXPECT_EQ(safety_a(), 0U);
}

TEST_F(ChipModel, AnInputWithoutACellHasNoProtection) {
  configure_outputs({{bq::enabled_protections_a, bq::cuv | bq::cov}, {bq::vcell_mode, 0xFFBF}});
  set_cell(in, 0);  // cell 7, between two inputs that are connected to each other
  wait_s(2);
  EXPECT_EQ(safety_a(), 0U);
  in.cell_v[7] = 0;
  wait_s(2);
  EXPECT_EQ(safety_a(), bq::cuv);
}

TEST_F(ChipModel, AShortCircuitRecoversByTimeAndTripsAgainWhileItLasts) {
  configure_outputs({{bq::enabled_protections_a, bq::scd}, {bq::scd_recovery_time, 5}});
  set_shunt_mv(in, -20);
  wait_us(15);
  ASSERT_FALSE(chip_.ddsg() || chip_.dchg());
  wait_us(4'999'999);
  EXPECT_FALSE(chip_.ddsg());
  wait_us(1);
  EXPECT_TRUE(chip_.ddsg());
  wait_us(15);
  EXPECT_FALSE(chip_.ddsg());
}

TEST_F(ChipModel, OvercurrentInDischargeDoesNotRecoverAtRestByDefaultButWhileCharging) {
  configure_outputs({{bq::enabled_protections_a, bq::ocd1}});
  set_shunt_mv(in, -9);
  wait_s(1);
  ASSERT_EQ(safety_a(), bq::ocd1);
  in.shunt_v = 0;
  wait_s(60);
  EXPECT_EQ(safety_a(), bq::ocd1) << "the default of OCD:Recovery Threshold is 200 mA";
  set_shunt_mv(in, 0.21);  // 210 mA at the default 1 mOhm
  wait_s(3.6);
  EXPECT_EQ(safety_a(), 0U);
}

TEST_F(ChipModel, OvercurrentInDischargeRecoversAtRestWithANegativeThreshold) {
  configure_outputs({{bq::enabled_protections_a, bq::ocd2}, {bq::ocd_recovery_threshold, 0xFE0C}});  // -500 mA
  set_shunt_mv(in, -9);
  wait_s(1);
  in.shunt_v = 0;
  wait_s(2.9);
  EXPECT_EQ(safety_a(), bq::ocd2);
  wait_s(0.7);
  EXPECT_EQ(safety_a(), 0U);
}

TEST_F(ChipModel, OvercurrentInChargeRecoversWhenTheChargerIsGoneOrTheLoadDraws) {
  for (const bool by_pack : {true, false}) {
    configure_outputs({{bq::enabled_protections_a, bq::occ}});
    set_shunt_mv(in, 5);
    wait_s(0.1);
    ASSERT_EQ(safety_a(), bq::occ);
    in.shunt_v = 0;
    wait_s(20);
    EXPECT_EQ(safety_a(), bq::occ);
    if (by_pack)
      in.pack_v = in.stack_v - 2.01;  // PACK-TOS Delta 2 V
    else
      set_shunt_mv(in, -0.21);
    wait_s(3.6);
    EXPECT_EQ(safety_a(), 0U);
    in.pack_v = in.stack_v;
    in.shunt_v = 0;
  }
}

TEST_F(ChipModel, OvercurrentInDischarge3UsesTheMeanCurrentAndSeconds) {
  configure_outputs(
      {{bq::enabled_protections_c, bq::ocd3}, {bq::ocd3_threshold, 0x10000 - 4'000}, {bq::ocd3_delay, 2}});
  set_shunt_mv(in, -3.9);
  wait_s(20);
  EXPECT_EQ(safety_c(), 0U);
  set_shunt_mv(in, -4.1);
  wait_s(1.9);
  EXPECT_EQ(safety_c(), 0U);
  wait_s(0.7);
  EXPECT_EQ(safety_c(), bq::ocd3);
  EXPECT_TRUE(!chip_.ddsg() && chip_.dchg());
}

TEST_F(ChipModel, TemperaturesTripAndRecoverAtTheirSettings) {
  set_thermistor(ThermistorPin::ts1, 25);
  configure_outputs({{bq::enabled_protections_b, bq::otc | bq::otd | bq::utc | bq::utd | bq::otint}});
  const struct {
    double celsius;
    unsigned expected;
  } course[] = {{54, 0}, {55.5, bq::otc},         {60.5, bq::otc | bq::otd}, {54, bq::otc}, {49, 0},
                {1, 0},  {-1, bq::utc | bq::utd}, {4, bq::utc | bq::utd},    {6, 0}};
  for (const auto& [celsius, expected] : course) {
    set_thermistor(ThermistorPin::ts1, celsius);
    wait_s(3.5);  // delay 2 s or recovery 3 s, and a full scan
    EXPECT_EQ(safety_b(), expected) << celsius;
  }
  in.internal_c = 86;
  wait_s(2.5);
  EXPECT_EQ(safety_b(), bq::otint);
  EXPECT_FALSE(chip_.ddsg() || chip_.dchg());
}

TEST_F(ChipModel, TheHostWatchdogTripsAfterItsDelayAndRecoversByCommunication) {
  configure_outputs({{bq::enabled_protections_c, bq::hwdf}, {bq::hwd_delay, 3}});
  wait_us(2'999'900);
  EXPECT_TRUE(chip_.enables_contactors());
  wait_us(200);
  EXPECT_EQ(safety_c(), bq::hwdf);
  EXPECT_FALSE(chip_.ddsg() || chip_.dchg());
  read(0x12, 2);
  EXPECT_EQ(safety_c(), 0U);
  EXPECT_TRUE(chip_.enables_contactors());
}

// ---- latches and permanent failures ----

TEST_F(ChipModel, ShortCircuitsLatchAtTheLimitUntilTheCommand) {
  configure_outputs({{bq::enabled_protections_a, bq::scd},
                     {bq::enabled_protections_c, bq::scdl},
                     {bq::scdl_latch_limit, 3},
                     {bq::scd_recovery_time, 1}});
  for (int k = 0; k < 3; ++k) {
    set_shunt_mv(in, -20);
    wait_us(100);
    in.shunt_v = 0;
    EXPECT_FALSE(chip_.ddsg());
    EXPECT_EQ(safety_c(), k < 2 ? 0U : unsigned{bq::scdl});
    wait_s(1.1);
    EXPECT_EQ(chip_.ddsg(), k < 2);
  }
  wait_s(100);
  EXPECT_FALSE(chip_.ddsg() || chip_.dchg());
  subcommand(0x009C);
  EXPECT_TRUE(chip_.enables_contactors());
}

TEST_F(ChipModel, ALatchCounterDecreasesWithoutFurtherFaults) {
  configure_outputs({{bq::enabled_protections_a, bq::scd},
                     {bq::enabled_protections_c, bq::scdl},
                     {bq::scdl_latch_limit, 2},
                     {bq::scd_recovery_time, 1},
                     {bq::scdl_counter_dec_delay, 10}});
  for (int k = 0; k < 6; ++k) {
    set_shunt_mv(in, -20);
    wait_us(100);
    in.shunt_v = 0;
    EXPECT_EQ(safety_c(), 0U) << k;
    EXPECT_EQ(chip_.protections().alert(bq::Protections::c), bq::scdl);
    wait_s(11.1);
    EXPECT_EQ(chip_.protections().alert(bq::Protections::c), 0U);
  }
}

TEST_F(ChipModel, AShortCircuitLatchRecoversByChargingOnlyIfConfigured) {
  for (const bool by_current : {false, true}) {
    configure_outputs({{bq::enabled_protections_a, bq::scd},
                       {bq::enabled_protections_c, bq::scdl},
                       {bq::scdl_latch_limit, 1},
                       {bq::protection_configuration, by_current ? 0x402U : 2U}});
    set_shunt_mv(in, -20);
    wait_us(100);
    set_shunt_mv(in, 0.3);
    wait_s(30);
    EXPECT_EQ(safety_c(), by_current ? 0U : unsigned{bq::scdl});
    in.shunt_v = 0;
    subcommand(0x009C);
  }
}

TEST_F(ChipModel, OvervoltageLatchesAndRecoversAfterItsOwnTime) {
  configure_outputs(
      {{bq::enabled_protections_a, bq::cov}, {bq::enabled_protections_c, bq::covl}, {bq::covl_latch_limit, 1}});
  set_cell(in, 4.4);
  wait_s(1);
  EXPECT_EQ(safety_c(), bq::covl);
  set_cell(in, 3.3);
  wait_s(14.9);
  EXPECT_EQ(safety_a(), 0U);
  EXPECT_FALSE(chip_.dchg());
  EXPECT_TRUE(chip_.ddsg());
  wait_s(0.2);
  EXPECT_TRUE(chip_.dchg());
}

TEST_F(ChipModel, APermanentFailureTurnsBothOutputsOffUntilAReset) {
  for (const std::uint8_t bit : {bq::pf_suv, bq::pf_sov}) {
    configure_outputs({{bq::enabled_pf_a, bit}, {bq::suv_threshold, 1'500}, {bq::sov_threshold, 4'000}});
    wait_s(1);
    const double sign = bit == bq::pf_suv ? -1 : 1, at_v = bit == bq::pf_suv ? 1.5 : 4.0;
    set_cell(in, at_v - sign * 0.001);
    wait_s(20);
    EXPECT_EQ(read(0x0B), 0U);
    set_cell(in, at_v + sign * 0.001);
    wait_s(4.9);
    EXPECT_EQ(read(0x0A), bit);
    EXPECT_TRUE(chip_.enables_contactors());
    wait_s(0.2);
    EXPECT_EQ(read(0x0B), bit);
    EXPECT_EQ(read(0x12, 2) & 0x1000U, 0x1000U);
    set_cell(in, 3.3);
    wait_s(100);
    EXPECT_FALSE(chip_.ddsg() || chip_.dchg());
    subcommand(0x0012);
    EXPECT_EQ(read(0x0B), 0U);
  }
}

TEST_F(ChipModel, PermanentFailuresNeedPfEn) {
  configure_outputs({{bq::enabled_pf_a, bq::pf_sov}, {bq::mfg_status_init, 0x10}});
  set_cell(in, 5);
  wait_s(20);
  EXPECT_EQ(read(0x0B), 0U);
  subcommand(0x0024);  // PF_ENABLE toggles
  wait_s(5.1);
  EXPECT_EQ(read(0x0B), bq::pf_sov);
}

// ---- outputs ----

TEST_F(ChipModel, TheFetProtectionsDecideWhatAFaultTurnsOff) {
  configure_outputs({{bq::enabled_protections_a, bq::scd}, {bq::chg_fet_protections_a, 0x18}});
  set_shunt_mv(in, -20);
  wait_us(15);
  EXPECT_TRUE(!chip_.ddsg() && chip_.dchg());
}

TEST_F(ChipModel, AnotherMaskThanTheFastOnesActsUpTo250msLater) {
  configure_outputs({{bq::enabled_protections_a, bq::scd}, {bq::dsg_fet_protections_a, 0xA4}});
  wait_us(260'000 - chip_.time_us % 250'000);  // 10 ms after a tick of 250 ms
  set_shunt_mv(in, -20);
  wait_us(100'000);
  EXPECT_EQ(safety_a(), bq::scd);
  EXPECT_TRUE(chip_.ddsg());
  wait_us(150'000);
  EXPECT_FALSE(chip_.ddsg());
}

TEST_F(ChipModel, PolaritySupplyAndDriveOfTheOutputsFollowTheirConfiguration) {
  const struct {
    std::uint32_t config, reg12;
    PinLevel without, with_fault;
  } cases[] = {
      {0xAA, 0x0D, PinLevel::high, PinLevel::low},          {0x2A, 0x0D, PinLevel::low, PinLevel::high},
      {0x8A, 0x00, PinLevel::high, PinLevel::low},          {0xAA, 0x00, PinLevel::floating, PinLevel::low},
      {0x82, 0x0D, PinLevel::floating, PinLevel::low},      {0x92, 0x0D, PinLevel::high, PinLevel::low},
      {0x00, 0x0D, PinLevel::floating, PinLevel::floating}, {0x07, 0x0D, PinLevel::floating, PinLevel::floating}};
  for (const auto& c : cases) {
    restore();
    configure_outputs({{bq::enabled_protections_a, bq::scd}, {bq::ddsg_pin, c.config}, {bq::reg12_config, c.reg12}});
    EXPECT_EQ(chip_.ddsg_level(), c.without) << std::hex << c.config;
    set_shunt_mv(in, -20);
    wait_us(100);
    EXPECT_EQ(chip_.ddsg_level(), c.with_fault) << std::hex << c.config;
  }
}

TEST_F(ChipModel, OutputsFloatInShutdownAndTheSettingsAreLost) {
  configure_outputs();
  subcommand(0x0010);
  EXPECT_TRUE(chip_.in_shutdown());
  for (const PinLevel pin : {chip_.ddsg_level(), chip_.dchg_level(), chip_.alert_level()})
    EXPECT_EQ(pin, PinLevel::floating);
  std::array<std::uint8_t, 2> got{};
  EXPECT_EQ(chip_.transfer(0x08, std::array<std::uint8_t, 1>{0x12}, got), hal::I2cResult::no_acknowledge);
  in.ts2_low = true;
  wait_us(1'000);
  EXPECT_EQ(read(0x12, 2) & 8U, 8U) << "POR";
  EXPECT_EQ(chip_.memory(0x9302, 1), 0U);
}

TEST_F(ChipModel, AHotDieShutsDownAfterItsDelay) {
  configure_outputs({{bq::shutdown_temperature, 110}});
  in.internal_c = 109;
  wait_s(20);
  EXPECT_TRUE(chip_.enables_contactors());
  in.internal_c = 111;
  wait_s(4.8);
  EXPECT_TRUE(chip_.enables_contactors());
  wait_s(0.5);
  EXPECT_FALSE(chip_.enables_contactors());
  EXPECT_TRUE(chip_.in_shutdown() || chip_.in_soft_shutdown());
}

TEST_F(ChipModel, ShutdownWaitsForTs2AndLdWithItsOutputsOff) {
  const std::array<void (*)(Bq76952Inputs&), 2> causes{[](Bq76952Inputs& i) { i.ts2_low = true; },
                                                       [](Bq76952Inputs& i) { i.ld_v = 20; }};
  for (const auto& hold_on : causes) {
    in.ts2_low = false;
    in.ld_v = 0.2;
    configure_outputs();
    hold_on(in);
    wait_us(1'000);
    subcommand(0x0010);
    wait_s(5);
    EXPECT_FALSE(chip_.in_shutdown());
    EXPECT_EQ(chip_.ddsg_level(), PinLevel::low) << "REG1 is on";
    EXPECT_EQ(chip_.dchg_level(), PinLevel::low);
    EXPECT_EQ(read(0x20, 2), 3'300U) << "the bus works";
    in.ts2_low = false;
    in.ld_v = 0.2;
    wait_us(1'000);
    EXPECT_TRUE(chip_.in_shutdown());
    in.ts2_low = true;
    wait_us(1'000);
    EXPECT_FALSE(chip_.in_shutdown() || chip_.in_soft_shutdown());
  }
}

TEST_F(ChipModel, ConfigUpdateStopsMeasurementsAndProtectionsAndAssertsTheOutputs) {
  configure_outputs({{bq::enabled_protections_a, bq::cuv}});
  wait_s(0.1);
  subcommand(0x0090);
  EXPECT_FALSE(chip_.ddsg() || chip_.dchg());
  set_cell(in, 1.0);
  wait_s(5);
  EXPECT_EQ(read(0x20, 2), 3'300U) << "cell 7 as before";
  EXPECT_EQ(safety_a(), 0U);
  subcommand(0x0092);
  wait_s(0.5);
  EXPECT_EQ(safety_a(), bq::cuv);
}

TEST_F(ChipModel, AlertLatchesMaskedEventsUntilTheyAreCleared) {
  configure_outputs({{bq::enabled_protections_a, bq::cov}, {bq::default_alarm_mask, 0x4000}});
  wait_s(1);
  EXPECT_FALSE(chip_.alert());
  set_cell(in, 5);
  wait_s(1);
  EXPECT_TRUE(chip_.alert());
  EXPECT_EQ(read(0x62, 2), 0x4000U) << "SSA; FULLSCAN is not in the mask";
  EXPECT_EQ(read(0x64, 2) & 0x40U, 0x40U) << "XCHG";
  set_cell(in, 3.3);
  wait_s(5);
  EXPECT_EQ(safety_a(), 0U);
  EXPECT_TRUE(chip_.alert()) << "latched";
  write({0x62, 0x00, 0x40});
  EXPECT_FALSE(chip_.alert());
  write({0x66, 0x82, 0x00});  // FULLSCAN and ADSCAN
  wait_s(0.2);
  EXPECT_EQ(read(0x62, 2), 0x0082U);
}

TEST_F(ChipModel, FetStatusAndCommandsDescribeTheFets) {
  configure_outputs({{bq::mfg_status_init, 0x40}});
  EXPECT_EQ(read(0x7F) & 0x3FU, 0U) << "FET_EN is 0";
  EXPECT_TRUE(chip_.enables_contactors()) << "the pins show faults only";
  subcommand(0x0022);
  EXPECT_EQ(block(0x0057, 0, 2), 0x50U);
  EXPECT_EQ(read(0x7F), 0x05U);
  write_block(0x0097, 1, 0x01);  // DSG_OFF
  EXPECT_EQ(read(0x7F), 0x01U);
  subcommand(0x0094);
  EXPECT_EQ(read(0x7F), 0x00U);
  subcommand(0x0096);
  EXPECT_EQ(read(0x7F), 0x05U);
}

class PinsThatFollowTheFets : public ChipWithHost {
 protected:
  PinsThatFollowTheFets() : ChipWithHost({.pins_follow_fet_drivers = true}) {}
};

TEST_F(PinsThatFollowTheFets, AreAssertedWithoutFetEnAndByFetControl) {
  configure_outputs({{bq::mfg_status_init, 0x40}});
  EXPECT_FALSE(chip_.ddsg() || chip_.dchg());
  subcommand(0x0022);
  EXPECT_TRUE(chip_.enables_contactors());
  write_block(0x0097, 1, 0x04);  // CHG_OFF
  EXPECT_TRUE(chip_.ddsg() && !chip_.dchg());
}

}  // namespace
}  // namespace bms
