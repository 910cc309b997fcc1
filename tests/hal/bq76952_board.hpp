// The hardware around the front end's driver in a test: the I2C bus ends at a model of the chip, time is the model's,
// CAN frames come from a list, and contactor commands go into a list.
#pragma once

#include <vector>

#include "hal/bq76952/configuration.hpp"
#include "hal/can.hpp"
#include "hal/power_path.hpp"
#include "tests/hal/bq76952_model.hpp"

namespace bms {

/// 16 cells LiFePO4 with a range of 327 A; all thresholds are beyond what a test without a fault reaches.
inline constexpr hal::bq76952::Board board_under_test{.overvoltage_v = 3.8,
                                                      .undervoltage_v = 2.0,
                                                      .voltage_delay_s = 1,
                                                      .overcurrent_a = 350,
                                                      .overcurrent_delay_s = 0.42,
                                                      .high_overcurrent_a = 450,
                                                      .high_overcurrent_delay_s = 0.3,
                                                      .short_circuit_a = 600,
                                                      .sustained_a = 310,
                                                      .charge_hot_c = 50,
                                                      .discharge_hot_c = 65,
                                                      .charge_cold_c = -5};

extern Bq76952Model* chip;                    ///< at the end of the I2C bus; set by each test
extern std::vector<can::Frame> arriving;      ///< frames that can_receive() returns
extern std::vector<hal::PowerPath> switched;  ///< arguments of contactor_pins_set()

extern std::vector<std::uint64_t> feeds_us;  ///< times of watchdog_feed()
/// What finish() throws.
struct RunEnded {};

/// The chip that the environment variable BMS_CHIP_VARIANT names, or the nominal one. An unknown name ends the program
/// with a list of the names.
ChipVariant variant_under_test();

}  // namespace bms
