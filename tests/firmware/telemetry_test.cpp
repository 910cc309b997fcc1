// The firmware's application on this machine.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <vector>

#include "firmware/application.hpp"
#include "firmware/cia418_profile.hpp"
#include "firmware/j1939_profile.hpp"
#include "tests/firmware/host_hal.hpp"

namespace bms::firmware {
namespace {

using namespace host_hal;

bool estimator_hangs_back = false;
std::uint64_t taken_us = 0;

/// A board whose estimator always says the same.
template <std::size_t Cells>
struct Board : Table9Board<Cells> {
  static std::uint64_t estimated_us(const estimator::SocEstimator<float>&) { return taken_us; }
  static bms::estimator::Estimate<float> step(estimator::SocEstimator<float>&, const measurement::Sample& sample) {
    if (!estimator_hangs_back) taken_us = sample.time_us;
    bms::estimator::Estimate<float> e;
    e.soc = 0.54321F;
    e.soc_sigma = 0.01F;
    e.v_rc_v = -0.0123456F;
    e.voltage_predicted_v = 3.2999F;
    e.flags = estimator::voltage_stuck;
    return e;
  }
  static const protection::ProtectionPlan& plan() {
    static const auto plan = protection::protection_plan(Table9Board<Cells>::design(1));
    return plan;
  }
};

class TelemetryTest : public ::testing::Test {
 protected:
  void SetUp() override {
    begin();
    estimator_hangs_back = false;
    dc_link_reading_uv = measurement::no_reading;
    cause = hal::ResetCause::watchdog;
  }
  void ask(std::uint32_t code, std::uint32_t argument, std::uint8_t counter) {
    can::Command command;
    command.code = code;
    command.argument = argument;
    requests.push_back(command.frame(counter));
  }
  std::vector<unsigned> ids() const {
    std::vector<unsigned> all;
    for (const can::Frame& f : sent) all.push_back(f.id);
    return all;
  }
  storage::Persistence persistence;
  Application<Board<1>> application{std::nullopt, {0xCE110001, 0x010203}, 6, persistence};
  measurement::Sample sample{};
};

TEST_F(TelemetryTest, EverySampleIsToldRecordedAndFeedsTheWatchdog) {
  sample.current_ua = -12'345'678;
  sample.voltage_uv = 3'301'499;
  sample.temperature_cdegc = -1'234;
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(ids(), (std::vector<unsigned>{0x196, 0x197, 0x19F, 0x183, 0x186, 0x187, 0x188, 0x1B8, 0x1B9, 0x19D, 0x19E,
                                          0x199, 0x19A, 0x19B, 0x19C, 0x180, 0x181, 0x189, 0x182}));
  const auto state = can::PackState::of(sent[15]);
  EXPECT_NEAR(state.soc, 54.321, 0.0011);
  EXPECT_NEAR(state.soc_sigma, 1, 0.0011);
  EXPECT_NEAR(state.soc_display, 54.321, 0.0011);
  EXPECT_EQ(state.soc_quality, can::PackState::soc_quality_carried_by_counting);
  const auto electrical = can::PackElectrical::of(sent[16]);
  EXPECT_NEAR(electrical.voltage, 3.301, 1e-5);
  EXPECT_NEAR(electrical.current, -12.34, 1e-4);
  EXPECT_NEAR(electrical.temperature, -12.34, 1e-4);
  const auto detail = can::ModelDetail::of(sent[17]);
  EXPECT_NEAR(detail.voltage_rc, -0.0123456, 1e-6);
  EXPECT_NEAR(detail.voltage_predicted, 3.2999, 1e-6);
  const auto status = can::Status::of(sent[18]);
  EXPECT_EQ(status.flags, estimator::voltage_stuck);
  EXPECT_EQ(status.sample_counter, 1U);
  EXPECT_EQ(status.reset_cause, 4U);
  const auto identity = can::Identity::of(sent[3]);
  EXPECT_EQ(identity.cell_hash, 0xCE110001U);
  EXPECT_EQ(identity.version_major, 1U);
  EXPECT_EQ(identity.version_minor, 2U);
  EXPECT_EQ(identity.version_patch, 3U);
  const auto limits = can::CurrentLimits::of(sent[4]);
  EXPECT_NEAR(limits.discharge_now, 6, 0.11) << "what the cell file allows";
  EXPECT_GE(limits.charge_now, limits.charge_ten_seconds);
  EXPECT_NEAR(can::Health::of(sent[5]).capacity, 100, 0.03);
  EXPECT_NEAR(can::Health::of(sent[5]).resistance_sigma, 30, 0.03);
  EXPECT_EQ(can::SocAnchor::of(sent[6]).observable, 0U);
  EXPECT_EQ(can::Storage::of(sent[7]).state, can::Storage::state_no_flash);
  EXPECT_EQ(recorded.size(), 1U);
  EXPECT_EQ(fed, 1);
}

TEST_F(TelemetryTest, EveryFrameIsProtectedAndCounted) {
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
  EXPECT_EQ(expected[can::Identity::id], 10) << "every second, at the next sample";
}

TEST_F(TelemetryTest, TheLogHoldsWhatTheEstimatorSawBitForBit) {
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

TEST_F(TelemetryTest, TheLogSaysWhereTheEstimatorWasToldToBegin) {
  Application<Board<1>> told{measurement::StartingPoint{812'345'678, 20'000'001}, {0, 0}, 6, persistence};
  told.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(last<can::StartingSoc>().value().soc_ppb, 812'345'678);
  EXPECT_EQ(last<can::StartingSoc>().value().given, can::StartingSoc::given_yes);
  EXPECT_EQ(last<can::StartingSigma>().value().sigma_ppb, 20'000'001);
}

TEST_F(TelemetryTest, TheHashTellsEveryBitAndEveryOrder) {
  using Words = std::array<std::uint32_t, 2>;
  const auto of = [](std::initializer_list<Words> all) {
    estimator::EstimateHash h;
    for (const Words& w : all) h.add(w);
    return h.value();
  };
  estimator::EstimateHash text;  // "foobar" of the draft's test vectors begins with "foob"
  text.add(std::array<std::uint32_t, 1>{0x626F6F66});
  EXPECT_EQ(text.value(), 0x3F5076EFU);
  EXPECT_NE(of({{1, 2}, {3, 4}}), of({{3, 4}, {1, 2}}));
  for (int bit = 0; bit < 32; ++bit) EXPECT_NE(of({{1U << bit, 2}}), of({{0, 2}})) << bit;
}

TEST_F(TelemetryTest, ACommandIsHeardOnceAndAnswered) {
  ask(can::Command::code_log_of_samples, 0, 3);
  ask(can::Command::code_log_of_samples, 1, 3);
  application.process_sample(estimator::single_cell_pack(sample));
  auto all = ids();
  EXPECT_EQ(std::count(all.begin(), all.end(), can::CommandAnswer::id), 1)
      << "the same counter again is the same command again";
  EXPECT_EQ(last<can::CommandAnswer>().value().result, can::CommandAnswer::result_done);
  EXPECT_EQ(last<can::CommandAnswer>().value().command_counter, 3U);
  sent.clear();
  sample.time_us += 100'000;
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_FALSE(last<can::SampleCurrent>()) << "the log is off";
  EXPECT_TRUE(last<can::Status>());
  ask(can::Command::code_log_of_samples, 1, 4);
  application.process_sample(estimator::single_cell_pack(sample));
  sample.time_us += 100'000;
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_TRUE(last<can::SampleCurrent>());
}

TEST_F(TelemetryTest, WhatIsNoCommandIsNotHeardAndNonsenseRefused) {
  ask(can::Command::code_log_of_samples, 0, 1);
  requests.back().data[4] ^= 1;                   // CRC wrong
  ask(can::Command::code_log_of_samples, 0, 15);  // no counter
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
    ask(c.code, c.argument, counter++);
    application.process_sample(estimator::single_cell_pack(sample));
    EXPECT_EQ(last<can::CommandAnswer>().value().result, c.result) << c.code;
    EXPECT_EQ(last<can::CommandAnswer>().value().code, c.code);
  }
  EXPECT_TRUE(last<can::SampleCurrent>()) << "the log is on as before";
}

TEST_F(TelemetryTest, TheTimeOfACommandIsTheCalendarsAndOneItDoesNotTakeIsRefused) {
  ask(can::Command::code_set_time, 1'800'000'000, 1);
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(calendar_was_set_to, 1'800'000'000U);
  EXPECT_EQ(last<can::CommandAnswer>()->result, can::CommandAnswer::result_done);
  calendar_takes = false;
  ask(can::Command::code_set_time, 1'800'000'001, 2);
  sample.time_us += 100'000;
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(last<can::CommandAnswer>()->result, can::CommandAnswer::result_refused);
}

TEST_F(TelemetryTest, ACorrectionIsKeptAndUsedAtOnceAndOneThatIsNoneRefused) {
  const auto set = [&](std::uint32_t code, std::int32_t value, std::uint8_t counter) {
    ask(code, static_cast<std::uint32_t>(value), counter);
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

TEST_F(TelemetryTest, WhatTheBoardFindsOutAboutItselfIsTold) {
  host_hal::board_state = {.brown_out_reset_low = true,
                           .clock_failed = true,
                           .calendar = hal::CalendarState::runs_roughly,
                           .stack_free = 1'234};
  fault = hal::FaultRecord{.exception = 4};
  application.process_sample(estimator::single_cell_pack(sample));
  auto told = last<can::Board>();
  ASSERT_TRUE(told);
  EXPECT_EQ(told->ram_failed | told->image_failed | told->stack_overrun | told->cell_file_changed | told->supply_low,
            0U);
  EXPECT_EQ(told->brown_out_reset_low, 1U);
  EXPECT_EQ(told->clock_failed, 1U);
  EXPECT_EQ(told->calendar, can::Board::calendar_runs_roughly);
  EXPECT_EQ(told->last_exception, 4U);
  EXPECT_EQ(told->stack_free, 1'234);
  sent.clear();
  sample.time_us += 100'000;
  host_hal::board_state.stack_overrun = true;
  application.process_sample(estimator::single_cell_pack(sample));
  told = last<can::Board>();
  ASSERT_TRUE(told) << "at once, not within the second";
  EXPECT_EQ(told->stack_overrun, 1U);
}

TEST_F(TelemetryTest, MuchAskingMakesASampleNoLonger) {
  for (std::uint8_t k = 0; k < 14; ++k) ask(can::Command::code_set_time, 1, k);
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(requests.size(), 10U);
}

TEST_F(TelemetryTest, WhatIsNotKnownIsSaidAndWhatDoesNotFitSaturates) {
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

TEST_F(TelemetryTest, NobodyListeningIsToldNothingAndTheCountersSayHowMuchWasMissed) {
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

TEST_F(TelemetryTest, ASampleThatTheEstimatorHasNotTakenOrThatIsNoNewOneDoesNotFeedTheWatchdog) {
  application.process_sample(estimator::single_cell_pack(sample));
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(fed, 1) << "the same again";
  sample.time_us += 100'000;
  estimator_hangs_back = true;
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(fed, 1);
  sample.time_us += 100'000;
  estimator_hangs_back = false;
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_EQ(fed, 2);
}

TEST_F(TelemetryTest, IdentityComesEachSecondAndAFaultOnce) {
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

/// Bytes by hand, from the layouts that can/messages.md names.
TEST_F(TelemetryTest, TheJ1939ProfileTellsTheBatteryInRvcsUnitsBesideItsOwnMessages) {
  Application<Board<16>, J1939Profile> with_profile{std::nullopt, {0, 0}, 6, persistence};
  measurement::PackSample<16> pack{};
  for (auto& uv : pack.cell_uv) uv = 3'300'000;
  pack.pack_uv = 52'800'000;
  pack.current_ua = 5'000'000;
  pack.temperature_cdegc = {2'500, 2'500, 2'500, 2'500};
  const auto of_dgn = [](std::uint32_t dgn) {
    std::vector<std::array<std::uint8_t, 8>> all;
    for (const can::Frame& f : sent) {
      if (f.long_id && f.id == (6U << 26 | dgn << 8 | 0x80U)) all.push_back(f.data);
    }
    return all;
  };
  for (int k = 0; k < 21; ++k) {
    with_profile.process_sample(pack);
    pack.time_us += 100'000;
  }
  ASSERT_EQ(of_dgn(0x1FFFD).size(), 3U) << "every second of two";
  EXPECT_EQ(of_dgn(0x1FEC9).size(), 5U) << "every half second";
  using Bytes = std::array<std::uint8_t, 8>;
  EXPECT_EQ(of_dgn(0x1FFFD)[0], (Bytes{1, 120, 0x20, 0x04, 0x78, 0x80, 0x35, 0x77}))
      << "1056 times 50 mV; 2e9 mA less 5,000: it charges";
  EXPECT_EQ(of_dgn(0x1FFFC)[0], (Bytes{1, 120, 0x40, 0x25, 109, 0xFF, 0xFF, 0xFF}))
      << "9536 is 25 degrees C; 54.32 % in halves";
  EXPECT_EQ(of_dgn(0x1FFFB)[0], (Bytes{1, 120, 200, 3, 0, 0xFF, 0xFF, 0xFF})) << "as new, 3.3 Ah are left";
  EXPECT_EQ(of_dgn(0x1FEC9)[0], (Bytes{1, 120, 1, 0x90, 0x04, 0x00, 0x7D, 0xF3}))
      << "do not charge: all is open; 58.4 V, 0 A, LiFePO4";
  EXPECT_EQ(of_dgn(0x1FEC7)[0], (Bytes{1, 120, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF}));
  EXPECT_EQ(of_dgn(0x1FEA5)[0], (Bytes{1, 120, 0xD0, 6, 0, 0xFF, 0xFF, 0xFF}))
      << "current flows in past open contactors";
  for (const can::Frame& f : sent) EXPECT_EQ(f.long_id, f.id > 0x7FF);
  sent.clear();
  pack.pack_uv = pack.current_ua = measurement::no_reading;
  pack.temperature_cdegc.fill(measurement::no_temperature);
  for (auto& uv : pack.cell_uv) uv = 3'900'000;
  for (int k = 0; k < 20; ++k) {
    with_profile.process_sample(pack);
    pack.time_us += 100'000;
  }
  EXPECT_EQ(of_dgn(0x1FFFD).back(), (Bytes{1, 120, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF})) << "not known";
  EXPECT_EQ(of_dgn(0x1FFFC).back()[2], 0xFF);
  EXPECT_EQ(of_dgn(0x1FEC7).back()[2], 0x05) << "above a limit, and open";
  listening = false;
  sent.clear();
  for (int k = 0; k < 20; ++k) {
    with_profile.process_sample(pack);
    pack.time_us += 100'000;
  }
  EXPECT_TRUE(sent.empty());
}

TEST_F(TelemetryTest, ACommandInAFrameOf29BitsIsNotHeard) {
  ask(can::Command::code_log_of_samples, 0, 3);
  requests.back().long_id = true;
  application.process_sample(estimator::single_cell_pack(sample));
  EXPECT_FALSE(last<can::CommandAnswer>());
}

/// Sixteen cells at rest, contactors and link of a simulated truck.
template <class VehicleProfile>
class PackWith : public TelemetryTest {
 protected:
  Application<Board<16>, VehicleProfile> pack{
      std::nullopt, {0xCE110001, 0}, 6, persistence};  // of the same cell file as the other
  measurement::PackSample<16> reading{};
  double dc_link_v = 0;

  void SetUp() override {
    TelemetryTest::SetUp();
    dc_link_reading_uv = 0;
    cause = hal::ResetCause::power_on;
    for (std::size_t k = 0; k < 16; ++k) reading.cell_uv[k] = 3'280'000 + static_cast<std::int32_t>(k) * 100;
    reading.pack_uv = 16 * 3'280'750;
    reading.current_ua = 0;
    reading.temperature_cdegc = {2'500, 2'510, 2'490, 2'500};
  }
  /// One second; readings live.
  void second() {
    reading.time_us += 1'000'000;
    for (auto& uv : reading.cell_uv) {
      if (uv != measurement::no_reading) uv += (reading.time_us / 1'000'000) % 2 == 0 ? 1 : -1;
    }
    const double pack_v = 1e-6 * reading.pack_uv;
    const auto& c = switched;
    if (c.main_plus && c.main_minus)
      dc_link_v = pack_v;
    else if (c.precharge && c.main_minus)
      dc_link_v += (pack_v - dc_link_v) * (1 - std::exp(-1 / 0.5));
    else
      dc_link_v *= std::exp(-0.2);
    dc_link_reading_uv = static_cast<std::int32_t>(1e6 * dc_link_v);
    pack.process_sample(reading);
  }
  bool driving() const { return switched.main_plus && switched.main_minus; }
};
class PackTest : public PackWith<WithoutVehicleProfile> {};

TEST_F(PackTest, TellsEachCellTheExtremesAndTheTemperatures) {
  reading.cell_uv[4] = 3'291'000;
  reading.cell_uv[9] = 3'201'000;
  reading.cell_uv[15] = measurement::no_reading;
  second();
  EXPECT_NEAR(last<can::CellVoltages2>().value().cell5, 3.291, 1e-3);
  EXPECT_NEAR(last<can::CellVoltages3>().value().cell10, 3.201, 1e-3);
  EXPECT_TRUE(std::isnan(last<can::CellVoltages4>().value().cell16));
  const auto extremes = last<can::CellExtremes>().value();
  EXPECT_EQ(extremes.highest_cell, 5U);
  EXPECT_EQ(extremes.lowest_cell, 10U);
  EXPECT_NEAR(extremes.highest_voltage - extremes.lowest_voltage, 0.09, 2e-3);
  EXPECT_NEAR(last<can::Temperatures>().value().temperature3, 24.9, 0.06);
}

TEST_F(PackTest, ClosesWhenATruckAsksAndOpensWhenItNoLongerDoes) {
  second();
  EXPECT_EQ(last<can::ContactorState>().value().state, can::ContactorState::state_off);
  std::uint8_t counter = 0;
  for (int k = 0; k < 20 && !driving(); ++k) {
    ask(can::Command::code_request, 1, counter = can::next(counter));
    second();
  }
  ASSERT_TRUE(driving());
  EXPECT_EQ(last<can::ContactorState>().value().state, can::ContactorState::state_drive);
  EXPECT_EQ(last<can::Faults>().value().first_cause, 0U);
  for (int k = 0; k < 4; ++k) second();
  EXPECT_TRUE(driving()) << "a request holds for five seconds";
  EXPECT_GT(last<can::AllowedCurrent>().value().discharge, 1);
  for (int k = 0; k < 4; ++k) second();
  EXPECT_FALSE(driving()) << "who does not ask again has gone";
  EXPECT_EQ(last<can::AllowedCurrent>().value().discharge, 0);
}

TEST_F(PackTest, AfterAResetByTheWatchdogNothingClosesBeforeItIsCleared) {
  cause = hal::ResetCause::watchdog;
  std::uint8_t counter = 0;
  for (int k = 0; k < 20; ++k) {
    ask(can::Command::code_request, 1, counter = can::next(counter));
    second();
  }
  EXPECT_FALSE(driving());
  EXPECT_EQ(last<can::Faults>().value().internal_fault, 1U);
}

/// Each of them, and what ended the last run: no request closes anything; what lasts, no command clears.
TEST_F(PackTest, ABoardThatIsUnfitClosesNothing) {
  const auto drive_s = [&](int seconds) {
    std::uint8_t counter = 0;
    for (int k = 0; k < seconds; ++k) {
      ask(can::Command::code_request, 1, counter = can::next(counter));
      second();
    }
  };
  for (const auto what : {&hal::BoardState::ram_failed, &hal::BoardState::image_failed, &hal::BoardState::stack_overrun,
                          &hal::BoardState::supply_low}) {
    host_hal::board_state = {};
    host_hal::board_state.*what = true;
    drive_s(5);
    ask(can::Command::code_clear_faults, 0, 14);
    drive_s(15);
    EXPECT_FALSE(driving());
    EXPECT_EQ(last<can::Faults>()->internal_fault, 1U);
  }
  host_hal::board_state = {};
  ask(can::Command::code_clear_faults, 0, 13);
  for (int k = 0; k < 7; ++k) second();  // the request has to end before it counts again
  drive_s(20);
  EXPECT_TRUE(driving()) << "all is well again, and somebody has seen that it was not";
}

TEST_F(PackTest, AfterAFaultOfTheProcessorNothingClosesBeforeItIsCleared) {
  fault = hal::FaultRecord{.exception = 3};
  std::uint8_t counter = 0;
  for (int k = 0; k < 20; ++k) {
    ask(can::Command::code_request, 1, counter = can::next(counter));
    second();
  }
  EXPECT_FALSE(driving());
  EXPECT_EQ(last<can::Faults>()->internal_fault, 1U);
}

/// What was stored with another cell file means nothing with this one: it is not used, and nothing closes, until
/// somebody says that it is meant.
TEST_F(PackTest, AnotherCellFileIsToldAndTakenOnlyWhenFaultsAreCleared) {
  const auto unit = [&](std::uint32_t hash) {
    return std::make_unique<Application<Board<16>>>(std::nullopt, messages::Identity{hash, 0}, 6.F, persistence);
  };
  EXPECT_FALSE(stored_for_another_cell_file(persistence, 0xCE110001));
  EXPECT_TRUE(stored_for_another_cell_file(persistence, 0xCE110002));
  EXPECT_FALSE(stored_starting_point(persistence, 0xCE110002));
  const auto changed = unit(0xCE110002);
  reading.time_us += 1'000'000;
  changed->process_sample(reading);
  EXPECT_EQ(last<can::Board>()->cell_file_changed, 1U);
  EXPECT_EQ(last<can::Faults>()->internal_fault, 1U);
  EXPECT_TRUE(stored_for_another_cell_file(persistence, 0xCE110002)) << "not yet";
  ask(can::Command::code_clear_faults, 0, 3);
  for (int k = 0; k < 3; ++k) {
    reading.time_us += 1'000'000;
    changed->process_sample(reading);
  }
  EXPECT_EQ(last<can::Board>()->cell_file_changed, 0U);
  EXPECT_EQ(last<can::Faults>()->internal_fault, 0U);
  EXPECT_FALSE(stored_for_another_cell_file(persistence, 0xCE110002));
  EXPECT_TRUE(stored_for_another_cell_file(persistence, 0xCE110001));
}

TEST_F(PackTest, ASevereFaultOpensAndIsToldAtOnceWithItsCause) {
  std::uint8_t counter = 0;
  const auto drive = [&] {
    ask(can::Command::code_request, 1, counter = can::next(counter));
    second();
  };
  for (int k = 0; k < 20 && !driving(); ++k) drive();
  ASSERT_TRUE(driving());
  reading.cell_uv[7] = 4'000'000;
  drive();
  drive();
  EXPECT_FALSE(driving());
  EXPECT_EQ(last<can::Faults>().value().cell_overvoltage_severe, 1U);
  EXPECT_EQ(last<can::Faults>().value().first_cause,
            1U + static_cast<unsigned>(protection::Fault::cell_overvoltage_severe));
  reading.cell_uv[7] = 3'300'000;
  for (int k = 0; k < 20; ++k) drive();
  EXPECT_EQ(last<can::Faults>().value().cell_overvoltage_severe, 1U) << "it is latched";
  ask(can::Command::code_clear_faults, 0, counter = can::next(counter));
  drive();
  drive();
  EXPECT_EQ(last<can::Faults>().value().cell_overvoltage_severe, 0U);
}

/// Beside a charger that is node 10 of a CANopen bus; bytes by hand, from the sources that can/messages.md names.
class ChargerTest : public PackWith<Cia418Profile> {
 protected:
  using Bytes = std::vector<std::uint8_t>;
  std::vector<Bytes> told(unsigned id) const {
    std::vector<Bytes> all;
    for (const can::Frame& f : sent) {
      if (f.id == id) all.emplace_back(f.data.begin(), f.data.begin() + f.length);
    }
    return all;
  }
  void charge_for_s(int seconds) {
    for (int k = 0; k < seconds; ++k) {
      ask(can::Command::code_request, 2, counter_ = can::next(counter_));
      second();
    }
  }
  void manage(std::uint8_t command, std::uint8_t node) { requests.push_back({0x000, 2, {command, node}}); }
  /// What the SDO server answers.
  Bytes asked(std::array<std::uint8_t, 8> request) {
    requests.push_back({0x601, 8, request});
    sent.clear();
    second();
    const auto answers = told(0x581);
    return answers.size() == 1 ? answers[0] : Bytes{};
  }

 private:
  std::uint8_t counter_ = 0;
};

TEST_F(ChargerTest, ReadsStatusVoltageAndTheCurrentItMayGiveInItsOwnReceivePdos) {
  second();
  EXPECT_EQ(told(0x701), (std::vector<Bytes>{{0}})) << "boot-up";
  EXPECT_EQ(told(0x20A), (std::vector<Bytes>{{0xC8, 0x00, 0x00}}))
      << "25 degrees C in eighths; not to be charged, all is open";
  EXPECT_EQ(told(0x30A), (std::vector<Bytes>{{0xC8, 0x00, 0x00, 0xF7, 0xD1, 0x00, 0x00}})) << "52.492 V in 1/1024";
  EXPECT_EQ(told(0x40A), (std::vector<Bytes>{{0x00, 0x00, 54}}));
  charge_for_s(30);
  ASSERT_TRUE(switched.charge_enable);
  sent.clear();
  charge_for_s(1);
  EXPECT_EQ(told(0x701), (std::vector<Bytes>{{5}})) << "operational without a master";
  EXPECT_EQ(told(0x20A).at(0).at(2), 1);
  const auto allowed_a = static_cast<double>(last<can::AllowedCurrent>().value().charge);
  EXPECT_GT(allowed_a, 1);
  EXPECT_NEAR((told(0x40A).at(0)[0] | told(0x40A).at(0)[1] << 8) / 16.0, allowed_a, 1.0 / 16);
  reading.temperature_cdegc.fill(measurement::no_temperature);
  charge_for_s(5);
  EXPECT_EQ(told(0x20A).back(), (Bytes{0xFF, 0x7F, 0x00}));
  EXPECT_EQ(told(0x40A).back(), (Bytes{0, 0, 54})) << "no current where no temperature is known";
}

TEST_F(ChargerTest, NetworkManagementStopsAndStartsThePdosOfThisNodeAlone) {
  second();
  manage(2, 99);
  second();
  sent.clear();
  second();
  EXPECT_EQ(told(0x20A).size(), 1U) << "another node was meant";
  manage(2, 1);
  second();
  sent.clear();
  second();
  EXPECT_TRUE(told(0x20A).empty());
  EXPECT_EQ(told(0x701), (std::vector<Bytes>{{4}}));
  EXPECT_TRUE(asked({0x40, 0x00, 0x10, 0}).empty()) << "stopped";
  manage(128, 0);
  second();
  sent.clear();
  second();
  EXPECT_EQ(told(0x701), (std::vector<Bytes>{{127}}));
  manage(130, 0);
  second();
  sent.clear();
  second();
  EXPECT_EQ(told(0x701), (std::vector<Bytes>{{0}}));
  EXPECT_EQ(told(0x20A).size(), 1U);
}

TEST_F(ChargerTest, TheSdoServerAnswersWhatABatteryModuleIsAndRefusesTheRest) {
  second();
  EXPECT_EQ(asked({0x40, 0x00, 0x10, 0}), (Bytes{0x43, 0x00, 0x10, 0, 0xA2, 0x01, 0, 0})) << "device profile 418";
  EXPECT_EQ(asked({0x40, 0x18, 0x10, 0}), (Bytes{0x4F, 0x18, 0x10, 0, 4, 0, 0, 0}));
  EXPECT_EQ(asked({0x40, 0x20, 0x60, 2}), (Bytes{0x4B, 0x20, 0x60, 2, 6, 0, 0, 0})) << "Ah";
  EXPECT_EQ(asked({0x40, 0x20, 0x60, 4}), (Bytes{0x4B, 0x20, 0x60, 4, 16, 0, 0, 0})) << "cells";
  EXPECT_EQ(asked({0x40, 0x10, 0x60, 0}), (Bytes{0x4B, 0x10, 0x60, 0, 0xC8, 0, 0, 0}));
  EXPECT_EQ(asked({0x40, 0x01, 0x10, 0}), (Bytes{0x4F, 0x01, 0x10, 0, 0, 0, 0, 0})) << "error register";
  EXPECT_EQ(asked({0x40, 0x17, 0x10, 0}), (Bytes{0x4B, 0x17, 0x10, 0, 0xF4, 0x01, 0, 0}))
      << "a heartbeat each half second";
  EXPECT_EQ(asked({0x40, 0x60, 0x60, 0})[0], 0x43) << "voltage";
  EXPECT_EQ(asked({0x40, 0x70, 0x60, 0})[0], 0x4B) << "current requested";
  EXPECT_EQ(asked({0x40, 0x81, 0x60, 0}), (Bytes{0x4F, 0x81, 0x60, 0, 54, 0, 0, 0})) << "state of charge";
  EXPECT_EQ(asked({0x40, 0x20, 0x60, 5}), (Bytes{0x80, 0x20, 0x60, 5, 0x11, 0x00, 0x09, 0x06})) << "no such sub-index";
  EXPECT_EQ(asked({0x40, 0x00, 0x60, 1}), (Bytes{0x80, 0x00, 0x60, 1, 0x11, 0x00, 0x09, 0x06}));
  EXPECT_EQ(asked({0x40, 0x00, 0x50, 0}), (Bytes{0x80, 0x00, 0x50, 0, 0x00, 0x00, 0x02, 0x06})) << "no such object";
  EXPECT_EQ(asked({0x2F, 0x01, 0x60, 0, 7}), (Bytes{0x60, 0x01, 0x60, 0, 0, 0, 0, 0}));
  EXPECT_EQ(asked({0x40, 0x01, 0x60, 0}), (Bytes{0x4F, 0x01, 0x60, 0, 7, 0, 0, 0}));
  EXPECT_EQ(asked({0x2B, 0x01, 0x60, 0, 7}), (Bytes{0x80, 0x01, 0x60, 0, 0x10, 0x00, 0x07, 0x06})) << "two bytes";
  EXPECT_EQ(asked({0x2F, 0x00, 0x60, 0, 1}), (Bytes{0x80, 0x00, 0x60, 0, 0x02, 0x00, 0x01, 0x06})) << "read only";
  EXPECT_EQ(asked({0x60, 0, 0, 0}), (Bytes{0x80, 0, 0, 0, 0x01, 0x00, 0x04, 0x05})) << "a segment";
  EXPECT_TRUE(asked({0x80, 0, 0, 0}).empty()) << "an abort is not answered";
  requests.push_back({0x601, 8, {0x40, 0x00, 0x10, 0}, true});
  sent.clear();
  second();
  EXPECT_TRUE(told(0x581).empty()) << "29 bits";
}

}  // namespace
}  // namespace bms::firmware
