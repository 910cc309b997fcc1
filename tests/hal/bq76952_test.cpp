// The front end's driver on a model of its chip: it reads the values of the cells, and whatever happens on the wires or
// in the chip, a reading is current or missing.
#include "hal/bq76952/front_end.hpp"

#include <map>
#include <random>

#include "hal/bq76952/crc8.hpp"
#include "tests/hal/bq76952_bench.hpp"

namespace bms {
namespace {

using hal::bq76952::FrontEnd;
using ::testing::Contains;
using ::testing::Each;
using Fault = Bq76952Model::Fault;

constexpr auto settings = hal::bq76952::settings(board_under_test);

// TI's application note SLUAA11B, chapter 4: bus captures
static_assert(hal::bq76952::crc8(hal::bq76952::crc8(hal::bq76952::crc8(0, 0x10), 0x3E), 0x22) == 0x63);
static_assert(hal::bq76952::crc8(0, 0x0B) == 0x31 && hal::bq76952::crc8(0, 0x00) == 0x00);
static_assert(hal::bq76952::crc8(hal::bq76952::crc8(hal::bq76952::crc8(hal::bq76952::crc8(0, 0x10), 0x14), 0x11),
                                 0x68) == 0x33);

TEST_F(Bq76952, ReadsEveryQuantityOfTheModelToItsResolution) {
  start();
  std::mt19937 random(1);
  std::uniform_real_distribution<double> volts(2.0, 3.8);
  for (int run = 0; run < 50; ++run) {
    for (double& v : model.cell_v) v = volts(random);
    model.stack_v = std::accumulate(model.cell_v.begin(), model.cell_v.end(), 0.0);
    model.ld_v = volts(random) * 16;
    model.temperature_c = {volts(random) * 10, -volts(random) * 10, volts(random) * 20, 0};
    model.advance(250'000);
    next(400'000);
    ASSERT_TRUE(complete());
    expect_correct_or_no_reading();
    EXPECT_THAT(sample.temperature_cdegc, Each(::testing::Ne(measurement::no_temperature)));
  }
}

TEST_F(Bq76952, MeasuresWithin1500msOfPowerOn) {
  const int samples = samples_until_complete();
  std::printf("measures with sample %d, %zu settings\n", samples, settings.size());
  EXPECT_LE(samples, 15);
}

TEST_F(Bq76952, AConstantCurrentIsAccurateToOneStepAndPositiveWhileCharging) {
  for (const double a : {0.0, 5.234, -80.017, 299.99, -299.99}) {
    model.current_a = a;
    model.advance(200'000);
    model.reset();  // restarts the comparison with the counted charge
    ASSERT_LE(samples_until_complete(), 40);
    double sum = 0;
    for (int k = 0; k < 600; ++k) {
      sum += next().current_ua * 1e-6;
      ASSERT_NEAR(sample.current_ua * 1e-6, a, 0.005 + 0.0008 * std::abs(a));  // half a step; I x 50 ms / 64 s
    }
    EXPECT_NEAR(sum / 600, a, 0.002 + 0.0008 * std::abs(a));
  }
}

TEST_F(Bq76952, TheDelayOfACurrentStepIsMadeUpForOverAMinute) {
  start();
  for (int k = 0; k < 20; ++k) next();
  model.current_a = -200;
  next();
  double deficit_as = 0;
  for (int k = 0; k < 3'000; ++k) {
    const double off_a = next().current_ua * 1e-6 + 200;
    if (k >= 3) {
      ASSERT_NEAR(off_a, 0, 0.005 + 200 * 0.15 / 64);
    }  // CC3 is 100 ms late, the counter 50
    deficit_as += off_a * 0.1;
  }
  EXPECT_NEAR(sample.current_ua * 1e-6, -200, 0.005 + 0.0008 * 200);
  EXPECT_LE(std::abs(deficit_as), 200 * 0.15);
}

TEST_F(Bq76952, CurrentMissingInTheMeanIsMadeUpForByTheCountedCharge) {
  model.current_a = -100;
  model.cc3_loses = 0.01;
  start();
  for (int k = 0; k < 4'000; ++k) next();
  double sum_a = 0;
  for (int k = 0; k < 100; ++k) sum_a += next().current_ua * 1e-6;
  EXPECT_NEAR(sum_a / 100, -100, 0.01 + 0.0008 * 100);  // after 6 time constants 0.25 % of 1 A remains
}

TEST_F(Bq76952, ThePublishedChargeEqualsTheTrueChargeOverTenMinutesOfDriving) {
  start();
  std::mt19937 random(2);
  std::normal_distribution<double> amperes(-20, 60);
  std::uniform_int_distribution<int> lasts_ms(5, 900);
  const double before_as = model.charge_as;
  double published_as = 0;
  std::uint64_t then_us = sample.time_us;
  std::uint64_t next_us = model.time_us + 100'000;
  for (int k = 0; k < 6'000; ++k, next_us += 100'000) {
    while (model.time_us < next_us) {  // the load changes independently of the samples
      model.advance(
          std::min<std::uint64_t>(next_us - model.time_us, 1'000ULL * static_cast<std::uint64_t>(lasts_ms(random))));
      model.current_a = std::clamp(amperes(random), -300.0, 300.0);
    }
    sample.time_us = model.time_us;
    front_end.read(sample);
    ASSERT_NE(sample.current_ua, measurement::no_reading);
    published_as += sample.current_ua * 1e-6 * 1e-6 * static_cast<double>(sample.time_us - then_us);
    then_us = sample.time_us;
  }
  // Tolerance: two sigma of two errors. The last 0.15 s are delayed, 9 As; every 20 s a mean of 6 As is read twice and
  // made up for over 64 s, 8 As.
  std::printf("published charge %.1f As, true charge %.1f As\n", published_as, model.charge_as - before_as);
  EXPECT_NEAR(published_as, model.charge_as - before_as, 2 * std::hypot(9, 8));
  EXPECT_GT(std::abs(model.charge_as - before_as), 8'000);
  EXPECT_EQ(front_end.charge_restarts(), 0U);
}

TEST_F(Bq76952, AnOpenTemperatureSensorGivesNoTemperatureAndAShortedOneItsOwnReading) {
  start();
  model.temperature_c = {-273.15, 25, 3000, 25};
  model.advance(200'000);
  next(300'000);
  EXPECT_EQ(sample.temperature_cdegc[0], measurement::no_temperature);
  EXPECT_NEAR(sample.temperature_cdegc[1], 2500, 5);
  EXPECT_EQ(sample.temperature_cdegc[2], measurement::shorted_thermistor);
}

TEST_F(Bq76952, TheTemperatureOfTheDieIsReadWithTheOthersAndMissingOutsideOfItsRange) {
  start();
  const unsigned before = model.transfers;
  next();
  const unsigned of_a_sample = model.transfers - before;
  for (const double celsius : {-40.0, -0.3, 25.0, 84.9, 95.1, 109.0}) {
    model.die_c = celsius;
    model.advance(200'000);
    next(300'000);
    EXPECT_NEAR(front_end.die_cdegc(), 100 * celsius, 6) << celsius;
  }
  for (const double celsius : {-273.15, -61.0, 151.0}) {
    model.die_c = celsius;
    model.advance(200'000);
    next(300'000);
    EXPECT_EQ(front_end.die_cdegc(), measurement::no_temperature) << celsius;
  }
  model.die_c = 25;
  for (int k = 0; k < 5; ++k) next();
  const unsigned then = model.transfers;
  next();
  EXPECT_EQ(model.transfers - then, of_a_sample) << "no transfer of its own";
  model.only_cells = true;
  for (int k = 0; k < 4; ++k) next();
  EXPECT_EQ(front_end.die_cdegc(), measurement::no_temperature) << "an old value";
}

TEST_F(Bq76952, UpToThreeFaultsInARowAtAnyTransferLeaveCorrectReadingsOrNone) {
  start();
  double v = 3.0;
  int lost = 0, unaffected = 0;
  std::map<std::pair<int, int>, int> slowest;  // by kind and count
  for (const auto kind : {Fault::no_acknowledge, Fault::flipped_bit, Fault::timed_out, Fault::reset}) {
    for (int count = 1; count <= 3; ++count) {
      for (int at = 0; at < 11; ++at) {
        set_cells(v += 0.002, 0.0015);
        model.current_a = (model.current_a > 0 ? -8 : 8) + at % 5 * 0.1;
        model.ld_v = 20 + 5 * v;
        model.temperature_c.fill(8 * v);
        model.advance(250'000);
        model.fault = {kind, at, count};
        next(350'000);
        expect_correct_or_no_reading();
        (complete() ? unaffected : lost) += 1;
        model.fault = {};
        const int back = samples_until_complete();
        slowest[{kind, count}] = std::max(slowest[{kind, count}], back);
        EXPECT_LE(back, kind == Fault::reset ? 12 : 1) << "kind " << kind << ", " << count << " from transfer " << at;
        expect_correct_or_no_reading();
        if (kind == Fault::reset) accept_violations_of_a_reset_between_transfers();
        if (v > 3.5) v = 2.9;
      }
    }
  }
  for (const auto& [what, samples] : slowest)
    std::printf("fault %d, %d in a row: complete again after %d samples\n", what.first, what.second, samples);
  EXPECT_GT(lost, 40);
  EXPECT_GT(unaffected, 10);
}

TEST_F(Bq76952, ABitErrorInOneTransferIsRepeatedAndLosesNoReading) {
  start();
  for (int at = 0; at < 10; ++at) {
    const auto repeated = front_end.wire().repeated;
    model.fault = {Fault::flipped_bit, at, 1};
    next();
    EXPECT_TRUE(complete()) << at;
    EXPECT_EQ(front_end.wire().repeated, repeated + 1) << at;
    model.fault = {};
  }
}

TEST_F(Bq76952, AMissingChipGivesNoReadingsIsTriedRarelyAndMeasuresWithin2sOfItsReturn) {
  start();
  model.gone = true;
  for (int k = 0; k < 100; ++k) {
    next();
    ASSERT_TRUE(empty());
  }
  const unsigned before = model.transfers;
  for (int k = 0; k < 100; ++k) next();
  EXPECT_LE(model.transfers - before, 20U);
  model.gone = false;
  EXPECT_LE(samples_until_complete(), 20);
  EXPECT_EQ(front_end.counters().lost, 1U);
}

TEST_F(Bq76952, AnEndlesslyStretchedClockGivesNoReadingsInBoundedTimeAndRecovers) {
  start();
  model.hung = true;
  for (int k = 0; k < 50; ++k) {
    next();
    ASSERT_TRUE(empty());
  }
  EXPECT_GE(front_end.wire().timed_out, 1U);
  EXPECT_GE(front_end.wire().stuck, 3U);
  model.hung = false;
  EXPECT_LE(samples_until_complete(), 20);
}

TEST_F(Bq76952, OldValuesAreNotPublishedAgain) {
  start();
  model.frozen = true;
  model.advance(1'000);
  next();  // conversions since the last sample may still be published
  for (int k = 0; k < 30; ++k) {
    next();
    ASSERT_TRUE(empty() || sample.temperature_cdegc[0] == measurement::no_temperature);
    ASSERT_TRUE(empty()) << k;
  }
  EXPECT_GE(front_end.counters().not_fresh, 30U);
  model.frozen = false;
  EXPECT_LE(samples_until_complete(), 3);
}

TEST_F(Bq76952, ABufferWithAWrongChecksumGivesNoCurrent) {
  start();
  model.current_a = -20;
  model.advance(300'000);
  next(400'000);
  model.torn_buffer = true;
  for (int k = 0; k < 20; ++k) {
    next();
    // Where the checksum has never been right, the CRCs and a second read are the check of the same bytes.
    if (variant.dastatus_checksum_right) {
      ASSERT_EQ(sample.current_ua, measurement::no_reading);
    }
    expect_correct_or_no_reading();
  }
  EXPECT_EQ(front_end.wire().bad_checksum > 3, variant.dastatus_checksum_right);
  model.torn_buffer = false;
  EXPECT_LE(samples_until_complete(), 20);
}

TEST_F(Bq76952, StackDcLinkAndTemperaturesArePublishedForAtMostOneSampleAfterTheirScanStops) {
  start();
  model.only_cells = true;
  next();
  for (int k = 0; k < 20; ++k) {
    next();
    if (k == 0) continue;
    ASSERT_NE(sample.cell_uv[0], measurement::no_reading);
    ASSERT_TRUE(sample.pack_uv == measurement::no_reading && front_end.dc_link_uv() == measurement::no_reading &&
                sample.temperature_cdegc[0] == measurement::no_temperature)
        << k;
  }
}

TEST_F(Bq76952, AResetOfAChipThatKeepsItsCrcIsDetectedByItsStatus) {
  start();
  model.crc_from_otp = true;
  model.reset();
  next();
  EXPECT_TRUE(empty());
  EXPECT_EQ(front_end.counters().resets, 1U);
  EXPECT_LE(samples_until_complete(), 12);
  EXPECT_EQ(front_end.counters().configured, 2U);
}

TEST_F(Bq76952, AResetWhileMeasuringIsDetectedAndTheChipIsConfiguredAgainWithin1800ms) {
  start();
  model.reset();
  set_cells(3.1, 0.002);
  model.current_a = 12;
  for (int k = 0; k < 3; ++k) {
    next();
    ASSERT_TRUE(empty());
  }
  EXPECT_LE(samples_until_complete(), 15);
  expect_correct_or_no_reading();
  EXPECT_EQ(front_end.counters().configured, 2U);
  for (const auto& s : settings) EXPECT_EQ(model.memory(s.address, s.bytes), s.value) << std::hex << s.address;
}

TEST_F(Bq76952, AnotherDeviceIsNeverConfiguredNorRead) {
  model.device_number = 0x7694;
  for (int k = 0; k < 60; ++k) {
    next();
    ASSERT_TRUE(empty());
  }
  EXPECT_GE(front_end.counters().wrong_device, 3U);
  EXPECT_THAT(model.commands, ::testing::Not(Contains(0x0090)));
}

TEST_F(Bq76952, ASealedChipIsCountedAndGivesNoReadings) {
  model.sealed = true;
  for (int k = 0; k < 40; ++k) {
    next();
    ASSERT_TRUE(empty());
  }
  EXPECT_GE(front_end.counters().sealed, 3U);
}

TEST_F(Bq76952, AChipInDeepSleepIsWoken) {
  model.deep_sleep = true;
  EXPECT_LE(samples_until_complete(), 20);
  EXPECT_FALSE(model.deep_sleep);
}

TEST_F(Bq76952, AChipThatEnablesItsCrcOnlyOnCommandGetsTheCommand) {
  model.needs_swap = true;
  EXPECT_LE(samples_until_complete(), 20);
  EXPECT_TRUE(model.checked());
}

TEST_F(Bq76952, AChipWhoseMemoryIgnoresTheSettingsIsNeverMeasuredWith) {
  model.ignores_writes = true;
  for (int k = 0; k < 100; ++k) {
    next();
    ASSERT_TRUE(empty());
  }
  EXPECT_GE(front_end.counters().wrong_setting, 2U);
}

TEST_F(Bq76952, AfterARestartOfOnlyThisCoreAConfiguredChipIsNotConfiguredAgain) {
  start();
  const auto set_config = std::count(model.commands.begin(), model.commands.end(), 0x0090);
  FrontEnd again{configuration};
  EXPECT_EQ(again.die_cdegc(), measurement::no_temperature) << "before the first sample";
  measurement::PackSample<16> first;
  int samples = 0;
  for (; samples < 10 && first.current_ua == measurement::no_reading; ++samples) {
    model.advance(100'000);
    first.time_us = model.time_us;
    again.read(first);
  }
  std::printf("after a restart of this core: complete with sample %d\n", samples);
  EXPECT_LE(samples, 5);
  EXPECT_EQ(std::count(model.commands.begin(), model.commands.end(), 0x0090), set_config);

  model.set_memory(0x9278, 1, 86);  // a chip with another setting is configured again
  FrontEnd third{configuration};
  for (int k = 0; k < 20; ++k) {
    model.advance(100'000);
    first.time_us = model.time_us;
    third.read(first);
  }
  EXPECT_EQ(third.counters().configured, 1U);
  EXPECT_EQ(model.memory(0x9278, 1), 76U);
}

TEST_F(Bq76952, TheSettingsMatchTheBoard) {
  start();
  EXPECT_EQ(model.memory(0x91A8, 4), 0x42975E35U);  // 75.684 as IEEE 754
  EXPECT_EQ(model.memory(0x9278, 1), 76U) << "3.8 V in steps of 50.6 mV, rounded up: 3.846 V";
  EXPECT_EQ(model.memory(0x9275, 1), 39U) << "2.0 V, rounded down: 1.973 V";
  EXPECT_NEAR((model.memory(0x9279, 2) + 2) * 3.3e-3, 1.0, 0.004);
  EXPECT_NEAR((model.memory(0x9287, 1) - 1) * 15.0, 450, 8);
  EXPECT_EQ(model.memory(0x9234, 2) & 0x0100, 0U);  // never SLEEP
  EXPECT_EQ(model.memory(0x9304, 2), 0xFFFFU);
}

TEST_F(Bq76952, BalancingReachesTheRequestedCellsLastsBeyond20SecondsAndEnds) {
  start();
  std::mt19937 random(3);
  for (int run = 0; run < 40; ++run) {
    const auto cells = run < 16 ? 1U << run : static_cast<std::uint32_t>(random() & 0x5555);
    front_end.bleed(cells);
    next();
    EXPECT_EQ(model.balancing(), cells);
    EXPECT_TRUE(complete());
  }
  front_end.bleed(0x8001);
  for (int k = 0; k < 450; ++k) {
    next();
    ASSERT_EQ(model.balancing(), 0x8001);
  }
  front_end.bleed(0);
  next();
  EXPECT_EQ(model.balancing(), 0);
}

TEST_F(Bq76952, BalancingEndsByItselfWhenTheHostIsSilent) {
  start();
  front_end.bleed(0x0010);
  next();
  model.advance(25'000'000);
  if (variant.balancing_lasts_s > 20) return;  // only the next test's command ends it: README.md
  EXPECT_EQ(model.balancing(), 0);
  EXPECT_NEAR(model.bled_s[4], 20, 0.5);
}

TEST_F(Bq76952, BalancingEndsAtTheFirstContactOfARestartedCore) {
  start();
  front_end.bleed(0x0010);
  next();
  ASSERT_EQ(model.balancing(), 0x0010);
  FrontEnd again{configuration};
  measurement::PackSample<16> first;
  for (int k = 0; k < 2; ++k) {
    model.advance(100'000);
    first.time_us = model.time_us;
    again.read(first);
  }
  EXPECT_EQ(model.balancing(), 0) << "before the chip is configured or measures";
}

TEST_F(Bq76952, TheChipsOwnProtectionsOpenTheContactorsAtOvervoltageOrWhenTheHostIsSilent) {
  EXPECT_FALSE(model.enables_contactors());
  start();
  EXPECT_TRUE(model.enables_contactors());
  model.advance(2'900'000);
  EXPECT_TRUE(model.enables_contactors());
  model.advance(300'000);
  EXPECT_FALSE(model.enables_contactors());
  next(3'300'000);
  samples_until_complete();
  EXPECT_TRUE(model.enables_contactors());
  const auto trips = front_end.counters().trips;
  model.cell_v[6] = 3.85;
  for (int k = 0; k < 15; ++k) next();
  EXPECT_FALSE(model.enables_contactors());
  EXPECT_GT(front_end.counters().trips, trips);
}

TEST_F(Bq76952, ASampleIs11TransfersOfLessThan9msOnTheWire) {
  start();
  for (int k = 0; k < 5; ++k) next();
  const unsigned transfers = model.transfers, us = model.clocked_us, bytes = model.bytes_sent;
  for (int k = 0; k < 10; ++k) next();
  std::printf("a sample: %u transfers, %u bytes, %u us at 400 kHz\n", (model.transfers - transfers) / 10,
              (model.bytes_sent - bytes) / 10, (model.clocked_us - us) / 10);
  front_end.bleed(1);
  const unsigned quiet = model.transfers, quiet_us = model.clocked_us;
  next();
  std::printf("with balancing sent: %u transfers, %u us\n", model.transfers - quiet, model.clocked_us - quiet_us);
  // Alarm and temperatures are 11 words, the voltages 19, the status of the protections 3. A block DATASTATUS is read
  // twice, 36 bytes with their CRCs, if its checksum is unknown.
  const unsigned more = (variant.transfer_spans_commands ? 0 : 10 + 18 + 2) + (variant.dastatus_checksum_right ? 0 : 2);
  const unsigned more_us =
      (variant.transfer_spans_commands ? 0 : 30 * 100) + (variant.dastatus_checksum_right ? 0 : 3'500);
  EXPECT_LE(model.transfers - quiet, 16U + more);
  EXPECT_LE(quiet - transfers, 10 * (11U + more));
  EXPECT_LE(quiet_us - us, 10 * (9'000U + more_us));
}

}  // namespace
}  // namespace bms
