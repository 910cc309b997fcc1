// The image of the single-cell board in Unicorn, with a register model of the chip's converter: the readings of the
// cell are on the CAN bus, a correction changes them, and a converter that hangs stops its readings but not the
// firmware.
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "can_messages.hpp"
#include "estimator/estimate.hpp"
#include "files/cell_file.hpp"
#include "images/firmware_image.hpp"
#include "tests/firmware/converter_model.hpp"
#include "tests/hal/thermistor.hpp"

namespace bms::firmware {
namespace {

using ::testing::IsEmpty;

/// The cell, the shunt with its amplifier and the thermistor at PA2, PA1 and PA3.
struct Converter : ConverterModel {
  double cell_v = 3.3, current_a = 0, celsius = 25;

  Converter() {
    input_v = [this](std::uint32_t channel) {
      const double ohm = thermistor_ohm(celsius);
      if (channel == 1) return supply_v / 2 + 20 * 0.002 * current_a;
      if (channel == 2) return cell_v / 2;
      return channel == 3 ? supply_v * ohm / (ohm + 10'000) : 0;
    };
  }
};

class CellBoard : public ::testing::Test {
 protected:
  CellBoard() {
    board.plugged = {{Converter::base, &converter}};
    board.run_for_ms(900);  // a new chip first erases its data sectors
  }
  void TearDown() override {
    EXPECT_THAT(converter.violations, IsEmpty());
    EXPECT_THAT(board.can.violations, IsEmpty());
    EXPECT_THAT(board.flash.violations, IsEmpty());
    EXPECT_LT(board.longest_unfed_ms, 1'360);
  }
  template <class Message>
  Message last() const {
    std::optional<Message> found;
    for (const SeenFrame& s : board.can.seen) {
      if (s.from_board && s.frame.id == Message::id) found = Message::of(s.frame);
    }
    if (!found) throw std::runtime_error("not sent");
    return *found;
  }
  std::uint32_t command(std::uint32_t code, std::int32_t argument) {
    can::Command c;
    c.code = code;
    c.argument = static_cast<std::uint32_t>(argument);
    board.can.others.push_back({wire_frame(c.frame(counter_++)), board.can.now_bit + 1});
    board.run_for_ms(250);
    return last<can::CommandAnswer>().result;
  }

  Converter converter;
  UnicornBoard board{images::firmware_image("stm32f405_cell", files::read_cell("table9"), images::Image::application)};

 private:
  std::uint8_t counter_ = 0;
};

TEST_F(CellBoard, ReadingsOfTheCellAreOnTheBus) {
  for (const double current_a : {-5.5, 0.0, 3.0}) {
    converter.current_a = current_a;
    converter.cell_v = 3.3 + 0.01 * current_a;
    converter.celsius = 25 + 3 * current_a;
    board.run_for_ms(320);
    const auto electrical = last<can::PackElectrical>();
    EXPECT_NEAR(electrical.voltage, converter.cell_v, 0.003)
        << "0.03 % of the reference, plus a millivolt of the signal";
    EXPECT_NEAR(electrical.current, current_a, 0.03);
    EXPECT_NEAR(electrical.temperature, converter.celsius, 0.5);
  }
  EXPECT_GT(converter.conversions, 7U * 900U);
  EXPECT_GE(board.estimates, 9U);
}

/// A current that flows for a tenth of the period counts as a tenth in the next sample.
TEST_F(CellBoard, ASampleIsTheMeanOfItsPeriod) {
  const unsigned before = board.estimates;
  ASSERT_TRUE(board.run_until([&] { return board.estimates > before; }, 200));
  board.run_for_ms(20);
  converter.current_a = -30;
  board.run_for_ms(10);
  converter.current_a = 0;
  const unsigned next = board.estimates;
  ASSERT_TRUE(board.run_until([&] { return board.estimates > next; }, 200));
  board.run_for_ms(10);
  EXPECT_NEAR(last<can::PackElectrical>().current, -3, 0.35) << "to the millisecond";
}

TEST_F(CellBoard, ACorrectionChangesTheReadingAndSurvivesALossOfPower) {
  converter.current_a = -4;
  EXPECT_EQ(command(can::Command::code_voltage_gain, 10'000), can::CommandAnswer::result_done);
  EXPECT_EQ(command(can::Command::code_current_offset, 1'000'000), can::CommandAnswer::result_done);
  board.run_for_ms(250);
  EXPECT_NEAR(last<can::PackElectrical>().voltage, 1.01 * 3.3, 0.003);
  EXPECT_NEAR(last<can::PackElectrical>().current, -3, 0.03);
  UnicornBoard again{images::firmware_image("stm32f405_cell", files::read_cell("table9"), images::Image::application),
                     2};
  again.flash.bytes = board.flash.bytes;
  again.plugged = {{Converter::base, &converter}};
  again.run_for_ms(250);
  std::optional<can::PackElectrical> electrical;
  for (const SeenFrame& s : again.can.seen) {
    if (s.from_board && s.frame.id == can::PackElectrical::id) electrical = can::PackElectrical::of(s.frame);
  }
  ASSERT_TRUE(electrical);
  EXPECT_NEAR(electrical->voltage, 1.01 * 3.3, 0.003);
  EXPECT_NEAR(electrical->current, -3, 0.03);
}

TEST_F(CellBoard, AHangingConverterStopsOnlyItsReadings) {
  converter.hangs = true;
  const unsigned before = board.estimates;
  board.run_for_ms(1'000);
  EXPECT_GE(board.estimates - before, 9U);
  EXPECT_TRUE(std::isnan(last<can::PackElectrical>().voltage));
  EXPECT_NE(last<can::Status>().flags & estimator::voltage_missing, 0U);
  EXPECT_EQ(last<can::Faults>().samples_missing, 1U) << "nothing was read";
  converter.hangs = false;
  board.run_for_ms(300);
  EXPECT_NEAR(last<can::PackElectrical>().voltage, 3.3, 0.003);
}

/// The board has one switch, at the output of main plus, and no DC link.
TEST_F(CellBoard, ClosesItsSwitchForATruckThatDrivesAndOpensItAtTheEndOfTheRequest) {
  const auto output = [&] { return (board.register_value(0x40020818) >> 6 & 1) != 0; };  // GPIOC_BSRR: PC6
  EXPECT_FALSE(output());
  EXPECT_EQ(command(can::Command::code_request, 1), can::CommandAnswer::result_done);
  EXPECT_TRUE(output());
  EXPECT_EQ(last<can::ContactorState>().state, can::ContactorState::state_drive);
  EXPECT_EQ(last<can::ContactorState>().precharge, 0U);
  converter.current_a = -4;
  board.run_for_ms(2'000);
  EXPECT_TRUE(output());
  EXPECT_EQ(last<can::Faults>().first_cause, 0U);
  EXPECT_GT(last<can::AllowedCurrent>().discharge, 1);
  EXPECT_EQ(command(can::Command::code_request, 0), can::CommandAnswer::result_done);
  EXPECT_TRUE(output()) << "not under load";
  converter.current_a = 0;
  board.run_for_ms(1'000);
  EXPECT_FALSE(output());
  EXPECT_EQ(last<can::Faults>().first_cause, 0U);
  converter.current_a = -4;
  board.run_for_ms(1'000);
  EXPECT_EQ(last<can::Faults>().contactor_welded, 1U) << "current flows through an open switch";
}

TEST_F(CellBoard, ItsPinsAreAnalog) {
  EXPECT_EQ(board.register_value(0x40020000) & 0xFC, 0xFCU) << "GPIOA_MODER: PA1 to PA3";
}

}  // namespace
}  // namespace bms::firmware
