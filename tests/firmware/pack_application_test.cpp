// The application with a pack of sixteen cells, on this machine: its messages, contactors and faults.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "tests/firmware/application_fixture.hpp"

namespace bms::firmware {
namespace {

class PackTest : public PackWith<WithoutVehicleProfile> {};

TEST_F(PackTest, PublishesEachCellTheExtremesAndTheTemperatures) {
  reading.cell_uv[4] = 3'291'000;
  reading.cell_uv[9] = 3'201'000;
  reading.cell_uv[15] = measurement::no_reading;
  second();
  EXPECT_NEAR(last<can::CellVoltages2>().value().cell5, 3.291, 1e-3);
  EXPECT_NEAR(last<can::CellVoltages3>().value().cell10, 3.201, 1e-3);
  EXPECT_TRUE(std::isnan(last<can::CellVoltages4>().value().cell16));
  const auto extremes = last<can::CellExtremes>().value();
  EXPECT_EQ(extremes.highest_cell, 5U);
  EXPECT_EQ(extremes.lowest_cell, 10U);
  EXPECT_NEAR(extremes.highest_voltage - extremes.lowest_voltage, 0.09, 2e-3);
  EXPECT_NEAR(last<can::Temperatures>().value().temperature3, 24.9, 0.06);
}

TEST_F(PackTest, ClosesOnRequestAndOpensWhenTheRequestExpires) {
  second();
  EXPECT_EQ(last<can::ContactorState>().value().state, can::ContactorState::state_off);
  std::uint8_t counter = 0;
  for (int k = 0; k < 20 && !driving(); ++k) {
    send_command(can::Command::code_request, 1, counter = can::next(counter));
    second();
  }
  ASSERT_TRUE(driving());
  EXPECT_EQ(last<can::ContactorState>().value().state, can::ContactorState::state_drive);
  EXPECT_EQ(last<can::Faults>().value().first_cause, 0U);
  for (int k = 0; k < 4; ++k) second();
  EXPECT_TRUE(driving()) << "a request lasts five seconds";
  EXPECT_GT(last<can::AllowedCurrent>().value().discharge, 1);
  for (int k = 0; k < 4; ++k) second();
  EXPECT_FALSE(driving()) << "the request was not repeated";
  EXPECT_EQ(last<can::AllowedCurrent>().value().discharge, 0);
}

TEST_F(PackTest, AfterAWatchdogResetNothingClosesBeforeFaultsAreCleared) {
  cause = hal::ResetCause::watchdog;
  std::uint8_t counter = 0;
  for (int k = 0; k < 20; ++k) {
    send_command(can::Command::code_request, 1, counter = can::next(counter));
    second();
  }
  EXPECT_FALSE(driving());
  EXPECT_EQ(last<can::Faults>().value().internal_fault, 1U);
}

TEST_F(PackTest, ATripOfTheFrontEndOpensAndIsPublishedAtOnceWithItsCause) {
  std::uint8_t counter = 0;
  for (int k = 0; k < 20 && !driving(); ++k) {
    send_command(can::Command::code_request, 1, counter = can::next(counter));
    second();
  }
  ASSERT_TRUE(driving());
  EXPECT_EQ(last<can::MoreFaults>()->second_line_tripped, 0U);
  host_hal::second_line = hal::cell_overvoltage;
  front_end = {hal::FrontEndState::measuring, 3, 300, 70'000};
  second();
  EXPECT_FALSE(driving());
  EXPECT_EQ(last<can::MoreFaults>()->second_line_tripped, 1U);
  EXPECT_EQ(last<can::MoreFaults>()->allowed_current_exceeded, 0U);
  EXPECT_EQ(last<can::Faults>()->first_cause, 33U);
  const auto chip = last<can::FrontEnd>().value();
  EXPECT_EQ(chip.cell_overvoltage, 1U);
  EXPECT_EQ(chip.cell_undervoltage + chip.short_circuit + chip.pins_wrong, 0U);
  EXPECT_EQ(chip.state, can::FrontEnd::state_measuring);
  EXPECT_EQ(chip.lost, 3U);
  EXPECT_EQ(chip.resets, 255U) << "saturated";
  EXPECT_EQ(chip.crc_errors, 65'535U);
}

TEST_F(PackTest, ADipOfTheSupplyBetweenTwoSamplesOpensUntilTheNextKeyOn) {
  std::uint8_t counter = 0;
  const auto request_s = [&](int seconds) {
    for (int k = 0; k < seconds; ++k) {
      send_command(can::Command::code_request, 1, counter = can::next(counter));
      second();
    }
  };
  request_s(20);
  ASSERT_TRUE(driving());
  host_hal::supply_falls = 3;
  second();
  EXPECT_EQ(host_hal::supply_acknowledged, 3U);
  EXPECT_FALSE(host_hal::switched.main_plus || host_hal::switched.main_minus || host_hal::switched.precharge);
  EXPECT_EQ(last<can::MoreFaults>()->supply_dip, 1U);
  EXPECT_EQ(last<can::Faults>()->first_cause, can::Faults::first_cause_supply_dip);
  EXPECT_EQ(last<can::Faults>()->internal_fault, 0U);
  request_s(10);
  EXPECT_FALSE(driving());
  for (int k = 0; k < 7; ++k) second();  // the request must expire before a new one counts
  request_s(20);
  EXPECT_TRUE(driving());
}

/// While the condition lasts, no request closes a contactor and no command clears the fault.
TEST_F(PackTest, AnUnfitBoardClosesNothing) {
  const auto drive_s = [&](int seconds) {
    std::uint8_t counter = 0;
    for (int k = 0; k < seconds; ++k) {
      send_command(can::Command::code_request, 1, counter = can::next(counter));
      second();
    }
  };
  for (const auto condition : {&hal::BoardState::ram_failed, &hal::BoardState::image_failed,
                               &hal::BoardState::stack_overrun, &hal::BoardState::clock_failed}) {
    host_hal::board_state = {};
    host_hal::board_state.*condition = true;
    drive_s(5);
    send_command(can::Command::code_clear_faults, 0, 14);
    drive_s(15);
    EXPECT_FALSE(driving());
    EXPECT_EQ(last<can::Faults>()->internal_fault, 1U);
  }
  host_hal::board_state = {};
  send_command(can::Command::code_clear_faults, 0, 13);
  for (int k = 0; k < 7; ++k) second();  // the request must expire before a new one counts
  drive_s(20);
  EXPECT_TRUE(driving()) << "the condition has ended and the fault was cleared";
}

TEST_F(PackTest, AfterAProcessorFaultNothingClosesBeforeFaultsAreCleared) {
  fault = hal::FaultRecord{.exception = 3};
  std::uint8_t counter = 0;
  for (int k = 0; k < 20; ++k) {
    send_command(can::Command::code_request, 1, counter = can::next(counter));
    second();
  }
  EXPECT_FALSE(driving());
  EXPECT_EQ(last<can::Faults>()->internal_fault, 1U);
}

/// Data stored with another cell file are not used, and nothing closes until clearing the faults confirms the new file.
TEST_F(PackTest, AnotherCellFileIsReportedAndAcceptedOnlyWhenFaultsAreCleared) {
  const auto unit = [&](std::uint32_t hash) {
    return std::make_unique<Application<Board<16>>>(std::nullopt, messages::Identity{hash, 0}, 6.F, persistence);
  };
  EXPECT_FALSE(stored_for_another_cell_file(persistence, 0xCE110001));
  EXPECT_TRUE(stored_for_another_cell_file(persistence, 0xCE110002));
  EXPECT_FALSE(stored_starting_point(persistence, 0xCE110002));
  const auto changed = unit(0xCE110002);
  reading.time_us += 1'000'000;
  changed->process_sample(reading);
  EXPECT_EQ(last<can::Board>()->cell_file_changed, 1U);
  EXPECT_EQ(last<can::Faults>()->internal_fault, 1U);
  EXPECT_TRUE(stored_for_another_cell_file(persistence, 0xCE110002)) << "not yet";
  send_command(can::Command::code_clear_faults, 0, 3);
  for (int k = 0; k < 3; ++k) {
    reading.time_us += 1'000'000;
    changed->process_sample(reading);
  }
  EXPECT_EQ(last<can::Board>()->cell_file_changed, 0U);
  EXPECT_EQ(last<can::Faults>()->internal_fault, 0U);
  EXPECT_FALSE(stored_for_another_cell_file(persistence, 0xCE110002));
  EXPECT_TRUE(stored_for_another_cell_file(persistence, 0xCE110001));
}

TEST_F(PackTest, ASevereFaultOpensAndIsPublishedAtOnceWithItsCause) {
  std::uint8_t counter = 0;
  const auto drive = [&] {
    send_command(can::Command::code_request, 1, counter = can::next(counter));
    second();
  };
  for (int k = 0; k < 20 && !driving(); ++k) drive();
  ASSERT_TRUE(driving());
  reading.cell_uv[7] = 4'000'000;
  drive();
  drive();
  EXPECT_FALSE(driving());
  EXPECT_EQ(last<can::Faults>().value().cell_overvoltage_severe, 1U);
  EXPECT_EQ(last<can::Faults>().value().first_cause,
            1U + static_cast<unsigned>(protection::Fault::cell_overvoltage_severe));
  reading.cell_uv[7] = 3'300'000;
  for (int k = 0; k < 20; ++k) drive();
  EXPECT_EQ(last<can::Faults>().value().cell_overvoltage_severe, 1U) << "it is latched";
  send_command(can::Command::code_clear_faults, 0, counter = can::next(counter));
  drive();
  drive();
  EXPECT_EQ(last<can::Faults>().value().cell_overvoltage_severe, 0U);
}

}  // namespace
}  // namespace bms::firmware
