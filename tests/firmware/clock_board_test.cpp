// Clock and watchdog of the forklift board's image in Unicorn: the clock tree stays within the limits of the manual
// (tests/firmware/rcc_model.hpp ends a run that leaves them), and a failure is found with the slow oscillator at both
// ends of its range, 17 and 47 kHz (datasheet DS8626). The same failures while the contactors are closed:
// front_end_board_test.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "can_messages.hpp"
#include "files/cell_file.hpp"
#include "images/firmware_image.hpp"
#include "images/image_file.hpp"
#include "tests/firmware/contactor_port_models.hpp"
#include "tests/firmware/unicorn_board.hpp"

namespace bms::firmware {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr std::uint32_t by_watchdog = 1U << 29 | 1U << 26, by_software = 1U << 28 | 1U << 26;
constexpr std::uint32_t bsrr = 0x18, moder = 0, all_closed = 15U << 6;  // of port C
constexpr double start_ms = 1'800;                                      // a new chip first erases its data sectors

class ClockBoard : public ::testing::Test {
 protected:
  static const std::filesystem::path& image() {
    static const auto path =
        images::firmware_image("stm32f405_forklift", files::read_cell("table9"), images::Image::application);
    return path;
  }
  template <class Message>
  std::optional<Message> last() const {
    std::optional<Message> found;
    for (const SeenFrame& s : board.can.seen) {
      if (s.from_board && s.frame.id == Message::id) found = Message::of(s.frame);
    }
    return found;
  }
  bool clock_failed() { return board.board_state().clock_failed; }

  ClockBoard() { board.plugged = {{ContactorPort::base, &port}}; }

  ContactorPort port;
  UnicornBoard board{image()};
};

/// The slow oscillator [kHz].
class ForEachLsi : public ClockBoard, public ::testing::WithParamInterface<int> {
 protected:
  ForEachLsi() { board.rcc.lsi_hz = 1e3 * GetParam(); }
  /// A count of the watchdog is 64 cycles; 2 s at 32 kHz are 1,000 counts, and one more until the reset (21.3).
  double timeout_ms() const { return 1'001 * 64.0 / GetParam(); }
};
INSTANTIATE_TEST_SUITE_P(Khz, ForEachLsi, ::testing::Values(17, 32, 47),
                         [](const auto& p) { return std::to_string(p.param); });

TEST_F(ClockBoard, RunsAt168MhzWithTheClockSecuritySystem) {
  board.run_for_ms(100);
  EXPECT_EQ(board.rcc.core_hz(), 168e6);
  EXPECT_EQ(board.rcc.apb1_hz(), 42e6);
  EXPECT_EQ(board.rcc.apb2_hz(), 84e6);
  EXPECT_NE(board.rcc.read(RccModel::cr, 1e5) & 1U << 19, 0U) << "CSSON";
  EXPECT_FALSE(clock_failed());
}

TEST_F(ClockBoard, WaitsForASlowCrystal) {
  board.rcc.crystal_after_us = 10e3;
  board.run_for_ms(150);
  EXPECT_EQ(board.rcc.core_hz(), 168e6);
}

TEST_F(ClockBoard, WithoutALockedPllItRunsOnTheInternalOscillatorAndIsUnfit) {
  board.rcc.pll_locks = false;
  board.run_for_ms(start_ms);
  EXPECT_EQ(board.rcc.core_hz(), 16e6);
  EXPECT_TRUE(clock_failed());
  EXPECT_TRUE(board.board_state().unfit()) << "contactors stay open";
  EXPECT_GT(board.estimates, 0U);
}

TEST_P(ForEachLsi, AGoodClockIsNoFault) {
  board.run_for_ms(start_ms + 1'000);
  EXPECT_FALSE(clock_failed());
  EXPECT_EQ(last<can::Board>()->clock_failed, 0U);
  EXPECT_EQ(last<can::Faults>()->internal_fault, 0U);
}

/// Until prescaler and reload value have arrived at the watchdog, a feed would load 0xFFF: 8 s and more.
TEST_P(ForEachLsi, EveryFeedLoadsTheTimeoutOfTwoSeconds) {
  board.run_for_ms(600);
  EXPECT_GE(board.watchdog_feeds, 1U);
  EXPECT_NEAR(board.watchdog.longest_timeout_ms, timeout_ms(), 1);
}

TEST_P(ForEachLsi, ACoreThatHangsIsResetWithin3770Ms) {
  board.may_start_again = true;
  board.run_for_ms(start_ms);
  board.patch("bms::firmware::estimator_step(", UnicornBoard::hangs);
  const double stands_ms = board.now_ms();
  ASSERT_TRUE(board.run_until([&] { return !board.resets.empty(); }, 4'000));
  EXPECT_THAT(board.resets, ElementsAre(by_watchdog));
  EXPECT_NEAR(board.now_ms() - stands_ms, timeout_ms(), 110) << "the last feed is up to a sample period ago";
  EXPECT_LE(board.now_ms() - stands_ms, 3'770);
  EXPECT_EQ(port.mode(), 0U) << "the outputs are inputs again: open by their pull-downs";
}

/// The longest erase of the datasheet, 500 ms for 16 KiB, and the shortest timeout.
TEST_P(ForEachLsi, AStartThatErasesAllSectorsIsInTime) {
  board.flash.erase_us = 500e3;
  board.run_for_ms(2'500);
  EXPECT_EQ(board.flash.sectors_erased, 3U);
  EXPECT_LT(board.longest_unfed_ms, 1'360);
  EXPECT_FALSE(clock_failed());
}

/// The option byte starts it with the reset: 4,096 counts of 4 cycles (21.3.1).
TEST_P(ForEachLsi, AWatchdogThatTheHardwareStartsIsFedInTime) {
  board.flash.option_bytes &= ~(1U << 5);
  board.run_for_ms(start_ms);
  EXPECT_GT(board.watchdog_feeds, 5U);
}

TEST_P(ForEachLsi, AFrequencyOutsideTheRangeIsReportedWithin5MsWithoutAReset) {
  board.run_for_ms(start_ms);
  ASSERT_FALSE(clock_failed());
  board.rcc.pll_locks = false;
  board.rcc.free_running_hz = 50e6;  // less than 17/47 of 168 MHz
  board.run_for_ms(5);
  EXPECT_TRUE(clock_failed());
  EXPECT_EQ(port.output() & all_closed, 0U);
  board.rcc.pll_locks = true;  // for the bus
  board.run_for_ms(1'100);
  EXPECT_EQ(last<can::Board>()->clock_failed, 1U) << "until the next start";
  EXPECT_EQ(last<can::Faults>()->internal_fault, 1U);
}

TEST_F(ClockBoard, WithoutASlowOscillatorTheClockIsNotTrusted) {
  board.run_for_ms(start_ms);
  board.rcc.lsi_hz = 0;  // the watchdog stands, too
  board.run_for_ms(250);
  EXPECT_TRUE(clock_failed());
  EXPECT_EQ(last<can::Faults>()->internal_fault, 1U);
}

/// With the crystal of the real-time clock the core's frequency is known to 1 %.
class WithClockCrystal : public ClockBoard {
 protected:
  WithClockCrystal() {
    rtc.crystal_after_us = 100e3;
    board.rtc = &rtc;
    board.run_for_ms(start_ms);
  }
  RtcModel rtc;
};

TEST_F(WithClockCrystal, AnErrorOf2PercentIsFoundAndOneOfHalfAPercentIsNot) {
  ASSERT_FALSE(clock_failed());
  board.rcc.crystal_hz = 0.995 * 25e6;
  board.run_for_ms(300);
  EXPECT_FALSE(clock_failed());
  board.rcc.crystal_hz = 0.98 * 25e6;
  board.run_for_ms(5);
  EXPECT_TRUE(clock_failed());
  EXPECT_EQ(port.output() & all_closed, 0U);
}

TEST_F(WithClockCrystal, WhenItStopsTheInternalOscillatorReplacesIt) {
  rtc.crystal = false;
  board.run_for_ms(500);
  EXPECT_FALSE(clock_failed());
  board.rcc.pll_locks = false;
  board.run_for_ms(5);
  EXPECT_TRUE(clock_failed());
}

/// The NMI of the clock security system interrupts whatever runs, and leaves a record.
TEST_F(ClockBoard, ACrystalThatStopsResetsTheCoreWhichContinuesWithoutIt) {
  board.may_start_again = true;
  board.run_for_ms(start_ms);
  board.rcc.crystal = false;
  ASSERT_TRUE(board.run_until([&] { return !board.resets.empty(); }, 0.2));
  EXPECT_THAT(board.resets, ElementsAre(by_software));
  const unsigned before = board.estimates;
  board.run_for_ms(1'500);
  EXPECT_EQ(board.resets.size(), 1U);
  EXPECT_EQ(board.rcc.core_hz(), 16e6);
  EXPECT_GT(board.estimates, before);
  EXPECT_TRUE(clock_failed());
  EXPECT_EQ(port.output() & all_closed, 0U);
}

TEST_F(ClockBoard, ACrystalThatStopsForAMomentIsRecordedAsAnNmi) {
  board.may_start_again = true;
  board.run_for_ms(start_ms);
  board.rcc.crystal = false;
  ASSERT_TRUE(board.run_until([&] { return !board.resets.empty(); }, 0.2));
  board.rcc.crystal = true;
  board.run_for_ms(1'500);
  EXPECT_EQ(board.rcc.core_hz(), 168e6);
  EXPECT_EQ(last<can::Board>()->last_exception, 2U);
  EXPECT_EQ(last<can::Board>()->clock_failed, 0U);
  EXPECT_EQ(last<can::Faults>()->internal_fault, 1U) << "until it is cleared";
}

/// A handler of the bus that never ends delays neither supply nor clock supervision.
TEST_F(ClockBoard, SupplyAndCrystalInterruptTheHandlerOfTheBus) {
  board.may_start_again = true;
  board.run_for_ms(start_ms);
  board.patch("can1_tx_interrupt", UnicornBoard::hangs);
  ASSERT_TRUE(board.run_until([&] { return board.exception() == 16 + 19; }, 200));
  port.write(bsrr, all_closed, 0);
  board.supply(true);
  board.run_for_ms(0.05);
  EXPECT_EQ(port.output() & all_closed, 0U);
  EXPECT_EQ(board.exception(), 16U + 19) << "it goes on";
  board.rcc.crystal = false;
  EXPECT_TRUE(board.run_until([&] { return !board.resets.empty(); }, 0.2));
}

TEST_F(ClockBoard, AWrongBitOfTheImageIsFoundWhileItRuns) {
  board.run_for_ms(start_ms);
  ASSERT_EQ(last<can::Board>()->image_failed, 0U);
  board.flip_bit(images::ImageFile(image()).symbol("image_code_end") - 6, 3);
  // The place that is read now may be behind the wrong bit: two passes, and the next message.
  const auto found = [&] { return last<can::Board>()->image_failed == 1; };
  for (int s = 0; s < 2 * 26 + 1 && !found(); ++s) board.run_for_ms(1'000);
  EXPECT_TRUE(found());
  EXPECT_EQ(last<can::Faults>()->internal_fault, 1U);
}

TEST_F(ClockBoard, DisturbedPinsAreWrittenAgainWithTheNextSample) {
  board.run_for_ms(start_ms);
  port.write(bsrr, all_closed, 0);
  port.write(moder, 0xAAU << 12, 0);  // pins of another peripheral
  board.run_for_ms(110);
  EXPECT_EQ(port.output() & all_closed, 0U);
  EXPECT_EQ(port.mode() >> 12 & 0xFF, 0x55U);
}

}  // namespace
}  // namespace bms::firmware
