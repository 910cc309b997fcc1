// What the firmware of the forklift board restores after a loss of power, on this machine: state of charge, cells,
// service faults, corrections.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/firmware/host_board.hpp"
#include "tests/starting_point.hpp"

namespace bms::firmware {
namespace {

using host_hal::last;

class StoredStateTest : public ::testing::Test {
 protected:
  void SetUp() override { host_hal::begin(); }
  void TearDown() override { host_hal::begin(); }

  /// The next sample, a second later: 2 A discharge; the fifth of sixteen cells is 30 mV above the others.
  Input second() {
    ++seconds_;
    Input in;
    in.pack.time_us = 1'000'000ULL * seconds_;
    in.pack.current_ua = -2'000'000 + static_cast<std::int32_t>(10'000 * (seconds_ % 3));
    in.pack.cell_uv.fill(3'240'000 + static_cast<std::int32_t>(500 * (seconds_ % 2)));
    in.pack.cell_uv[4] += 30'000;
    in.pack.pack_uv = 16 * in.pack.cell_uv[0] + 30'000;
    in.pack.temperature_cdegc.fill(2'500);
    return in;
  }
  void run(HostBoard& board, int count) {
    for (int k = 0; k < count; ++k) board.process_sample(second());
  }
  void send_command(HostBoard& board, std::uint32_t code, std::uint32_t argument) {
    can::Command command;
    command.code = code;
    command.argument = argument;
    Input in = second();
    in.command = command.frame(counter_ = can::next(counter_));
    board.process_sample(in);
  }

  const std::vector<std::uint8_t> new_chip =
      std::vector<std::uint8_t>(HostBoard::sectors * HostBoard::sector_bytes, 0xFF);
  const measurement::StartingPoint start = starting_at(0.6, 0.02);

 private:
  unsigned seconds_ = 0;
  std::uint8_t counter_ = 0;
};

TEST_F(StoredStateTest, ARunContinuesFromTheEndOfThePreviousOne) {
  std::vector<std::uint8_t> kept;
  can::PackState before;
  can::CellExtremes cells;
  {
    HostBoard board(new_chip, start);
    run(board, 600);
    before = last<can::PackState>().value();
    cells = last<can::CellExtremes>().value();
    ASSERT_GT(cells.soc_spread, 1.0F) << "30 mV are a few percent";
    board.shut_down();
    kept = board.flash();
  }
  host_hal::cause = hal::ResetCause::pin;  // takes no time
  HostBoard board(kept);
  run(board, 1);
  EXPECT_EQ(last<can::StartingSoc>()->given, can::StartingSoc::given_yes);
  EXPECT_NEAR(last<can::PackState>()->soc, before.soc, 0.1F);
  EXPECT_GE(last<can::PackState>()->soc_sigma, before.soc_sigma);
  EXPECT_LT(last<can::PackState>()->soc_sigma, before.soc_sigma + 0.5F);
  EXPECT_NEAR(last<can::CellExtremes>()->soc_spread, cells.soc_spread, 0.3F)
      << "the difference of each cell is restored to 0.001 %";
  EXPECT_NEAR(board.persistence().charge().operating_s, 600, 1);
}

TEST_F(StoredStateTest, DataOfAnotherCellFileAreNotUsedAndFaultsMustBeCleared) {
  std::vector<std::uint8_t> kept;
  {
    HostBoard board(new_chip, start);
    run(board, 300);
    board.shut_down();
    kept = board.flash();
  }
  {  // as if the previous image had another cell file
    FlashModel flash({HostBoard::sectors, HostBoard::sector_bytes}, 2);
    fill(flash, kept);
    plug_in(&flash);
    storage::Persistence persistence;
    persistence.start(hal::ResetCause::power_on, std::nullopt, std::nullopt);
    ASSERT_TRUE(persistence.set(cell_file_key, 0x12345678));
    kept = bytes_of(flash);
  }
  HostBoard board(kept);
  run(board, 2);
  EXPECT_EQ(last<can::StartingSoc>()->given, can::StartingSoc::given_no);
  EXPECT_EQ(last<can::Faults>()->internal_fault, 1U) << "until it is cleared";
  EXPECT_EQ(static_cast<std::uint32_t>(board.persistence().settings().get(cell_file_key).value()), 0x12345678U);
  send_command(board, can::Command::code_clear_faults, 1);
  run(board, 2);
  EXPECT_EQ(static_cast<std::uint32_t>(board.persistence().settings().get(cell_file_key).value()),
            host_hal::table9().hash);
  EXPECT_EQ(last<can::Faults>()->internal_fault, 0U);
}

TEST_F(StoredStateTest, AShortCircuitStaysUntilAWorkshopClearsIt) {
  std::vector<std::uint8_t> kept;
  {
    HostBoard board(new_chip, start);
    run(board, 5);
    Input in = second();
    in.pack.current_ua = -60'000'000;
    board.process_sample(in);
    EXPECT_EQ(last<can::Faults>()->short_circuit, 1U);
    kept = board.flash();  // the power is lost at once
  }
  HostBoard board(kept, start);
  run(board, 20);
  EXPECT_EQ(last<can::Faults>()->short_circuit, 1U);
  send_command(board, can::Command::code_clear_faults, 0);
  run(board, 2);
  EXPECT_EQ(last<can::Faults>()->short_circuit, 1U) << "a driver cannot clear it";
  send_command(board, can::Command::code_clear_faults, 1);
  run(board, 2);
  EXPECT_EQ(last<can::Faults>()->short_circuit, 0U);
}

TEST_F(StoredStateTest, ACorrectionIsAppliedAtOnceAndStored) {
  std::vector<std::uint8_t> kept;
  {
    HostBoard board(new_chip, start);
    run(board, 2);
    send_command(board, can::Command::code_voltage_offset, static_cast<std::uint32_t>(-1'500));
    EXPECT_EQ(host_hal::calibrated.voltage_offset_uv, -1'500);
    kept = board.flash();
  }
  HostBoard board(kept, start);
  EXPECT_EQ(stored_calibration(board.persistence()).voltage_offset_uv, -1'500);
  EXPECT_EQ(stored_calibration(board.persistence()).current_gain_ppm, 0);
}

/// Another firmware has left so many settings that there is room for one more key: the hash of the cell file.
TEST_F(StoredStateTest, ASettingWithoutRoomIsAStorageFault) {
  std::vector<std::uint8_t> kept;
  {
    FlashModel flash({HostBoard::sectors, HostBoard::sector_bytes}, 2);
    plug_in(&flash);
    storage::Persistence persistence;
    persistence.start(hal::ResetCause::power_on, std::nullopt, std::nullopt);
    std::uint16_t key = 1'000;
    for (std::size_t k = 1; k < storage::SettingsRecord::max_settings; ++k) ASSERT_TRUE(persistence.set(key++, 1));
    kept = bytes_of(flash);
  }
  HostBoard board(kept, start);
  run(board, 2);
  EXPECT_EQ(last<can::Faults>()->storage_fault, 0U);
  send_command(board, can::Command::code_voltage_offset, 1'000);
  run(board, 2);
  EXPECT_EQ(last<can::Faults>()->storage_fault, 1U) << "the correction is lost at the next start";
}

TEST_F(StoredStateTest, ValuesOutOfRangeAreStoredClamped) {
  EXPECT_NEAR(scaled_to_integer(0.9234567F, 1e6F), 923'457, 1);
  EXPECT_EQ(scaled_to_integer(-5e3F, 1e6F), -2'147'000'000);
  EXPECT_EQ(scaled_to_integer(5e3F, 1e6F), 2'147'000'000);
  EXPECT_EQ(scaled_to_integer(INFINITY, 1e6F), 2'147'000'000);
  EXPECT_EQ(scaled_to_integer(-INFINITY, 1e6F), -2'147'000'000);
  EXPECT_EQ(scaled_to_integer(NAN, 1e6F), 0);
}

}  // namespace
}  // namespace bms::firmware
