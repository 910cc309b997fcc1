// What the battery has learned of its capacity and resistance, over losses of power.
#include <cmath>

#include <gtest/gtest.h>

#include "tests/firmware/stored_state_fixture.hpp"

namespace bms::firmware {
namespace {

using host_hal::last;

class StoredHealthTest : public StoredStateTest {
 protected:
  /// A chip with such a record, written by an earlier run.
  static std::vector<std::uint8_t> chip_with(const storage::HealthRecord& health) {
    FlashModel flash({HostBoard::sectors, HostBoard::sector_bytes}, 1);
    plug_in(&flash);
    storage::Persistence p;
    p.start(hal::ResetCause::power_on, std::nullopt, std::nullopt);
    storage::EstimatorSnapshot now;
    now.health = health;
    p.power_failing(now, std::nullopt);
    plug_in(nullptr);
    return bytes_of(flash);
  }
  /// Runs the board for two seconds after the power was off, and switches it off.
  std::vector<std::uint8_t> day(const std::vector<std::uint8_t>& chip) {
    HostBoard board(chip, start);
    run(board, 2);
    board.shut_down();
    return board.flash();
  }
  static constexpr storage::HealthRecord worn{820'000, 12'000, 1'340'000, 25'000};
};

TEST_F(StoredHealthTest, AWornBatteryIsWornOnEveryDay) {
  auto chip = chip_with(worn);
  for (int k = 0; k < 3; ++k) {
    chip = day(chip);
    const auto health = last<can::Health>().value();
    EXPECT_NEAR(health.capacity, 82, 0.05) << "day " << k;
    EXPECT_NEAR(health.capacity_sigma, 1.2, 0.05);
    EXPECT_NEAR(health.resistance, 134, 0.3);
    EXPECT_NEAR(health.resistance_sigma, 2.5, 0.2);
  }
}

TEST_F(StoredHealthTest, TheReplayOfALogBeginsWithTheBitsOfTheFirmware) {
  for (const storage::HealthRecord stored :
       {storage::HealthRecord{823'456, 12'345, 1'000'000, 50'000}, {1'049'987, 3'049, 1'000'000, 50'000}}) {
    day(chip_with(stored));
    const auto sent = last<can::Health>().value();
    estimator::SocEstimator<float> firmware, replay;
    firmware.restore_capacity({stored.capacity_ppm, stored.capacity_sigma_ppm});
    replay.restore_capacity({static_cast<std::int32_t>(std::lround(1e4F * sent.capacity)),
                             static_cast<std::int32_t>(std::lround(1e4F * sent.capacity_sigma))});
    EXPECT_EQ(replay.capacity().ratio(), firmware.capacity().ratio());
    EXPECT_EQ(replay.capacity().variance(), firmware.capacity().variance());
    EXPECT_EQ(replay.counted_capacity_ppm(), firmware.counted_capacity_ppm());
    EXPECT_NEAR(1e-6 * firmware.counted_capacity_ppm(), 1e-6 * stored.capacity_ppm, 2.6e-4);
  }
}

TEST_F(StoredHealthTest, WhatNoMeasurementCanHaveGivenIsIgnored) {
  for (const storage::HealthRecord impossible : {storage::HealthRecord{},
                                                 {-1, 12'000, 1'340'000, 25'000},
                                                 {820'000, 0, 1'340'000, 25'000},
                                                 {820'000, 12'000, 9'000'000, 25'000},
                                                 {820'000, 12'000, 1'340'000, 2'000'000'000}}) {
    day(chip_with(impossible));
    const auto health = last<can::Health>().value();
    EXPECT_NEAR(health.capacity, 100, 0.05);
    EXPECT_NEAR(health.capacity_sigma, 10, 0.1);
  }
}

TEST_F(StoredHealthTest, OfAnotherCellFileIsNotUsed) {
  auto chip = day(chip_with(worn));
  {
    HostBoard board(chip, start);
    run(board, 1);
  }
  EXPECT_NEAR(last<can::Health>()->capacity, 82, 0.05);
  host_hal::cell_hash ^= 1;
  day(chip);
  host_hal::cell_hash ^= 1;
  EXPECT_NEAR(last<can::Health>()->capacity, 100, 0.05);
}

}  // namespace
}  // namespace bms::firmware
