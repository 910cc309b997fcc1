// The chip image of the netduinoplus2 in Unicorn, with a register model of its UART. Bytes that the firmware cannot
// read in time are lost and counted, and the firmware answers the next command.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/cell_file.hpp"
#include "hal/received_bytes.hpp"
#include "images/firmware_image.hpp"
#include "tests/firmware/unicorn_board.hpp"
#include "tests/firmware/usart_model.hpp"

namespace bms::firmware {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

class UartBoard : public ::testing::Test {
 protected:
  UartBoard() {
    board.plugged = {{UsartModel::base, &usart}};
    EXPECT_TRUE(board.run_until([&] { return usart.sent == "\r"; }, 5'000))
        << "ready after erasing the storage of a new chip";
    board.run_for_ms(2);
    usart.sent.clear();
  }
  void TearDown() override { EXPECT_THAT(board.flash.violations, IsEmpty()); }

  bool answers(const std::string& command, const std::string& answer) {
    usart.sent.clear();
    usart.receive(command);
    return board.run_until([&] { return usart.sent.ends_with(answer); }, 20);
  }
  /// The last of the three counters after the buffer, read as by a debugger.
  std::uint32_t lost() const {
    static_assert(sizeof(hal::ReceivedBytes) == 512 + 3 * 4);
    return board.word(board.address_of("bms::hal::(anonymous namespace)::received_bytes") + 512 + 2 * 4);
  }

  UsartModel usart;
  UnicornBoard board{images::firmware_image("netduinoplus2", files::read_cell("table9"), images::Image::bench)};
};

TEST_F(UartBoard, AnswersCommandsAndLosesNoByte) {
  EXPECT_TRUE(answers("V\r", "V1010\r")) << usart.sent;
  EXPECT_TRUE(answers("N\r", "N0000\r")) << usart.sent;
  EXPECT_EQ(usart.overruns, 0U);
  EXPECT_EQ(lost(), 0U);
}

/// RM0090, 30.3.3: ORE is set and RXNE is not. The interrupt stays raised until SR and then DR are read. A handler that
/// checks only RXNE would be called again and again until the watchdog resets the core.
TEST_F(UartBoard, AnOverrunBetweenTheReadsOfStatusAndDataIsCountedAndClearsTheInterrupt) {
  usart.receive_between_the_reads('x');
  EXPECT_TRUE(answers("V\r", "V1010\r")) << usart.sent;
  EXPECT_EQ(usart.overruns, 1U);
  EXPECT_EQ(lost(), 1U);
  EXPECT_TRUE(answers("N\r", "N0000\r")) << usart.sent;
  EXPECT_EQ(lost(), 1U);
}

TEST_F(UartBoard, BytesThatArriveWhileTheInterruptIsHeldAreLostAndTheNextCommandIsAnswered) {
  usart.interrupt_held = true;
  usart.receive("V\rV\rV\r");
  board.run_for_ms(1);
  EXPECT_EQ(usart.overruns, 5U);
  usart.interrupt_held = false;
  board.run_for_ms(1);
  EXPECT_EQ(lost(), 1U) << "the chip does not count overruns";
  EXPECT_TRUE(answers("\r", "V1010\r")) << "the first V was not lost: " << usart.sent;
  EXPECT_TRUE(answers("V\r", "V1010\r")) << usart.sent;
}

TEST_F(UartBoard, AnIncompleteCommandSpoilsOnlyTheNextCommand) {
  usart.receive("t12");
  usart.receive(std::string("\0\xFF", 2));
  board.run_for_ms(1);
  EXPECT_TRUE(answers("V\r", "\a")) << usart.sent;
  EXPECT_TRUE(answers("V\r", "V1010\r")) << usart.sent;
  std::string too_long(600, '#');
  too_long.push_back('\r');
  EXPECT_TRUE(answers(too_long, "\a")) << usart.sent;
  EXPECT_TRUE(answers("V\r", "V1010\r")) << usart.sent;
  EXPECT_EQ(lost(), 0U);
}

}  // namespace
}  // namespace bms::firmware
