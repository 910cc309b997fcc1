// The image of the forklift board in Unicorn. Parts of it are made to hang or to do nothing: the watchdog resets the
// core, and the next run reports it and keeps the contactors open. A missing bus or measuring chain does not stop the
// firmware.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "can_messages.hpp"
#include "files/cell_file.hpp"
#include "firmware/progress.hpp"
#include "images/firmware_image.hpp"
#include "images/image_file.hpp"
#include "tests/firmware/unicorn_board.hpp"

namespace bms::firmware {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr std::uint32_t by_watchdog = 1U << 29 | 1U << 26, by_software = 1U << 28 | 1U << 26;
constexpr double watchdog_ms = 2'000;

/// The last frame of a message after a given time.
template <class Message>
std::optional<Message> last(const UnicornBoard& board, std::uint64_t after_bit = 0) {
  std::optional<Message> found;
  for (const SeenFrame& s : board.can.seen) {
    if (s.from_board && s.frame.id == Message::id && s.begin_bit >= after_bit) found = Message::of(s.frame);
  }
  return found;
}

class Watchdog : public ::testing::Test {
 protected:
  Watchdog() { board.may_start_again = true; }
  void run() { board.run_for_ms(1'800); }  // a new chip first erases its data sectors
  UnicornBoard board{
      images::firmware_image("stm32f405_forklift", files::read_cell("table9"), images::Image::application)};
};

TEST(Progress, NeedsACompletelyProcessedSample) {
  const auto second = [](const Progress::SampleProgress& done) {
    Progress p;
    EXPECT_TRUE(p.complete({1'000, 1'000, 1}));
    return p.complete(done);
  };
  EXPECT_TRUE(second({2'000, 2'000, 2}));
  EXPECT_FALSE(second({1'000, 1'000, 2})) << "the same sample again";
  EXPECT_FALSE(second({500, 500, 2})) << "an older one";
  EXPECT_FALSE(second({2'000, 1'000, 2})) << "the estimator has not processed it";
  EXPECT_FALSE(second({2'000, 2'000, 1})) << "it was not published";
}

TEST(Progress, ContinuesWhenAllPartsContinueAndTheCounterWraps) {
  Progress p;
  EXPECT_FALSE(p.complete({1'000, 1'000, 0xFFFF'FFFF}));
  EXPECT_TRUE(p.complete({2'000, 2'000, 0}));
  EXPECT_FALSE(p.complete({3'000, 2'000, 1}));
  EXPECT_TRUE(p.complete({4'000, 4'000, 2}));
}

/// One part fails, the others work: it hangs, or it returns without doing anything.
struct Stall {
  const char* name;
  const char* function;
  UnicornBoard::Instructions instructions;
};
class OnePartStops : public Watchdog, public ::testing::WithParamInterface<Stall> {};

TEST_P(OnePartStops, TheWatchdogResetsTheCore) {
  run();
  ASSERT_THAT(board.resets, IsEmpty());
  EXPECT_GT(board.watchdog_feeds, 5U);
  board.patch(GetParam().function, GetParam().instructions);
  const double stands_ms = board.now_ms();
  ASSERT_TRUE(board.run_until([&] { return !board.resets.empty(); }, 2 * watchdog_ms)) << "the watchdog was fed";
  EXPECT_THAT(board.resets, ElementsAre(by_watchdog));
  EXPECT_NEAR(board.now_ms() - stands_ms, watchdog_ms, 150) << "plus a sample period and a step of the watchdog";
}
INSTANTIATE_TEST_SUITE_P(
    Parts, OnePartStops,
    ::testing::Values(Stall{"SamplingHangs", "bms::hal::bq76952::FrontEnd::read(", UnicornBoard::hangs},
                      Stall{"EstimationHangs", "bms::firmware::estimator_step(", UnicornBoard::hangs},
                      Stall{"EstimationDoesNothing", "bms::firmware::estimator_step(", UnicornBoard::returns},
                      Stall{"TelemetryHangs", "bms::hal::can_send(", UnicornBoard::hangs},
                      Stall{"TimeStands", "clock_interrupt", UnicornBoard::returns}),
    [](const auto& p) { return std::string(p.param.name); });

TEST_F(Watchdog, AfterItsResetTheNextRunReportsItAndIsSafe) {
  run();
  board.patch("bms::firmware::estimator_step(", UnicornBoard::hangs);  // interrupts continue
  ASSERT_TRUE(board.run_until([&] { return !board.resets.empty(); }, 2 * watchdog_ms));
  board.unpatch();
  const std::uint64_t again = board.can.now_bit;
  run();
  EXPECT_THAT(board.resets, ElementsAre(by_watchdog));
  ASSERT_TRUE(last<can::Status>(board, again));
  EXPECT_EQ(last<can::Status>(board, again)->reset_cause, can::Status::reset_cause_watchdog);
  EXPECT_EQ(last<can::Faults>(board, again)->internal_fault, 1U);
  EXPECT_EQ(last<can::ContactorState>(board, again)->main_plus, 0U);
}

const std::filesystem::path& forklift() {
  static const auto path =
      images::firmware_image("stm32f405_forklift", files::read_cell("table9"), images::Image::application);
  return path;
}
std::uint32_t symbol(const char* name) { return images::ImageFile(forklift()).symbol(name); }

TEST_F(Watchdog, AProcessorFaultResetsAtOnceAndTheNextRunReportsItsAddress) {
  run();
  const double before_ms = board.now_ms();
  board.patch("bms::firmware::estimator_step(", UnicornBoard::undefined);
  ASSERT_TRUE(board.run_until([&] { return !board.resets.empty(); }, 500));
  EXPECT_LT(board.now_ms() - before_ms, 120) << "with the next sample";
  EXPECT_THAT(board.resets, ElementsAre(by_software));
  EXPECT_EQ(board.register_value(0x40020818), 0U) << "the outputs are inputs again";
  board.unpatch();
  const std::uint64_t again = board.can.now_bit;
  run();
  EXPECT_EQ(board.resets.size(), 1U);
  EXPECT_EQ(last<can::Status>(board, again)->reset_cause, can::Status::reset_cause_software);
  ASSERT_TRUE(last<can::LastFaultAddress>(board, again));
  EXPECT_EQ(last<can::LastFaultAddress>(board, again)->program_counter,
            board.address_of("bms::firmware::estimator_step("));
  EXPECT_EQ(last<can::LastFaultCause>(board, again)->configurable_fault_status, 1U << 16);
  EXPECT_EQ(last<can::Board>(board, again)->last_exception, 6U);
  EXPECT_EQ(last<can::Faults>(board, again)->internal_fault, 1U);
}

/// On a core without a memory protection unit, like that of Unicorn. With one: firmware_test in QEMU.
TEST_F(Watchdog, AStackThatHasGrownIntoItsGuardIsReportedAndOpens) {
  run();
  board.run_for_ms(2'500);
  EXPECT_EQ(last<can::Board>(board)->stack_overrun, 0U);
  EXPECT_NEAR(last<can::Board>(board)->stack_free, 7 * 1'024 - board.stack_used(), 64);
  board.flip_bit(symbol("image_stack_limit") + 1'023, 0);
  board.run_for_ms(150);
  EXPECT_EQ(last<can::Board>(board)->stack_overrun, 1U);
  EXPECT_EQ(last<can::Faults>(board)->internal_fault, 1U);
}

TEST_F(Watchdog, OneWrongBitOfTheImageIsReported) {
  board.flip_bit(symbol("image_code_end") - 6, 3);
  run();
  EXPECT_EQ(last<can::Board>(board)->image_failed, 1U);
  EXPECT_EQ(last<can::Faults>(board)->internal_fault, 1U);
}

TEST_F(Watchdog, AnUnchangedImagePassesItsCheck) {
  run();
  const auto status = last<can::Board>(board);
  EXPECT_EQ(status->image_failed | status->ram_failed | status->stack_overrun, 0U);
  EXPECT_EQ(last<can::Faults>(board)->internal_fault, 0U);
}

/// In the data, and in an unused part of the stack; stuck at 0 and at 1.
TEST(Ram, AStuckBitIsReported) {
  for (const std::uint32_t address : {symbol("image_bss_end") - 1, symbol("image_stack_limit") + 2'001}) {
    for (const bool at : {false, true}) {
      UnicornBoard board(forklift());
      board.stick(address, 6, at);
      board.run_for_ms(1'800);
      const auto status = last<can::Board>(board);
      ASSERT_TRUE(status);
      EXPECT_EQ(status->ram_failed, 1U) << std::hex << address << at;
      EXPECT_EQ(last<can::Faults>(board)->internal_fault, 1U);
    }
  }
}

TEST_F(Watchdog, AMissingBusAndMeasuringChainAreNoReasonForAReset) {
  board.can.others_acknowledge = false;  // and nothing is plugged in at I2C1
  board.run_for_ms(6'000);
  EXPECT_THAT(board.resets, IsEmpty());
  EXPECT_LT(board.longest_unfed_ms, 1'360) << "shortest timeout of the watchdog within the tolerance of its oscillator";
}

}  // namespace
}  // namespace bms::firmware
