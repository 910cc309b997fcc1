// The image of the forklift board in Unicorn with real-time clock and supply detector: a command sets the clock, the
// length of a rest is known, a clock that lost its battery reports it; a falling supply opens the contactors at once
// and leaves a record.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "can_messages.hpp"
#include "files/cell_file.hpp"
#include "hal/sample_frames.hpp"
#include "images/firmware_image.hpp"
#include "tests/firmware/unicorn_board.hpp"

namespace bms::firmware {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr std::uint32_t power_on = 0x0E000000, by_pin = 0x04000000;
constexpr std::uint32_t new_years_eve_2031 = 1'956'527'998;  // 23:59:58 UTC

const std::filesystem::path& image() {
  static const auto path =
      images::firmware_image("stm32f405_forklift", files::read_cell("table9"), images::Image::remote);
  return path;
}

template <class Message>
std::optional<Message> last(const UnicornBoard& board) {
  std::optional<Message> found;
  for (const SeenFrame& s : board.can.seen) {
    if (s.from_board && s.frame.id == Message::id) found = Message::of(s.frame);
  }
  return found;
}

/// One run of the board. Clock and flash outlive it.
class BoardRun {
 public:
  explicit BoardRun(RtcModel& rtc, std::vector<std::uint8_t>& flash, std::uint32_t flags)
      : board(image()), rtc_(rtc), flash_(flash) {
    board.rtc = &rtc;
    board.flash.bytes = flash;
    board.reset_flags = flags;
  }
  ~BoardRun() {
    flash_ = board.flash.bytes;
    EXPECT_THAT(rtc_.violations, IsEmpty());
    EXPECT_THAT(board.flash.violations, IsEmpty());
  }
  std::uint32_t set_time(std::uint32_t unix_s) {
    can::Command command;
    command.code = can::Command::code_set_time;
    command.argument = unix_s;
    board.can.others.push_back({wire_frame(command.frame(counter_++)), board.can.now_bit + 1});
    board.run_for_ms(600);
    const auto answer = last<can::CommandAnswer>(board);
    return answer && answer->command_counter == counter_ - 1U ? answer->result : 99;
  }
  std::optional<std::uint32_t> time() {
    const auto words = board.call("bms::hal::calendar_s()", 2);
    return (words[1] & 1) != 0 ? std::optional(words[0]) : std::nullopt;
  }
  std::uint32_t calendar() { return last<can::Board>(board)->calendar; }
  /// Sends samples whose times are a second apart, ten per second.
  void drive(unsigned seconds, std::int32_t current_ua = -2'000'000) {
    for (unsigned k = 0; k < seconds; ++k) {
      measurement::PackSample<16> s;
      s.time_us = 1'000'000ULL * (k + 1);
      s.current_ua = current_ua;
      s.cell_uv.fill(3'280'000);
      s.pack_uv = 16 * 3'280'000;
      s.temperature_cdegc.fill(2'500);
      for (const can::Frame& f : hal::frames_of(s, 0, static_cast<std::uint16_t>(k)))
        board.can.others.push_back({wire_frame(f), board.can.now_bit + 25'000 * (k + 1), true});
    }
    board.run_for_ms(100.0 * seconds + 60);
  }

  UnicornBoard board;

 private:
  RtcModel& rtc_;
  std::vector<std::uint8_t>& flash_;
  std::uint8_t counter_ = 0;
};

class Calendar : public ::testing::Test {
 protected:
  RtcModel rtc;
  std::vector<std::uint8_t> flash =
      std::vector<std::uint8_t>(FlashControllerModel::sectors * FlashControllerModel::sector_bytes, 0xFF);
};

TEST_F(Calendar, ReportsNeverSetAndOnceSetContinuesIntoTheNewYearWithoutPower) {
  {
    BoardRun run(rtc, flash, power_on);
    run.board.run_for_ms(2'100);
    EXPECT_EQ(run.calendar(), can::Board::calendar_never_set);
    EXPECT_FALSE(run.time());
    EXPECT_EQ(run.set_time(new_years_eve_2031), can::CommandAnswer::result_done);
    EXPECT_NEAR(run.time().value_or(0), new_years_eve_2031, 1);
    run.board.run_for_ms(1'100);
    EXPECT_EQ(run.calendar(), can::Board::calendar_runs);
  }
  rtc.power_away(86'400, true);
  BoardRun again(rtc, flash, power_on);
  again.board.run_for_ms(700);
  EXPECT_EQ(again.calendar(), can::Board::calendar_runs);
  EXPECT_NEAR(again.time().value_or(0), new_years_eve_2031 + 86'400 + 2.3, 1.5) << "1 January 2032";
  EXPECT_EQ(rtc.date.year, 32);
}

TEST_F(Calendar, IsNotSetAfterALossOfPowerWithoutABattery) {
  {
    BoardRun run(rtc, flash, power_on);
    run.board.run_for_ms(2'100);
    EXPECT_EQ(run.set_time(new_years_eve_2031), can::CommandAnswer::result_done);
  }
  rtc.power_away(60, false);
  BoardRun again(rtc, flash, power_on);
  again.board.run_for_ms(700);
  EXPECT_EQ(again.calendar(), can::Board::calendar_never_set);
  EXPECT_FALSE(again.time());
}

TEST_F(Calendar, WithoutACrystalCanBeSetAfterFiveSecondsAndIsLostWithThePower) {
  rtc.crystal = false;
  {
    BoardRun run(rtc, flash, power_on);
    run.board.run_for_ms(2'100);
    EXPECT_EQ(run.set_time(new_years_eve_2031), can::CommandAnswer::result_refused) << "the crystal may still start up";
    run.board.run_for_ms(3'000);
    EXPECT_EQ(run.set_time(new_years_eve_2031), can::CommandAnswer::result_done);
    run.board.run_for_ms(1'600);
    EXPECT_EQ(run.calendar(), can::Board::calendar_runs_roughly);
    EXPECT_NEAR(run.time().value_or(0), new_years_eve_2031 + 2, 1);
  }
  rtc.core_reset();
  {
    BoardRun reset(rtc, flash, by_pin);
    reset.board.run_for_ms(700);
    EXPECT_EQ(reset.calendar(), can::Board::calendar_runs_roughly) << "a reset of the core does not change it";
  }
  rtc.power_away(3'600, true);
  BoardRun again(rtc, flash, power_on);
  again.board.run_for_ms(700);
  EXPECT_EQ(again.calendar(), can::Board::calendar_never_set) << "it stopped for an hour";
  EXPECT_FALSE(again.time());
}

TEST_F(Calendar, RefusesATimeBeyondItsCentury) {
  BoardRun run(rtc, flash, power_on);
  run.board.run_for_ms(2'100);
  EXPECT_EQ(run.set_time(946'684'799), can::CommandAnswer::result_refused);
  EXPECT_EQ(run.set_time(4'102'444'800), can::CommandAnswer::result_refused);
  EXPECT_FALSE(run.time());
}

/// 0.2 % per day of rest (estimator/restart.hpp): three days by the clock, an assumed week without it.
TEST_F(Calendar, DeterminesTheSelfDischargeOfARest) {
  std::optional<can::PackState> before;
  {
    BoardRun run(rtc, flash, power_on);
    run.board.run_for_ms(2'100);
    EXPECT_EQ(run.set_time(new_years_eve_2031), can::CommandAnswer::result_done);
    run.drive(64);
    before = last<can::PackState>(run.board);
  }
  const auto start = [&](bool battery) {
    RtcModel of_this = rtc;
    of_this.power_away(3 * 86'400, battery);
    auto stored = flash;
    BoardRun again(of_this, stored, power_on);
    again.board.run_for_ms(700);
    return 1e-7 * last<can::StartingSoc>(again.board)->soc_ppb;
  };
  ASSERT_TRUE(before);
  EXPECT_NEAR(start(true), before->soc - 3 * 0.2, 0.1) << "2 A for three seconds after the record are 0.03 %";
  EXPECT_NEAR(start(false), before->soc - 7 * 0.2, 0.1);
}

/// The flash takes no word, so only the backup registers can keep the fault.
TEST_F(Calendar, BackupRegistersKeepALatchedFaultOverALossOfPower) {
  {
    BoardRun run(rtc, flash, power_on);
    run.board.run_for_ms(700);
  }
  rtc.power_away(60, true);
  {
    BoardRun run(rtc, flash, power_on);
    run.board.run_for_ms(700);
    run.board.flash.worn_out = true;
    run.drive(3, -60'000'000);
    EXPECT_EQ(last<can::Faults>(run.board)->short_circuit, 1U);
    run.board.flash.violations.clear();  // words that were programmed twice, because the first time had no effect
  }
  for (const bool battery : {true, false}) {
    RtcModel of_this = rtc;
    of_this.power_away(60, battery);
    auto stored = flash;
    BoardRun again(of_this, stored, power_on);
    again.board.run_for_ms(700);
    EXPECT_EQ(last<can::Faults>(again.board)->short_circuit, battery ? 1U : 0U);
  }
}

/// Soc moves so little that only the first minute is stored. The second one is in the RAM that the reset does not
/// change.
TEST_F(Calendar, AfterAResetByTheWatchdogSocIsThatOfTheLastMinute) {
  BoardRun run(rtc, flash, power_on);
  run.board.may_start_again = true;
  run.board.run_for_ms(700);
  run.drive(121, -200'000);
  std::vector<float> soc;
  for (const SeenFrame& s : run.board.can.seen) {
    if (s.from_board && s.frame.id == can::PackState::id) soc.push_back(can::PackState::of(s.frame).soc);
  }
  ASSERT_EQ(soc.size(), 121U);
  const float first_minute = soc[60], second_minute = soc[120];
  ASSERT_GT(first_minute - second_minute, 0.03) << "200 mA for a minute are 0.056 % of 6 Ah";
  run.board.patch("bms::firmware::estimator_step(", UnicornBoard::hangs);
  run.drive(1);
  ASSERT_TRUE(run.board.run_until([&] { return !run.board.resets.empty(); }, 5'000));
  run.board.unpatch();
  run.board.run_for_ms(1'000);
  run.drive(1);
  EXPECT_NEAR(1e-7 * last<can::StartingSoc>(run.board)->soc_ppb, second_minute, 0.01);
}

class Supply : public ::testing::Test {
 protected:
  Supply() : run(rtc, flash, power_on) {}
  RtcModel rtc;
  std::vector<std::uint8_t> flash =
      std::vector<std::uint8_t>(FlashControllerModel::sectors * FlashControllerModel::sector_bytes, 0xFF);
  BoardRun run;
  UnicornBoard& board = run.board;
};

constexpr std::uint32_t pins = 0x40020818, all_low = 15U << 22;  // GPIOC_BSRR

TEST_F(Supply, FallingOpensInTheInterruptStoresOneRecordAndIsPublished) {
  board.run_for_ms(1'100);
  run.drive(5);
  ASSERT_EQ(last<can::Board>(board)->supply_low, 0U);
  EXPECT_EQ(board.register_value(0x40007000) & 0xF0, 0xF0U) << "PLS 7, detector on";
  EXPECT_NE(board.register_value(pins), all_low) << "so that a later write is visible";
  const unsigned written = board.flash.words_programmed;
  const double fell_ms = board.now_ms();
  board.supply(true);
  ASSERT_TRUE(board.run_until([&] { return board.register_value(pins) == all_low; }, 5));
  EXPECT_LT(board.now_ms() - fell_ms, 0.05);
  board.run_for_ms(5);
  const unsigned record = board.flash.words_programmed - written;
  EXPECT_GE(record, 12U) << "header and 32 bytes";
  EXPECT_LE(record, 24U) << "plus the last record before the start once more: 0.4 ms";
  board.run_for_ms(600);
  const unsigned with_the_fault = board.flash.words_programmed;
  EXPECT_LE(with_the_fault - written, record + 70) << "the fault is stored with the next sample: 1.1 ms";
  EXPECT_EQ(last<can::Board>(board)->supply_low, 1U);
  EXPECT_EQ(last<can::MoreFaults>(board)->supply_dip, 1U);
  board.supply(false);
  board.run_for_ms(1'200);
  EXPECT_EQ(last<can::Board>(board)->supply_low, 0U);
  const unsigned before = board.flash.words_programmed;
  board.supply(true);
  board.run_for_ms(5);
  EXPECT_GT(board.flash.words_programmed, before) << "a second fall stores again";
}

TEST_F(Supply, RecordHoldsTheChargeUpToTheLastSample) {
  board.run_for_ms(1'100);
  run.drive(20);
  const auto before = last<can::PackState>(board);
  board.supply(true);
  board.run_for_ms(5);
  flash = board.flash.bytes;
  RtcModel other;
  auto stored = flash;
  BoardRun again(other, stored, by_pin);  // no time has passed: no self-discharge
  again.board.run_for_ms(700);
  EXPECT_NEAR(1e-7 * last<can::StartingSoc>(again.board)->soc_ppb, before->soc, 0.0021);
}

TEST_F(Supply, OptionBytesThatAllowATooLowSupplyAreReported) {
  board.run_for_ms(1'700);
  EXPECT_EQ(last<can::Board>(board)->brown_out_reset_low, 0U) << "level 3";
  UnicornBoard other(image());
  other.flash.option_bytes = 0x0FFFAAED | 3U << 2;  // as delivered: off
  other.run_for_ms(1'700);
  EXPECT_EQ(last<can::Board>(other)->brown_out_reset_low, 1U);
}

}  // namespace
}  // namespace bms::firmware
