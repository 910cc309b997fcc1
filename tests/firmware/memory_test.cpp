// What the firmware of the forklift board restores after a loss of power, on this machine: state of charge, cells,
// service faults, corrections.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/firmware/stored_state_fixture.hpp"

namespace bms::firmware {
namespace {

using host_hal::last;

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
  EXPECT_EQ(static_cast<std::uint32_t>(board.persistence().settings().get(cell_file_key).value()), host_hal::cell_hash);
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
  EXPECT_EQ(host_hal::second_line_cleared, 0);
  send_command(board, can::Command::code_clear_faults, 1);
  run(board, 2);
  EXPECT_EQ(last<can::Faults>()->short_circuit, 0U);
  EXPECT_EQ(host_hal::second_line_cleared, 1) << "the front end's latch ends with the fault";
}

TEST_F(StoredStateTest, AFailedSecondLineStaysUntilAWorkshopClearsIt) {
  std::vector<std::uint8_t> kept;
  {
    HostBoard board(new_chip, start);
    run(board, 5);
    host_hal::second_line = hal::permanent_failure;
    run(board, 2);
    EXPECT_EQ(last<can::MoreFaults>()->second_line_failed, 1U);
    kept = board.flash();
    host_hal::second_line = 0;
  }
  HostBoard board(kept, start);
  run(board, 20);
  EXPECT_EQ(last<can::MoreFaults>()->second_line_failed, 1U);
  EXPECT_EQ(last<can::Faults>()->short_circuit, 0U);
  const auto& last_faults = board.persistence().events().fault;
  EXPECT_TRUE(std::any_of(last_faults.begin(), last_faults.end(), [](const auto& f) { return f.code == 34; }));
  send_command(board, can::Command::code_clear_faults, 1);
  run(board, 2);
  EXPECT_EQ(last<can::MoreFaults>()->second_line_failed, 0U);
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
    for (std::size_t k = 1; k < storage::SettingsRecord::max_settings; ++k)
      ASSERT_TRUE(persistence.set(key++, 1, storage::Urgency::safety));
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
