// The forklift board's own image in Unicorn, its I2C controller a register model, a model of the front end on its wire: what the cells have is on the CAN
// bus, and a chip that goes, hangs or is reset takes the readings with it, not the firmware.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "host_sim/cell_file.hpp"
#include "host_sim/firmware_image.hpp"
#include "tests/firmware/i2c_controller_model.hpp"

namespace bms {
namespace {

using ::testing::IsEmpty;

const std::filesystem::path& image() {
  static const auto path = firmware_image("stm32f405_forklift", read_cell("table9"), Image::application);
  return path;
}

class FrontEndBoard : public ::testing::Test {
 protected:
  FrontEndBoard() {
    for (std::size_t k = 0; k < 16; ++k) chip.cell_v[k] = 3.28 + 0.001 * static_cast<double>(k);
    chip.stack_v = 16 * 3.2875;
    chip.ld_v = 0.2;
    chip.current_a = -12;
    board.plugged = {{I2cControllerModel::base, &i2c}, {I2cPins::base, &pins}};
  }
  void TearDown() override {
    EXPECT_THAT(i2c.violations, IsEmpty());
    EXPECT_THAT(chip.violations, IsEmpty());
    EXPECT_THAT(board.can.violations, IsEmpty());
    EXPECT_LT(board.longest_unfed_ms, 1'360);
  }
  std::optional<hal::CanFrame> last(unsigned id) const {
    std::optional<hal::CanFrame> found;
    for (const SeenFrame& s : board.can.seen) {
      if (s.from_board && s.frame.id == id) found = s.frame;
    }
    return found;
  }
  /// As on the bus [V], 0 to 8.19; a cell that is not known is above.
  double cell_on_the_bus(std::size_t k) const {
    const auto frame = last(0x190U + static_cast<unsigned>(k / 4));
    if (!frame) return -1;
    std::uint64_t bits = 0;
    for (std::size_t j = 0; j < 8; ++j) bits |= static_cast<std::uint64_t>(frame->data[j]) << 8 * j;
    return 0.001 * static_cast<double>(bits >> (12 + 13 * (k % 4)) & 0x1FFF);
  }
  void expect_cells() const {
    for (std::size_t k = 0; k < 16; ++k) EXPECT_NEAR(cell_on_the_bus(k), chip.cell_v[k], 0.00051) << k;
  }

  Bq76952Model chip;
  I2cControllerModel i2c{chip};
  I2cPins pins{chip};
  UnicornBoard board{image()};
};

TEST_F(FrontEndBoard, TheCellsOfTheModelAreOnTheBusToTheMillivolt) {
  board.run_for_ms(3'600 + 750);  // a new chip's store is erased first, three sectors of 0.25 s
  expect_cells();
  EXPECT_EQ(i2c.ccr, 0x8023U) << "400 kHz from 42 MHz, RM0090, 27.6.8";
  EXPECT_EQ(i2c.frequency_mhz, 42U);
  EXPECT_EQ(i2c.trise, 13U);
  EXPECT_GE(board.estimates, 30U);
  fmt::print("stack {} bytes, {} transfers\n", board.stack_used(), i2c.transfers);
}

TEST_F(FrontEndBoard, AChipThatIsGoneThenHangsThenIsBackTakesOnlyItsReadingsWithIt) {
  board.run_for_ms(3'000);
  expect_cells();
  chip.gone = true;
  unsigned before = board.estimates;
  board.run_for_ms(1'200);
  EXPECT_GE(board.estimates - before, 11U);
  EXPECT_GT(cell_on_the_bus(3), 8.18) << "not known";
  chip.gone = false;
  chip.hung = true;
  before = board.estimates;
  board.run_for_ms(1'200);
  EXPECT_GE(board.estimates - before, 11U);
  chip.hung = false;
  chip.reset();
  chip.cell_v[3] = 3.4;
  board.run_for_ms(4'500);
  expect_cells();
}

TEST_F(FrontEndBoard, ContactorsAreOpenWhileNobodyAsks) {
  board.run_for_ms(2'500);
  EXPECT_EQ(board.register_value(0x40020818), 15U << 22) << "GPIOC_BSRR: PC6 to PC9 low";
  EXPECT_EQ(board.register_value(0x40020800) >> 12 & 0xFF, 0x55U) << "outputs";
}

}  // namespace
}  // namespace bms
