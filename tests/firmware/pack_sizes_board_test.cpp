// The remote image of the forklift board with 8 and with 15 cells, in Unicorn: it runs, sends the messages of its own
// cells and protects the last of them.
#include <map>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "tests/firmware/bxcan_board.hpp"
#include "tests/firmware/rated_cell.hpp"

namespace bms::firmware {
namespace {

template <std::size_t Cells>
measurement::PackSample<Cells> sample_at(unsigned k, std::int32_t last_cell_uv) {
  measurement::PackSample<Cells> s;
  s.time_us = 100'000U * k;
  s.current_ua = 0;
  s.pack_uv = 0;
  for (std::size_t c = 0; c < Cells; ++c)
    s.pack_uv += s.cell_uv[c] = (c + 1 < Cells ? 3'280'000 : last_cell_uv) + static_cast<std::int32_t>(k % 3 * 500);
  s.temperature_cdegc.fill(static_cast<std::int16_t>(2'500 + k % 5));
  return s;
}

/// The last frame of each identifier that the board has sent.
std::map<std::uint32_t, can::Frame> last_frames(const UnicornBoard& board) {
  std::map<std::uint32_t, can::Frame> last;
  for (const SeenFrame& s : board.can.seen) {
    if (s.from_board) last[s.frame.id] = s.frame;
  }
  return last;
}

template <std::size_t Cells>
std::map<std::uint32_t, can::Frame> frames_of_a_second(std::int32_t last_cell_uv) {
  static const auto image =
      images::firmware_image("stm32f405_forklift", table9(), images::Image::remote, "none", Cells);
  expect_within_budgets(image);
  UnicornBoard board{image};
  board.flash.bytes = started_once();
  run_until_it_listens(board);
  for (unsigned k = 0; k < 10; ++k) {
    for (const can::Frame& f : hal::frames_of(sample_at<Cells>(k, last_cell_uv), 0, static_cast<std::uint16_t>(k)))
      board.can.others.push_back({wire_frame(f), board.can.now_bit, true});
    board.run_for_ms(100);
  }
  EXPECT_THAT(board.can.violations, IsEmpty());
  return last_frames(board);
}

TEST(PackOf8Cells, SendsTwoMessagesOfCellsAndDetectsOvervoltageOfTheLast) {
  auto normal = frames_of_a_second<8>(3'300'000);
  EXPECT_NEAR(can::CellVoltages2::of(normal.at(0x191)).cell8, 3.3, 0.0015);
  EXPECT_FALSE(normal.contains(0x192) || normal.contains(0x193) || normal.contains(0x1AC)) << "absent cells";
  EXPECT_NEAR(can::PackElectrical::of(normal.at(0x181)).voltage, 7 * 3.28 + 3.3, 0.01);
  EXPECT_EQ(can::Faults::of(normal.at(0x196)).first_cause, 0U);
  EXPECT_EQ(can::Faults::of(frames_of_a_second<8>(3'900'000).at(0x196)).cell_overvoltage_severe, 1U);
}

TEST(PackOf15Cells, SendsTheSixteenthAsNotKnownAndDetectsOvervoltageOfTheLast) {
  auto normal = frames_of_a_second<15>(3'300'000);
  EXPECT_NEAR(can::CellVoltages4::of(normal.at(0x193)).cell15, 3.3, 0.0015);
  EXPECT_TRUE(std::isnan(can::CellVoltages4::of(normal.at(0x193)).cell16));
  EXPECT_FALSE(normal.contains(0x1AC) || normal.contains(0x1AE));
  EXPECT_NEAR(can::PackElectrical::of(normal.at(0x181)).voltage, 14 * 3.28 + 3.3, 0.02);
  EXPECT_EQ(can::Faults::of(normal.at(0x196)).first_cause, 0U);
  EXPECT_EQ(can::Faults::of(frames_of_a_second<15>(3'900'000).at(0x196)).cell_overvoltage_severe, 1U);
}

/// Only of a cell file that rates pulses. Nothing is closed here, so nothing may flow.
TEST(PackOfARatedCell, SendsPulseCurrentsAndAnotherOneDoesNot) {
  const auto with = images::firmware_image("stm32f405_forklift", table9_rated(), images::Image::remote);
  const ImageSize size = expect_within_budgets(with), plain = size_of(image());
  fmt::print("{} bytes of flash and {} of RAM more\n", size.text + size.data - plain.text - plain.data,
             size.data + size.bss - plain.data - plain.bss);
  for (const bool is_rated : {true, false}) {
    UnicornBoard board{is_rated ? with : image()};
    board.flash.bytes = started_once();
    run_until_it_listens(board);
    for (unsigned k = 0; k < 10; ++k) {
      for (const can::Frame& f : hal::frames_of(sample_at<16>(k, 3'300'000), 0, static_cast<std::uint16_t>(k)))
        board.can.others.push_back({wire_frame(f), board.can.now_bit, true});
      board.run_for_ms(100);
    }
    const auto last = last_frames(board);
    ASSERT_EQ(last.contains(0x18C), is_rated);
    if (!is_rated) continue;
    EXPECT_TRUE(can::intact(last.at(0x18C), can::PulseCurrents::data_id));
    EXPECT_EQ(can::PulseCurrents::of(last.at(0x18C)).discharge_ten_seconds, 0);
    EXPECT_EQ(can::PulseCurrents::of(last.at(0x18C)).charge_thirty_seconds, 0);
  }
}

}  // namespace
}  // namespace bms::firmware
