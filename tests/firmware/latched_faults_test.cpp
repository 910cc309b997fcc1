// Latched faults over a loss of power, with flash that works or is worn out, and with or without a backup cell.
#include <gtest/gtest.h>

#include "tests/firmware/stored_state_fixture.hpp"

namespace bms::firmware {
namespace {

using host_hal::last;

class LatchedFaultsTest : public StoredStateTest {
 protected:
  /// Starts the board after the power was off, lets `act` work with it, and switches the power off.
  template <class Act>
  void start_and(const Act& act) {
    if (!backup_cell) host_hal::backup = {0xFFFF'FFFF, 0x1234'5678, 0, 0};  // what the registers contain at power-on
    HostBoard board(kept, start);
    if (flash_worn) board.wear_out_flash();
    run(board, 3);
    act(board);
    kept = board.flash();
  }
  void short_circuit(HostBoard& board) {
    Input in = second();
    in.pack.current_ua = -60'000'000;
    board.process_sample(in);
    run(board, 3);
    EXPECT_EQ(last<can::Faults>()->short_circuit, 1U);
  }
  static constexpr auto nothing = [](HostBoard&) {};

  std::vector<std::uint8_t> kept = new_chip;
  bool backup_cell = true, flash_worn = false;
};

TEST_F(LatchedFaultsTest, SurviveALossOfPowerWithWornOutFlash) {
  start_and(nothing);
  start_and(nothing);  // the backup supply has kept its content
  flash_worn = true;
  start_and([&](HostBoard& board) {
    short_circuit(board);
    run(board, 200);  // the log tries to erase its sectors
    EXPECT_FALSE(board.persistence().log().operational());
    EXPECT_EQ(last<can::Faults>()->internal_fault, 0U) << "the fault is kept";
    EXPECT_EQ(last<can::Faults>()->storage_fault, 1U);
  });
  for (int starts = 0; starts < 3; ++starts)
    start_and([](HostBoard&) { EXPECT_EQ(last<can::Faults>()->short_circuit, 1U); });
  start_and([&](HostBoard& board) {
    run(board, 20);
    send_command(board, can::Command::code_clear_faults, 1);
    run(board, 2);
    EXPECT_EQ(last<can::Faults>()->short_circuit, 0U);
  });
  start_and([](HostBoard&) { EXPECT_EQ(last<can::Faults>()->short_circuit, 0U) << "cleared by service"; });
}

TEST_F(LatchedFaultsTest, SurviveInFlashWithoutABackupCell) {
  backup_cell = false;
  start_and([&](HostBoard& board) {
    short_circuit(board);
    EXPECT_EQ(last<can::Faults>()->internal_fault, 0U);
  });
  start_and([](HostBoard&) { EXPECT_EQ(last<can::Faults>()->short_circuit, 1U); });
}

/// Nothing can keep the fault, so nothing may close until service has seen it.
TEST_F(LatchedFaultsTest, ThatNothingCanKeepForbidClosing) {
  flash_worn = true;
  for (const bool cell : {false, true}) {
    backup_cell = cell;
    host_hal::begin();
    kept = new_chip;
    start_and([&](HostBoard& board) {
      EXPECT_EQ(last<can::Faults>()->internal_fault, 0U);
      short_circuit(board);
      EXPECT_EQ(last<can::Faults>()->internal_fault, 1U)
          << (cell ? "a cell that was never proven, at the first start" : "no cell");
      send_command(board, can::Command::code_clear_faults, 0);
      run(board, 2);
      EXPECT_EQ(last<can::Faults>()->internal_fault, 1U);
    });
  }
}

TEST_F(LatchedFaultsTest, ABackupWithAFlippedBitIsNotUsed) {
  start_and(nothing);
  start_and(nothing);
  const auto intact = host_hal::backup;
  for (std::size_t bit = 0; bit < 32 * intact.size(); ++bit) {
    host_hal::backup = intact;
    host_hal::backup[bit / 32] ^= 1U << bit % 32;
    start_and([&](HostBoard&) { EXPECT_EQ(last<can::Faults>()->short_circuit, 0U) << bit; });
  }
}

TEST_F(LatchedFaultsTest, AreStoredInFlashAsBefore) {
  start_and([&](HostBoard& board) {
    short_circuit(board);
    EXPECT_EQ(board.persistence().settings().get(latched_faults_key).value_or(0) & 1 << 10, 1 << 10);
    EXPECT_FALSE(board.persistence().settings().get(more_latched_faults_key)) << "not needed";
  });
}

}  // namespace
}  // namespace bms::firmware
