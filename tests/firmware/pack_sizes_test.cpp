// The application with packs of 8, 15, 24, 25 and 32 cells, on this machine: the messages of its cells, and no others.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "tests/firmware/application_fixture.hpp"

namespace bms::firmware {
namespace {

class PackSizes : public TelemetryTest {
 protected:
  /// Processes one sample in which cell k has 3.2 V and k millivolts. Returns the identifiers of what was sent.
  template <std::size_t Cells>
  std::set<std::uint32_t> send_sample() {
    Application<Board<Cells>> pack{std::nullopt, {0xCE110001, 0}, 6, persistence};
    measurement::PackSample<Cells> reading;
    reading.current_ua = 0;
    reading.pack_uv = 0;
    for (std::size_t k = 0; k < Cells; ++k)
      reading.pack_uv += reading.cell_uv[k] = 3'200'000 + 1'000 * static_cast<std::int32_t>(k + 1);
    reading.temperature_cdegc.fill(2'500);
    pack.process_sample(reading);
    std::set<std::uint32_t> ids;
    for (const can::Frame& f : sent) ids.insert(f.id);
    return ids;
  }
  /// 0x190 to 0x193, 0x1AC to 0x1AE, 0x1BB and 0x1BC: cell voltages and the voltage of a large pack.
  static std::set<std::uint32_t> of_cells(std::set<std::uint32_t> ids) {
    const auto within = [](std::uint32_t id, std::uint32_t first, std::uint32_t last) {
      return id >= first && id <= last;
    };
    std::erase_if(ids, [&](std::uint32_t id) {
      return !within(id, 0x190, 0x193) && !within(id, 0x1AC, 0x1AE) && !within(id, 0x1BB, 0x1BC);
    });
    return ids;
  }
};

TEST_F(PackSizes, OfEightCellsSendsTwoMessagesOfCells) {
  EXPECT_EQ(of_cells(send_sample<8>()), (std::set<std::uint32_t>{0x190, 0x191}));
  EXPECT_NEAR(last<can::CellVoltages2>()->cell8, 3.208, 1e-4);
  EXPECT_NEAR(last<can::PackElectrical>()->voltage, 25.636, 1e-3);
  EXPECT_EQ(last<can::CellExtremes>()->highest_cell, 8U);
}

TEST_F(PackSizes, OfFifteenCellsSendsTheSixteenthAsNotKnown) {
  EXPECT_EQ(of_cells(send_sample<15>()), (std::set<std::uint32_t>{0x190, 0x191, 0x192, 0x193}));
  EXPECT_NEAR(last<can::CellVoltages4>()->cell15, 3.215, 1e-4);
  EXPECT_TRUE(std::isnan(last<can::CellVoltages4>()->cell16));
  EXPECT_NEAR(last<can::PackElectrical>()->voltage, 48.12, 1e-3);
}

TEST_F(PackSizes, OfTwentyFourCellsSendsAllCellsAndAVoltageAbove65V) {
  EXPECT_EQ(of_cells(send_sample<24>()), (std::set<std::uint32_t>{0x190, 0x191, 0x192, 0x193, 0x1AC, 0x1AD, 0x1AE}));
  EXPECT_NEAR(last<can::CellVoltages5>()->cell17, 3.217, 1e-4);
  EXPECT_NEAR(last<can::CellVoltages6>()->cell24, 3.224, 1e-4);
  EXPECT_NEAR(last<can::PackVoltage>()->voltage, 77.1, 0.0051);
  EXPECT_TRUE(std::isnan(last<can::PackElectrical>()->voltage)) << "its signal ends at 65.5 V";
  EXPECT_EQ(last<can::CellExtremes>()->highest_cell, 24U);
}

TEST_F(PackSizes, OfTwentyFiveCellsSendsTheLastInAMessageOfItsOwn) {
  EXPECT_EQ(of_cells(send_sample<25>()),
            (std::set<std::uint32_t>{0x190, 0x191, 0x192, 0x193, 0x1AC, 0x1AD, 0x1AE, 0x1BB}));
  EXPECT_NEAR(last<can::CellVoltages7>()->cell25, 3.225, 1e-4);
  EXPECT_TRUE(std::isnan(last<can::CellVoltages7>()->cell26));
  EXPECT_EQ(last<can::CellExtremes>()->highest_cell, 25U);
  EXPECT_EQ(last<can::CellExtremes>()->lowest_cell, 1U);
}

/// The signals of CellExtremes have no number for cells 31 and 32, but their voltages.
TEST_F(PackSizes, OfThirtyTwoCellsSendsAllCells) {
  EXPECT_EQ(of_cells(send_sample<32>()),
            (std::set<std::uint32_t>{0x190, 0x191, 0x192, 0x193, 0x1AC, 0x1AD, 0x1AE, 0x1BB, 0x1BC}));
  EXPECT_NEAR(last<can::CellVoltages8>()->cell29, 3.229, 1e-4);
  EXPECT_NEAR(last<can::CellVoltages8>()->cell32, 3.232, 1e-4);
  EXPECT_NEAR(last<can::PackVoltage>()->voltage, 102.928, 0.0051);
  EXPECT_EQ(last<can::CellExtremes>()->highest_cell, can::CellExtremes::highest_cell_layout.invalid);
  EXPECT_NEAR(last<can::CellExtremes>()->highest_voltage, 3.232, 1e-3);
  EXPECT_NEAR(last<can::CellExtremes>()->lowest_voltage, 3.201, 1e-3);
  EXPECT_EQ(last<can::CellExtremes>()->lowest_cell, 1U);
}

}  // namespace
}  // namespace bms::firmware
