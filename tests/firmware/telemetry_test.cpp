// Telemetry and commands of the application with one cell, on this machine.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "tests/firmware/application_fixture.hpp"

namespace bms::firmware {
namespace {

TEST_F(TelemetryTest, EverySampleIsPublishedAndRecordedAndFeedsTheWatchdog) {
  sample.current_ua = -12'345'678;
  sample.voltage_uv = 3'301'499;
  sample.temperature_cdegc = -1'234;
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(ids(), (std::vector<unsigned>{0x196, 0x1A2, 0x197, 0x19F, 0x1A3, 0x183, 0x186, 0x187, 0x188, 0x1B8, 0x1B9,
                                          0x19D, 0x19E, 0x199, 0x19A, 0x19B, 0x19C, 0x180, 0x181, 0x189, 0x182}));
  const auto state = can::PackState::of(sent[17]);
  EXPECT_NEAR(state.soc, 54.321, 0.0011);
  EXPECT_NEAR(state.soc_sigma, 1, 0.0011);
  EXPECT_NEAR(state.soc_display, 54.321, 0.0011);
  EXPECT_EQ(state.soc_quality, can::PackState::soc_quality_carried_by_counting);
  const auto electrical = can::PackElectrical::of(sent[18]);
  EXPECT_NEAR(electrical.voltage, 3.301, 1e-5);
  EXPECT_NEAR(electrical.current, -12.34, 1e-4);
  EXPECT_NEAR(electrical.temperature, -12.34, 1e-4);
  const auto detail = can::ModelDetail::of(sent[19]);
  EXPECT_NEAR(detail.voltage_rc, -0.0123456, 1e-6);
  EXPECT_NEAR(detail.voltage_predicted, 3.2999, 1e-6);
  const auto status = can::Status::of(sent[20]);
  EXPECT_EQ(status.flags, estimator::voltage_stuck);
  EXPECT_EQ(status.sample_counter, 1U);
  EXPECT_EQ(status.reset_cause, 4U);
  const auto identity = can::Identity::of(sent[5]);
  EXPECT_EQ(identity.cell_hash, 0xCE110001U);
  EXPECT_EQ(identity.version_major, 1U);
  EXPECT_EQ(identity.version_minor, 2U);
  EXPECT_EQ(identity.version_patch, 3U);
  const auto limits = can::CurrentLimits::of(sent[6]);
  EXPECT_NEAR(limits.discharge_now, 6, 0.11) << "what the cell file allows";
  EXPECT_GE(limits.charge_now, limits.charge_ten_seconds);
  EXPECT_NEAR(can::Health::of(sent[7]).capacity, 100, 0.03);
  EXPECT_NEAR(can::Health::of(sent[7]).resistance_sigma, 30, 0.03);
  EXPECT_EQ(can::SocAnchor::of(sent[8]).observable, 0U);
  EXPECT_EQ(can::Storage::of(sent[9]).state, can::Storage::state_no_flash);
  EXPECT_EQ(recorded.size(), 1U);
  EXPECT_EQ(fed, 1);
}

TEST_F(TelemetryTest, EveryFrameHasACrcAndItsOwnCounter) {
  for (int k = 0; k < 40; ++k) {
    sample.time_us = static_cast<std::uint64_t>(k) * 300'000;
    application.process_sample(estimator::single_cell_pack(sample));
  }
  std::map<unsigned, int> expected;
  for (const can::Frame& f : sent) {
    EXPECT_TRUE(can::intact(f, static_cast<std::uint16_t>(f.id))) << f.id;
    EXPECT_EQ(can::counter_of(f), expected[f.id] % 15) << f.id;
    ++expected[f.id];
    for (std::size_t byte = 0; byte < 8; ++byte) {
      for (int bit = 0; bit < 8; ++bit) {
        can::Frame broken = f;
        broken.data[byte] = static_cast<std::uint8_t>(broken.data[byte] ^ (1 << bit));
        EXPECT_FALSE(can::intact(broken, static_cast<std::uint16_t>(f.id)));
      }
    }
    EXPECT_FALSE(can::intact(f, static_cast<std::uint16_t>(f.id + 1))) << "another message";
  }
  EXPECT_EQ(expected[can::PackState::id], 40);
  EXPECT_EQ(expected[can::Identity::id], 10) << "every second, with the next sample";
}

TEST_F(TelemetryTest, LogHoldsTheEstimatorsInputBitForBit) {
  estimator::EstimateHash expected;
  for (const measurement::Sample& s :
       {measurement::Sample{0, -12'345'678, 3'301'499, -1'234},
        measurement::Sample{1'000'000, measurement::no_reading, measurement::no_reading, measurement::no_temperature},
        measurement::Sample{0x1234'5678'9ABC, 2'147'483'647, -2'147'483'647, 15'000}}) {
    application.process_sample(estimator::single_cell_pack(s));
    const auto current = last<can::SampleCurrent>().value();
    const auto voltage = last<can::SampleVoltage>().value();
    const auto time = last<can::SampleTime>().value();
    EXPECT_EQ(current.current_ua, s.current_ua);
    EXPECT_EQ(voltage.voltage_uv, s.voltage_uv);
    EXPECT_EQ(voltage.temperature_cdegc, s.temperature_cdegc);
    EXPECT_EQ(std::uint64_t{time.time_high} << 32 | time.time_low, s.time_us);
    std::array<std::uint32_t, estimator::estimate_words> said{};
    std::copy(recorded.back().begin(), recorded.back().end(), said.begin());
    expected.add(said);
    EXPECT_EQ(last<can::EstimateHash>().value().hash, expected.value());
    EXPECT_EQ(last<can::EstimateHash>().value().sample_counter, recorded.size());
  }
  const auto all = ids();
  EXPECT_EQ(std::count(all.begin(), all.end(), can::StartingSoc::id), 1) << "once";
  EXPECT_EQ(last<can::StartingSoc>().value().given, can::StartingSoc::given_no);
}

TEST_F(TelemetryTest, LogHoldsTheStartingPoint) {
  Application<Board<1>> started{measurement::StartingPoint{812'345'678, 20'000'001}, {0, 0}, 6, persistence};
  started.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(last<can::StartingSoc>().value().soc_ppb, 812'345'678);
  EXPECT_EQ(last<can::StartingSoc>().value().given, can::StartingSoc::given_yes);
  EXPECT_EQ(last<can::StartingSigma>().value().sigma_ppb, 20'000'001);
}

TEST_F(TelemetryTest, HashDependsOnEveryBitAndOnTheOrder) {
  using Words = std::array<std::uint32_t, 2>;
  const auto of = [](std::initializer_list<Words> all) {
    estimator::EstimateHash h;
    for (const Words& w : all) h.add(w);
    return h.value();
  };
  estimator::EstimateHash text;  // the first four letters of "foobar", a test vector of the draft
  text.add(std::array<std::uint32_t, 1>{0x626F6F66});
  EXPECT_EQ(text.value(), 0x3F5076EFU);
  EXPECT_NE(of({{1, 2}, {3, 4}}), of({{3, 4}, {1, 2}}));
  for (int bit = 0; bit < 32; ++bit) EXPECT_NE(of({{1U << bit, 2}}), of({{0, 2}})) << bit;
}

TEST_F(TelemetryTest, ACommandIsExecutedOnceAndAnswered) {
  send_command(can::Command::code_log_of_samples, 0, 3);
  send_command(can::Command::code_log_of_samples, 1, 3);
  application.process_sample(estimator::single_cell_pack(sample));
  auto all = ids();
  EXPECT_EQ(std::count(all.begin(), all.end(), can::CommandAnswer::id), 1) << "the same counter means a repetition";
  EXPECT_EQ(last<can::CommandAnswer>().value().result, can::CommandAnswer::result_done);
  EXPECT_EQ(last<can::CommandAnswer>().value().command_counter, 3U);
  sent.clear();
  sample.time_us += 100'000;
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_FALSE(last<can::SampleCurrent>()) << "the log is off";
  EXPECT_TRUE(last<can::Status>());
  send_command(can::Command::code_log_of_samples, 1, 4);
  application.process_sample(estimator::single_cell_pack(sample));
  sample.time_us += 100'000;
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_TRUE(last<can::SampleCurrent>());
}

TEST_F(TelemetryTest, InvalidFramesAreIgnoredAndInvalidArgumentsRefused) {
  send_command(can::Command::code_log_of_samples, 0, 1);
  requests.back().data[4] ^= 1;                            // wrong CRC
  send_command(can::Command::code_log_of_samples, 0, 15);  // invalid counter
  requests.push_back({0x123, 8, {}});
  requests.push_back({can::Command::id, 3, {}});
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_FALSE(last<can::CommandAnswer>());
  const struct {
    std::uint32_t code, argument, result;
  } cases[] = {{can::Command::code_log_of_samples, 2, can::CommandAnswer::result_refused},
               {can::Command::code_clear_faults, 7, can::CommandAnswer::result_refused},
               {can::Command::code_request, 3, can::CommandAnswer::result_refused},
               {can::Command::code_set_time, 0, can::CommandAnswer::result_refused},
               {99, 0, can::CommandAnswer::result_no_such_command},
               {can::Command::code_set_time, 1'800'000'000, can::CommandAnswer::result_done}};
  std::uint8_t counter = 0;
  for (const auto& c : cases) {
    send_command(c.code, c.argument, counter++);
    application.process_sample(estimator::single_cell_pack(sample));
    EXPECT_EQ(last<can::CommandAnswer>().value().result, c.result) << c.code;
    EXPECT_EQ(last<can::CommandAnswer>().value().code, c.code);
  }
  EXPECT_TRUE(last<can::SampleCurrent>()) << "the log is still on";
}

TEST_F(TelemetryTest, SetTimeSetsTheCalendarAndIsRefusedIfTheCalendarRefuses) {
  send_command(can::Command::code_set_time, 1'800'000'000, 1);
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(calendar_was_set_to, 1'800'000'000U);
  EXPECT_EQ(last<can::CommandAnswer>()->result, can::CommandAnswer::result_done);
  calendar_accepts = false;
  send_command(can::Command::code_set_time, 1'800'000'001, 2);
  sample.time_us += 100'000;
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(last<can::CommandAnswer>()->result, can::CommandAnswer::result_refused);
}

TEST_F(TelemetryTest, ACorrectionIsStoredAndAppliedAtOnceAndOneOutOfRangeRefused) {
  const auto set = [&](std::uint32_t code, std::int32_t value, std::uint8_t counter) {
    send_command(code, static_cast<std::uint32_t>(value), counter);
    sample.time_us += 100'000;
    application.process_sample(estimator::single_cell_pack(sample));
    return last<can::CommandAnswer>()->result;
  };
  calibrated = {};
  EXPECT_EQ(set(can::Command::code_voltage_gain, -1'234, 1), can::CommandAnswer::result_done);
  EXPECT_EQ(set(can::Command::code_current_offset, 250'000, 2), can::CommandAnswer::result_done);
  EXPECT_EQ(calibrated.voltage_gain_ppm, -1'234);
  EXPECT_EQ(calibrated.current_offset_ua, 250'000);
  EXPECT_EQ(set(can::Command::code_current_gain, 50'001, 3), can::CommandAnswer::result_refused);
  EXPECT_EQ(set(can::Command::code_voltage_offset, -100'001, 4), can::CommandAnswer::result_refused);
  EXPECT_EQ(stored_calibration(persistence).voltage_gain_ppm, -1'234);
  EXPECT_EQ(stored_calibration(persistence).current_gain_ppm, 0);
}

TEST_F(TelemetryTest, ACorrectionThatTheMeasuringChainCannotApplyIsRefusedAndNotStored) {
  calibration_accepts = false;
  send_command(can::Command::code_current_gain, 1'000, 1);
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(last<can::CommandAnswer>()->result, can::CommandAnswer::result_refused);
  EXPECT_EQ(stored_calibration(persistence).current_gain_ppm, 0);
}

TEST_F(TelemetryTest, SelfDiagnosisOfTheBoardIsPublished) {
  host_hal::board_state = {
      .brown_out_reset_low = true, .calendar = hal::CalendarState::runs_roughly, .stack_free = 1'234};
  fault = hal::FaultRecord{.exception = 4};
  application.process_sample(estimator::single_cell_pack(sample));
  auto board = last<can::Board>();
  ASSERT_TRUE(board);
  EXPECT_EQ(
      board->ram_failed | board->image_failed | board->stack_overrun | board->cell_file_changed | board->supply_low,
      0U);
  EXPECT_EQ(board->brown_out_reset_low, 1U);
  EXPECT_EQ(board->clock_failed, 0U);
  EXPECT_EQ(board->calendar, can::Board::calendar_runs_roughly);
  EXPECT_EQ(board->last_exception, 4U);
  EXPECT_EQ(board->stack_free, 1'234);
  sent.clear();
  sample.time_us += 100'000;
  host_hal::board_state.stack_overrun = host_hal::board_state.clock_failed = true;
  application.process_sample(estimator::single_cell_pack(sample));
  board = last<can::Board>();
  ASSERT_TRUE(board) << "at once, not after a second";
  EXPECT_EQ(board->stack_overrun, 1U);
  EXPECT_EQ(board->clock_failed, 1U);
}

TEST_F(TelemetryTest, AtMostFourCommandsAreHandledPerSample) {
  for (std::uint8_t k = 0; k < 14; ++k) send_command(can::Command::code_set_time, 1, k);
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(requests.size(), 10U);
}

TEST_F(TelemetryTest, MissingValuesAreSentAsNotKnownAndLargeOnesAreClamped) {
  sample.current_ua = measurement::no_reading;
  sample.voltage_uv = measurement::no_reading;
  sample.temperature_cdegc = measurement::no_temperature;
  const auto nothing = can::PackElectrical::of(messages::pack_electrical(estimator::single_cell_pack(sample)).frame(0));
  EXPECT_TRUE(std::isnan(nothing.voltage) && std::isnan(nothing.current) && std::isnan(nothing.temperature));
  sample.current_ua = 2'000'000'000;
  sample.voltage_uv = 2'000'000'000;
  const auto much = can::PackElectrical::of(messages::pack_electrical(estimator::single_cell_pack(sample)).frame(0));
  EXPECT_NEAR(much.current, 655.34, 1e-3);
  EXPECT_NEAR(much.voltage, 65.534, 1e-4);
  estimator::Estimate<float> e;
  e.soc = -0.1F;
  e.soc_sigma = 9;
  estimator::Condition<estimator::SocEstimator<float>> condition;
  EXPECT_EQ(can::PackState::of(messages::pack_state(e, condition).frame(0)).soc, 0);
  EXPECT_NEAR(can::PackState::of(messages::pack_state(e, condition).frame(0)).soc_sigma, 125, 1e-3);
  e.soc = std::nanf("");
  EXPECT_TRUE(std::isnan(can::PackState::of(messages::pack_state(e, condition).frame(0)).soc));
  EXPECT_EQ(messages::ppb(e.soc), 0);
  e.flags = estimator::not_started;
  const auto start = can::PackState::of(messages::pack_state(e, condition).frame(0));
  EXPECT_TRUE(std::isnan(start.soc));
  EXPECT_EQ(start.soc_quality, can::PackState::soc_quality_not_started);
}

TEST_F(TelemetryTest, NothingIsSentWithoutAListenerAndTheSampleCounterContinues) {
  listening = false;
  for (int k = 0; k < 5; ++k, sample.time_us += 100'000)
    application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_TRUE(sent.empty());
  EXPECT_EQ(fed, 5);
  listening = true;
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(can::Status::of(sent.back()).sample_counter, 6U);
  EXPECT_EQ(can::counter_of(sent.back()), 0);
}

TEST_F(TelemetryTest, AnOldSampleOrOneThatTheEstimatorSkippedDoesNotFeedTheWatchdog) {
  application.process_sample(estimator::single_cell_pack(sample));
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(fed, 1) << "the same sample again";
  sample.time_us += 100'000;
  estimator_hangs_back = true;
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(fed, 1);
  sample.time_us += 100'000;
  estimator_hangs_back = false;
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(fed, 2);
}

TEST_F(TelemetryTest, IdentityIsSentEverySecondAndAProcessorFaultOnce) {
  fault = hal::FaultRecord{};
  fault->pc = 0x08001234;
  fault->cfsr = 0x8200;
  for (int k = 0; k < 30; ++k) {
    sample.time_us = static_cast<std::uint64_t>(k) * 100'000;
    application.process_sample(estimator::single_cell_pack(sample));
  }
  const auto all = ids();
  EXPECT_EQ(std::count(all.begin(), all.end(), can::Identity::id), 3);
  EXPECT_EQ(std::count(all.begin(), all.end(), can::LastFaultAddress::id), 1);
  EXPECT_EQ(can::LastFaultAddress::of(sent[0]).program_counter, 0x08001234U);
  EXPECT_EQ(can::LastFaultCause::of(sent[1]).configurable_fault_status, 0x8200U);
}

TEST_F(TelemetryTest, ACommandInA29BitFrameIsIgnored) {
  send_command(can::Command::code_log_of_samples, 0, 3);
  requests.back().long_id = true;
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_FALSE(last<can::CommandAnswer>());
}

}  // namespace
}  // namespace bms::firmware
