// The back end hal/bq76952/samples.cpp: period, received frames, contactors and balancing.
#include "can/codec.hpp"
#include "hal/samples.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hal/calibration.hpp"
#include "hal/requests.hpp"
#include "hal/sample_frames.hpp"
#include "hal/second_line.hpp"
#include "hal/sleep.hpp"
#include "tests/hal/bq76952_board.hpp"

namespace bms {
namespace {

using ::testing::IsEmpty;

// hal/bq76952/samples.cpp has a single front end for the whole program, so each test continues with its state.
TEST(Bq76952Samples, ComeEvery100msWithOrWithoutTheChipReceiveRequestsAndSwitchContactors) {
  Bq76952Model model{variant_under_test()};
  chip = &model;
  model.cell_v.fill(3.3);
  model.stack_v = 52.8;
  model.ld_v = 40;
  model.gone = true;
  can::Frame command{0x1A0, 8, {0, 0, 2, 3}};
  can::protect(command, 0x1A0, 5);
  arriving = {hal::frame_of(measurement::StartingPoint{500'000'000, 10'000'000}),
              {hal::start_frame_id, 8, {1}, true},
              {0x1A0, 8, {1, 2, 3}},  // with a wrong CRC
              command,
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
    }
  }
  EXPECT_FALSE(hal::starting_point()) << "a board that measures itself takes no state of charge from the bus";
  can::Frame request;
  ASSERT_TRUE(hal::next_request(request));
  EXPECT_EQ(request.id, 0x1A0);
  EXPECT_EQ(request.data, command.data);
  EXPECT_FALSE(hal::next_request(request)) << "a sample frame of another node is not a request";
  hal::PowerPath wanted;
  wanted.main_minus = true;
  wanted.bleed = 0x0100;
  hal::power_path_set(wanted);
  hal::next_sample();
  ASSERT_FALSE(switched.empty());
  EXPECT_TRUE(switched.back().main_minus && !switched.back().main_plus);
  EXPECT_EQ(model.balancing(), 0x0100);

  model.advance(730'000);  // an erase of flash stopped the core
  const std::uint64_t late_us = hal::next_sample()->time_us;
  EXPECT_NEAR(static_cast<double>(hal::next_sample()->time_us - late_us), 100'000, 1'001);
  EXPECT_THAT(model.violations, IsEmpty());
}

/// A new chip behind the back end, measuring.
class Bq76952SecondLine : public ::testing::Test {
 protected:
  Bq76952SecondLine() {
    chip = &model;
    model.cell_v.fill(3.3);
    model.stack_v = 52.8;
    for (int k = 0; k < 50; ++k) sample = hal::next_sample();
  }
  ~Bq76952SecondLine() override { hal::calibrate({}); }

  Bq76952Model model{variant_under_test()};
  const measurement::PackSample<16>* sample = nullptr;
};

TEST_F(Bq76952SecondLine, ACalibrationChangesTheReadings) {
  model.current_a = 100;
  for (int k = 0; k < 1'500; ++k) hal::next_sample();  // more than two time constants of the counted charge
  const std::int32_t before_ua = hal::next_sample()->current_ua;
  EXPECT_NEAR(before_ua, 100e6, 0.1e6);
  EXPECT_TRUE(hal::calibrate({.current_gain_ppm = 60'000}));
  EXPECT_NEAR(hal::next_sample()->current_ua, 106e6, 0.1e6) << "a shunt that is 6 % too small";
  EXPECT_TRUE(hal::calibrate({2'000, -1'000, 0, 250'000}));
  sample = hal::next_sample();
  EXPECT_NEAR(sample->current_ua, 100.25e6, 0.1e6);
  EXPECT_EQ(sample->cell_uv[15], 3'305'600) << "0.2 % more, and -1 mV";
  EXPECT_EQ(sample->pack_uv, 52'889'600) << "0.2 % more, and 16 times -1 mV";
}

TEST_F(Bq76952SecondLine, TripsHealthAndClearAreThoseOfTheChip) {
  EXPECT_EQ(hal::second_line_trips(), 0U);
  EXPECT_EQ(hal::front_end_health().state, hal::FrontEndState::measuring);
  EXPECT_NEAR(hal::front_end_health().die_cdegc, 2'500, 6);
  model.current_a = -700;
  model.advance(1'000);
  model.current_a = 0;
  hal::next_sample();
  EXPECT_EQ(hal::second_line_trips(), hal::short_circuit);
  for (int k = 0; k < 100; ++k) hal::next_sample();
  EXPECT_FALSE(model.ddsg());
  hal::second_line_clear();
  hal::next_sample();
  EXPECT_TRUE(model.ddsg());
  const auto health = hal::front_end_health();
  model.gone = true;
  for (int k = 0; k < 3; ++k) hal::next_sample();
  EXPECT_EQ(hal::front_end_health().state, hal::FrontEndState::absent);
  EXPECT_EQ(hal::front_end_health().die_cdegc, measurement::no_temperature);
  EXPECT_EQ(hal::front_end_health().lost, health.lost + 1);
}

TEST_F(Bq76952SecondLine, AfterASilenceTheOutputsAreOffBeforeTheChipEnablesThemAgain) {
  hal::PowerPath closed;
  closed.main_plus = closed.main_minus = true;
  hal::power_path_set(closed);
  hal::next_sample();
  ASSERT_TRUE(model.ddsg());
  model.gone = true;  // the wires are broken for longer than the chip's host watchdog waits
  for (int k = 0; k < 29; ++k) {
    hal::next_sample();
    hal::power_path_set(closed);  // current flows, so protection grants some time
  }
  model.advance(200'000);
  ASSERT_FALSE(model.ddsg()) << "the chip has opened main plus";
  model.gone = false;
  switched.clear();
  for (int k = 0; k < 30; ++k) {
    hal::next_sample();
    if (!model.ddsg()) continue;
    ASSERT_FALSE(switched.empty()) << "main plus must not close by itself";
    EXPECT_FALSE(switched.back().main_plus || switched.back().main_minus);
    EXPECT_NE(hal::second_line_trips() & hal::host_silence, 0U) << "and protection knows of it";
    return;
  }
  FAIL() << "DDSG does not return";
}

/// The chip has received SHUTDOWN.
class Bq76952SwitchOff : public Bq76952SecondLine {
 protected:
  /// Milliseconds until this core starts again, or a negative value.
  double started_again_after_ms() {
    const std::uint64_t begin_us = model.time_us;
    feeds_us.clear();
    try {
      hal::switch_off();
    } catch (const RunEnded&) {
      return 1e-3 * static_cast<double>(model.time_us - begin_us);
    }
    return -1;
  }
  void low_for_ms(double ms) { model.ts2_low_until_us = model.time_us + static_cast<std::uint64_t>(1e3 * ms); }
};

TEST_F(Bq76952SwitchOff, ATS2ThatIsLowAtTheCommandResetsTheChip) {
  low_for_ms(10'000);
  model.advance(1'000);
  const double ms = started_again_after_ms();
  EXPECT_GT(ms, 200) << "the chip may take its time";
  EXPECT_LT(ms, 800);
  EXPECT_FALSE(model.in_soft_shutdown());
  for (int k = 0; k < 20; ++k) sample = hal::next_sample();
  EXPECT_EQ(sample->cell_uv[3], 3'300'000);
  EXPECT_TRUE(model.ddsg() && model.dchg());
  for (int k = 0; k < 20; ++k) {
    hal::next_sample();
    EXPECT_EQ(hal::second_line_trips(), 0U);
  }
}

TEST_F(Bq76952SwitchOff, ATS2ThatGoesLowAfterTheCommandStartsItAgain) {
  model.ts2_low_from_us = model.time_us + 100'000;
  low_for_ms(10'000);
  EXPECT_LT(started_again_after_ms(), 800);
  EXPECT_FALSE(model.in_shutdown());
}

TEST_F(Bq76952SwitchOff, ASupplyThatDoesNotFallStartsThisCoreAgain) {
  const double ms = started_again_after_ms();
  EXPECT_TRUE(model.in_shutdown());
  EXPECT_GT(ms, 1'000);
  EXPECT_LT(ms, 1'600);
}

/// No public source says that RESET ends the wait in SHUTDOWN. Then it ends with TS2, and the supply with it.
TEST_F(Bq76952SwitchOff, AChipThatCannotBeResetIsWaitedForWithTheWatchdogFed) {
  model.ignores_reset = true;
  low_for_ms(30'000);
  model.advance(1'000);
  const double ms = started_again_after_ms();
  EXPECT_TRUE(model.in_shutdown());
  EXPECT_NEAR(ms, 31'000, 1'000);
  ASSERT_GT(feeds_us.size(), 100U);
  for (std::size_t k = 1; k < feeds_us.size(); ++k) ASSERT_LT(feeds_us[k] - feeds_us[k - 1], 500'000U);
}

}  // namespace
}  // namespace bms
