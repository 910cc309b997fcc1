// The front end's driver on a model of its chip: what it reads is what the cells have, and whatever happens on the wire
// or in the chip, a reading is that of now or none.
#include "hal/bq76952/front_end.hpp"

#include <cmath>
#include <cstdio>
#include <map>
#include <numeric>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hal/bq76952/crc8.hpp"
#include "hal/can.hpp"
#include "hal/clock.hpp"
#include "hal/contactor_pins.hpp"
#include "hal/power_path.hpp"
#include "hal/requests.hpp"
#include "hal/sample_frames.hpp"
#include "hal/samples.hpp"
#include "tests/hal/bq76952_model.hpp"

namespace bms {
namespace {

Bq76952Model* chip = nullptr;
std::vector<can::Frame> arriving;
std::vector<hal::PowerPath> switched;

}  // namespace

namespace hal {
I2cResult i2c_transfer(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in) {
  return chip->transfer(address, out, in);
}
bool i2c_recover() { return chip->recover(); }
void i2c_start() {}
std::uint64_t now_us() { return chip->time_us; }
void wait_for_interrupt() { chip->advance(1'000 - chip->time_us % 1'000); }
bool can_receive(can::Frame& frame) {
  if (arriving.empty()) return false;
  frame = arriving.front();
  arriving.erase(arriving.begin());
  return true;
}
void contactor_pins_set(const PowerPath& wanted) { switched.push_back(wanted); }
}  // namespace hal

namespace {

using hal::bq76952::FrontEnd;
using ::testing::Contains;
using ::testing::Each;
using ::testing::IsEmpty;
using State = FrontEnd::State;
using Fault = Bq76952Model::Fault;

constexpr hal::bq76952::Board board;
constexpr auto settings = hal::bq76952::settings(board);
constexpr unsigned most_transfers = 30;  // of one sample, whatever happens
constexpr std::uint64_t longest_sample_us = 60'000;

// TI's application note SLUAA11B, chapter 4: captures of a bus
static_assert(hal::bq76952::crc8(hal::bq76952::crc8(hal::bq76952::crc8(0, 0x10), 0x3E), 0x22) == 0x63);
static_assert(hal::bq76952::crc8(0, 0x0B) == 0x31 && hal::bq76952::crc8(0, 0x00) == 0x00);
static_assert(hal::bq76952::crc8(hal::bq76952::crc8(hal::bq76952::crc8(hal::bq76952::crc8(0, 0x10), 0x14), 0x11),
                                 0x68) == 0x33);

class Bq76952 : public ::testing::Test {
 protected:
  Bq76952() {
    chip = &model;
    set_cells(3.3, 0.001);
  }
  void TearDown() override {
    EXPECT_THAT(model.violations, IsEmpty());
    std::printf("at most %u transfers and %u us in a sample\n", most_seen_, static_cast<unsigned>(longest_us_));
    EXPECT_LE(most_seen_, most_transfers);
    EXPECT_LE(longest_us_, longest_sample_us);
  }

  void set_cells(double v, double apart_v) {
    for (std::size_t k = 0; k < 16; ++k) model.cell_v[k] = v + apart_v * static_cast<double>(k);
    model.stack_v = std::accumulate(model.cell_v.begin(), model.cell_v.end(), 0.0);
  }
  const measurement::PackSample<16>& next(std::uint64_t after_us = 100'000) {
    const std::uint64_t due = due_us_ += after_us;
    if (model.time_us < due) model.advance(due - model.time_us);
    const unsigned before = model.transfers;
    sample.time_us = model.time_us;
    front_end.read(sample);
    most_seen_ = std::max(most_seen_, model.transfers - before);
    longest_us_ = std::max(longest_us_, model.time_us - sample.time_us);
    return sample;
  }
  bool whole() const {
    return std::none_of(sample.cell_uv.begin(), sample.cell_uv.end(),
                        [](auto uv) { return uv == measurement::no_reading; }) &&
           sample.pack_uv != measurement::no_reading && sample.current_ua != measurement::no_reading &&
           front_end.dc_link_uv() != measurement::no_reading;
  }
  bool empty() const {
    return std::all_of(sample.cell_uv.begin(), sample.cell_uv.end(),
                       [](auto uv) { return uv == measurement::no_reading; }) &&
           sample.pack_uv == measurement::no_reading && sample.current_ua == measurement::no_reading &&
           front_end.dc_link_uv() == measurement::no_reading &&
           std::all_of(sample.temperature_cdegc.begin(), sample.temperature_cdegc.end(),
                       [](auto t) { return t == measurement::no_temperature; });
  }
  int samples_until_whole(int most = 60) {
    for (int k = 1; k <= most; ++k) {
      next();
      if (whole()) return k;
    }
    return most + 1;
  }
  void start() { ASSERT_LE(samples_until_whole(), 20); }

  /// Each field is what is measured, or no reading.
  void expect_true_or_nothing() const {
    const auto near = [](std::int64_t is, std::int64_t nothing, double should_be, double within) {
      return is == nothing || std::abs(static_cast<double>(is) - should_be) <= within;
    };
    for (std::size_t k = 0; k < 16; ++k)
      EXPECT_TRUE(near(sample.cell_uv[k], measurement::no_reading, 1e6 * model.cell_v[k], 501))
          << "cell " << k << ": " << sample.cell_uv[k] << ", " << model.cell_v[k];
    EXPECT_TRUE(near(sample.pack_uv, measurement::no_reading, 1e6 * model.stack_v, 5'001)) << sample.pack_uv;
    EXPECT_TRUE(near(front_end.dc_link_uv(), measurement::no_reading, 1e6 * model.ld_v, 5'001))
        << front_end.dc_link_uv();
    EXPECT_TRUE(near(sample.current_ua, measurement::no_reading, 1e6 * model.current_a, 0.1e6))
        << sample.current_ua << ", " << model.current_a;
    for (std::size_t k = 0; k < 4; ++k)
      EXPECT_TRUE(near(sample.temperature_cdegc[k], measurement::no_temperature, 100 * model.temperature_c[k], 5.1))
          << sample.temperature_cdegc[k];
  }

  /// A chip that was reset takes the CRC of what is under way for data: two addresses that stand for nothing, and a
  /// write into what is read only.
  void forgive_what_a_reset_between_two_transfers_makes() {
    for (const std::string& v : model.violations) {
      EXPECT_THAT((std::vector<std::string>{"an unknown subcommand 49525", "an unknown subcommand 51318",
                                            "a write to 100", "a write to 101"}),
                  Contains(v));
    }
    model.violations.clear();
  }

  Bq76952Model model;
  FrontEnd front_end{settings};
  measurement::PackSample<16> sample;

 private:
  std::uint64_t due_us_ = 0, longest_us_ = 0;
  unsigned most_seen_ = 0;
};

TEST_F(Bq76952, ReadsWhatTheModelsCellsHaveToTheMillivolt) {
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
    ASSERT_TRUE(whole());
    expect_true_or_nothing();
    EXPECT_THAT(sample.temperature_cdegc, Each(::testing::Ne(measurement::no_temperature)));
  }
}

TEST_F(Bq76952, MeasuresWithin1500msOfPowerOn) {
  const int samples = samples_until_whole();
  std::printf("measures with sample %d, %zu settings\n", samples, settings.size());
  EXPECT_LE(samples, 15);
}

TEST_F(Bq76952, AConstantCurrentIsReadToTheStepOfTheCurrentAndItsSignIsThatOfCharging) {
  for (const double a : {0.0, 5.234, -80.017, 299.99, -299.99}) {
    model.current_a = a;
    model.advance(200'000);
    model.reset();  // and so it begins anew
    ASSERT_LE(samples_until_whole(), 40);
    double sum = 0;
    for (int k = 0; k < 600; ++k) {
      sum += next().current_ua * 1e-6;
      ASSERT_NEAR(sample.current_ua * 1e-6, a, 0.005 + 0.0008 * std::abs(a));  // half a step; 50 ms of I over 64 s
    }
    EXPECT_NEAR(sum / 600, a, 0.002 + 0.0008 * std::abs(a));
  }
}

TEST_F(Bq76952, WhatAStepOfTheCurrentCameLateIsMadeUpForOverAMinute) {
  start();
  for (int k = 0; k < 20; ++k) next();
  model.current_a = -200;
  next();
  double lacked_as = 0;
  for (int k = 0; k < 3'000; ++k) {
    const double off_a = next().current_ua * 1e-6 + 200;
    if (k >= 3) {
      ASSERT_NEAR(off_a, 0, 0.005 + 200 * 0.15 / 64);
    }  // CC3 is 100 ms late, the counter 50
    lacked_as += off_a * 0.1;
  }
  EXPECT_NEAR(sample.current_ua * 1e-6, -200, 0.005 + 0.0008 * 200);
  EXPECT_LE(std::abs(lacked_as), 200 * 0.15);
}

TEST_F(Bq76952, WhatTheMeanLosesIsMadeUpForByTheCountedCharge) {
  model.current_a = -100;
  model.cc3_loses = 0.01;
  start();
  for (int k = 0; k < 4'000; ++k) next();
  double sum_a = 0;
  for (int k = 0; k < 100; ++k) sum_a += next().current_ua * 1e-6;
  EXPECT_NEAR(sum_a / 100, -100, 0.01 + 0.0008 * 100);  // 6 time constants: 0.25 % of 1 A is left
}

TEST_F(Bq76952, TheChargeGivenIsTheChargeThatFlowedOverTenMinutesOfDriving) {
  start();
  std::mt19937 random(2);
  std::normal_distribution<double> amperes(-20, 60);
  std::uniform_int_distribution<int> lasts_ms(5, 900);
  const double before_as = model.charge_as;
  double given_as = 0;
  std::uint64_t then_us = sample.time_us;
  std::uint64_t next_us = model.time_us + 100'000;
  for (int k = 0; k < 6'000; ++k, next_us += 100'000) {
    while (model.time_us < next_us) {  // the load changes when it likes, not with the samples
      model.advance(
          std::min<std::uint64_t>(next_us - model.time_us, 1'000ULL * static_cast<std::uint64_t>(lasts_ms(random))));
      model.current_a = std::clamp(amperes(random), -300.0, 300.0);
    }
    sample.time_us = model.time_us;
    front_end.read(sample);
    ASSERT_NE(sample.current_ua, measurement::no_reading);
    given_as += sample.current_ua * 1e-6 * 1e-6 * static_cast<double>(sample.time_us - then_us);
    then_us = sample.time_us;
  }
  // what flows at the end is late by 0.15 s, 9 As; a mean of 6 As is read twice every 20 s and made up for over 64 s, 8
  // As: two sigma of both
  std::printf("charge given %.1f As, flowed %.1f As\n", given_as, model.charge_as - before_as);
  EXPECT_NEAR(given_as, model.charge_as - before_as, 2 * std::hypot(9, 8));
  EXPECT_GT(std::abs(model.charge_as - before_as), 8'000);
  EXPECT_EQ(front_end.charge_restarts(), 0U);
}

TEST_F(Bq76952, ACurrentBeyondWhatTheChipCanSayIsNoReading) {
  start();
  model.current_a = 400;
  model.advance(300'000);
  next(400'000);
  EXPECT_EQ(sample.current_ua, measurement::no_reading);
  EXPECT_NE(sample.cell_uv[0], measurement::no_reading);
}

TEST_F(Bq76952, AnOpenOrShortedTemperatureSensorIsNoTemperature) {
  start();
  model.temperature_c = {-273.15, 25, 3000, 25};
  model.advance(200'000);
  next(300'000);
  EXPECT_EQ(sample.temperature_cdegc[0], measurement::no_temperature);
  EXPECT_NEAR(sample.temperature_cdegc[1], 2500, 5);
  EXPECT_EQ(sample.temperature_cdegc[2], measurement::no_temperature);
}

TEST_F(Bq76952, AnySingleFaultAndAnyPairOfThemAtAnyTransferLeavesTheTruthOrNothing) {
  start();
  double v = 3.0;
  int lost = 0, kept = 0;
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
        expect_true_or_nothing();
        (whole() ? kept : lost) += 1;
        model.fault = {};
        const int back = samples_until_whole();
        slowest[{kind, count}] = std::max(slowest[{kind, count}], back);
        EXPECT_LE(back, kind == Fault::reset ? 12 : 1) << "kind " << kind << ", " << count << " from transfer " << at;
        expect_true_or_nothing();
        if (kind == Fault::reset) forgive_what_a_reset_between_two_transfers_makes();
        if (v > 3.5) v = 2.9;
      }
    }
  }
  for (const auto& [what, samples] : slowest)
    std::printf("fault %d, %d in a row: whole again after %d samples\n", what.first, what.second, samples);
  EXPECT_GT(lost, 40);
  EXPECT_GT(kept, 10);
}

TEST_F(Bq76952, ABitErrorOfOneTransferIsAskedOnceMoreAndCosts0Readings) {
  start();
  for (int at = 0; at < 10; ++at) {
    const auto repeated = front_end.wire().repeated;
    model.fault = {Fault::flipped_bit, at, 1};
    next();
    EXPECT_TRUE(whole()) << at;
    EXPECT_EQ(front_end.wire().repeated, repeated + 1) << at;
    model.fault = {};
  }
}

TEST_F(Bq76952, AChipThatIsGoneGivesNothingIsAskedRarelyAndIsBack1700msAfterItReturns) {
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
  EXPECT_LE(samples_until_whole(), 20);
  EXPECT_EQ(front_end.counters().lost, 1U);
}

TEST_F(Bq76952, AClockStretchedForEverGivesNothingWithinABoundedTimeAndComesBack) {
  start();
  model.hung = true;
  for (int k = 0; k < 50; ++k) {
    next();
    ASSERT_TRUE(empty());
  }
  EXPECT_GE(front_end.wire().timed_out, 1U);
  EXPECT_GE(front_end.wire().stuck, 3U);
  model.hung = false;
  EXPECT_LE(samples_until_whole(), 20);
}

TEST_F(Bq76952, ValuesThatStandStillAreNotGivenAgain) {
  start();
  model.frozen = true;
  model.advance(1'000);
  next();  // what was converted since the last sample may still be given
  for (int k = 0; k < 30; ++k) {
    next();
    ASSERT_TRUE(empty() || sample.temperature_cdegc[0] == measurement::no_temperature);
    ASSERT_TRUE(empty()) << k;
  }
  EXPECT_GE(front_end.counters().not_fresh, 30U);
  model.frozen = false;
  EXPECT_LE(samples_until_whole(), 3);
}

TEST_F(Bq76952, ABufferThatDoesNotFitItsChecksumIsNoCurrent) {
  start();
  model.torn_buffer = true;
  for (int k = 0; k < 20; ++k) {
    next();
    ASSERT_EQ(sample.current_ua, measurement::no_reading);
  }
  EXPECT_GT(front_end.wire().bad_checksum, 3U);
  model.torn_buffer = false;
  EXPECT_LE(samples_until_whole(), 20);
}

TEST_F(Bq76952, StackLinkAndTemperaturesThatStandStillAreGivenForOneSampleMoreAtMost) {
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

TEST_F(Bq76952, AResetOfAChipThatGoesOnTalkingWithCrcIsSeenByItsStatus) {
  start();
  model.crc_from_otp = true;
  model.reset();
  next();
  EXPECT_TRUE(empty());
  EXPECT_EQ(front_end.counters().resets, 1U);
  EXPECT_LE(samples_until_whole(), 12);
  EXPECT_EQ(front_end.counters().configured, 2U);
}

TEST_F(Bq76952, AResetInTheMiddleIsSeenAndTheChipConfiguredAnewWithin1800ms) {
  start();
  model.reset();
  set_cells(3.1, 0.002);
  model.current_a = 12;
  for (int k = 0; k < 3; ++k) {
    next();
    ASSERT_TRUE(empty());
  }
  EXPECT_LE(samples_until_whole(), 15);
  expect_true_or_nothing();
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

TEST_F(Bq76952, ASealedChipIsCountedAndGivesNothing) {
  model.sealed = true;
  for (int k = 0; k < 40; ++k) {
    next();
    ASSERT_TRUE(empty());
  }
  EXPECT_GE(front_end.counters().sealed, 3U);
}

TEST_F(Bq76952, AChipThatSleepsDeeplyIsWoken) {
  model.deep_sleep = true;
  EXPECT_LE(samples_until_whole(), 20);
  EXPECT_FALSE(model.deep_sleep);
}

TEST_F(Bq76952, AChipThatSwapsItsWayOfTalkingOnlyWhenToldIsTold) {
  model.needs_swap = true;
  EXPECT_LE(samples_until_whole(), 20);
  EXPECT_TRUE(model.checked());
}

TEST_F(Bq76952, AMemoryThatDoesNotTakeItsSettingsIsNeverMeasuredWith) {
  model.ignores_writes = true;
  for (int k = 0; k < 100; ++k) {
    next();
    ASSERT_TRUE(empty());
  }
  EXPECT_GE(front_end.counters().wrong_setting, 2U);
}

TEST_F(Bq76952, AfterARestartOfThisCoreAloneAConfiguredChipIsTakenAsItIs) {
  start();
  const auto set_config = std::count(model.commands.begin(), model.commands.end(), 0x0090);
  FrontEnd again{settings};
  measurement::PackSample<16> first;
  int samples = 0;
  for (; samples < 10 && first.current_ua == measurement::no_reading; ++samples) {
    model.advance(100'000);
    first.time_us = model.time_us;
    again.read(first);
  }
  std::printf("after a restart of this core with sample %d\n", samples);
  EXPECT_LE(samples, 5);
  EXPECT_EQ(std::count(model.commands.begin(), model.commands.end(), 0x0090), set_config);

  model.set_memory(0x9278, 1, 86);  // but not one that was set otherwise
  FrontEnd third{settings};
  for (int k = 0; k < 20; ++k) {
    model.advance(100'000);
    first.time_us = model.time_us;
    third.read(first);
  }
  EXPECT_EQ(third.counters().configured, 1U);
  EXPECT_EQ(model.memory(0x9278, 1), 75U);
}

TEST_F(Bq76952, TheSettingsAreWhatTheBoardMeans) {
  start();
  EXPECT_EQ(model.memory(0x91A8, 4), 0x42975E35U);  // 75.684 as IEEE 754
  EXPECT_NEAR(model.memory(0x9278, 1) * 0.0506, 3.8, 0.026);
  EXPECT_NEAR(model.memory(0x9275, 1) * 0.0506, 2.0, 0.026);
  EXPECT_NEAR((model.memory(0x9279, 2) + 2) * 3.3e-3, 1.0, 0.004);
  EXPECT_NEAR((model.memory(0x9287, 1) - 1) * 15.0, 450, 8);
  EXPECT_EQ(model.memory(0x9234, 2) & 0x0100, 0U);  // never SLEEP
  EXPECT_EQ(model.memory(0x9304, 2), 0xFFFFU);
}

TEST_F(Bq76952, BalancingReachesTheVeryCellsIsKeptBeyond20SecondsAndEnds) {
  start();
  std::mt19937 random(3);
  for (int run = 0; run < 40; ++run) {
    const auto cells = run < 16 ? 1U << run : static_cast<std::uint32_t>(random() & 0x5555);
    front_end.bleed(cells);
    next();
    EXPECT_EQ(model.balancing(), cells);
    EXPECT_TRUE(whole());
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

TEST_F(Bq76952, BalancingEndsByItselfWhenThisSideIsGone) {
  start();
  front_end.bleed(0x0010);
  next();
  model.advance(25'000'000);
  EXPECT_EQ(model.balancing(), 0);
  EXPECT_NEAR(model.bled_s[4], 20, 0.5);
}

TEST_F(Bq76952, TheChipsOwnProtectionsOpenTheContactorsWhenACellIsOverOrNobodyTalks) {
  EXPECT_FALSE(model.enables_contactors());
  start();
  EXPECT_TRUE(model.enables_contactors());
  model.advance(2'900'000);
  EXPECT_TRUE(model.enables_contactors());
  model.advance(300'000);
  EXPECT_FALSE(model.enables_contactors());
  next(3'300'000);
  samples_until_whole();
  EXPECT_TRUE(model.enables_contactors());
  const auto trips = front_end.counters().trips;
  model.cell_v[6] = 3.85;
  for (int k = 0; k < 15; ++k) next();
  EXPECT_FALSE(model.enables_contactors());
  EXPECT_GT(front_end.counters().trips, trips);
}

TEST_F(Bq76952, ASampleIs10TransfersOfLessThan9msOnTheWire) {
  start();
  for (int k = 0; k < 5; ++k) next();
  const unsigned transfers = model.transfers, us = model.clocked_us, bytes = model.bytes_sent;
  for (int k = 0; k < 10; ++k) next();
  std::printf("a sample: %u transfers, %u bytes, %u us at 400 kHz\n", (model.transfers - transfers) / 10,
              (model.bytes_sent - bytes) / 10, (model.clocked_us - us) / 10);
  front_end.bleed(1);
  const unsigned quiet = model.transfers, quiet_us = model.clocked_us;
  next();
  std::printf("with balancing told: %u transfers, %u us\n", model.transfers - quiet, model.clocked_us - quiet_us);
  EXPECT_LE(model.transfers - quiet, 16U);
  EXPECT_LE(quiet - transfers, 100U);
  EXPECT_LE(quiet_us - us, 90'000U);
}

// hal/bq76952/samples.cpp has one front end for the whole program: one test walks it through
TEST(Bq76952Samples, ComeEach100msWithOrWithoutTheChipHearRequestsAndSwitchWhatIsWanted) {
  Bq76952Model model;
  chip = &model;
  model.cell_v.fill(3.3);
  model.stack_v = 52.8;
  model.ld_v = 40;
  model.gone = true;
  arriving = {hal::frame_of(measurement::StartingPoint{500'000'000, 10'000'000}),
              {hal::start_frame_id, 8, {1}, true},
              {0x1A0, 8, {1, 2, 3}},
              {hal::reading_frame_id, 8, {}}};
  std::uint64_t last_us = 0;
  for (int k = 0; k < 50; ++k) {
    if (k == 10) model.gone = false;
    const auto* s = hal::next_sample();
    ASSERT_NE(s, nullptr);
    if (k > 0) {
      ASSERT_NEAR(static_cast<double>(s->time_us - last_us), 100'000, 1'001);
    }
    last_us = s->time_us;
    if (k < 10) {
      ASSERT_EQ(s->cell_uv[3], measurement::no_reading);
    }
    if (k == 49) {
      EXPECT_EQ(s->cell_uv[3], 3'300'000);
      EXPECT_EQ(hal::dc_link_uv(), 40'000'000);
    }
  }
  ASSERT_TRUE(hal::starting_point().has_value());
  EXPECT_EQ(hal::starting_point()->soc_ppb, 500'000'000);
  can::Frame request;
  ASSERT_TRUE(hal::next_request(request));
  EXPECT_TRUE(request.long_id) << "of 29 bits: another frame than the starting point";
  ASSERT_TRUE(hal::next_request(request));
  EXPECT_EQ(request.id, 0x1A0);
  EXPECT_FALSE(hal::next_request(request)) << "a sample from another node is no request";
  hal::PowerPath wanted;
  wanted.main_minus = true;
  wanted.bleed = 0x0100;
  hal::power_path_set(wanted);
  hal::next_sample();
  ASSERT_FALSE(switched.empty());
  EXPECT_TRUE(switched.back().main_minus && !switched.back().main_plus);
  EXPECT_EQ(model.balancing(), 0x0100);

  model.advance(730'000);  // the core was held up by an erase of flash
  const std::uint64_t late_us = hal::next_sample()->time_us;
  EXPECT_NEAR(static_cast<double>(hal::next_sample()->time_us - late_us), 100'000, 1'001);
  EXPECT_THAT(model.violations, IsEmpty());
}

}  // namespace
}  // namespace bms
