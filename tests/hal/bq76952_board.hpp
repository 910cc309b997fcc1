// The hardware around the front end's driver in a test: the I2C bus ends at a model of the chip, time is the model's,
// CAN frames come from a list, and contactor commands go into a list.
#pragma once

#include <vector>

#include "hal/can.hpp"
#include "hal/power_path.hpp"
#include "tests/hal/bq76952_model.hpp"

namespace bms {

extern Bq76952Model* chip;                    ///< at the end of the I2C bus; set by each test
extern std::vector<can::Frame> arriving;      ///< frames that can_receive() returns
extern std::vector<hal::PowerPath> switched;  ///< arguments of contactor_pins_set()

/// The chip that the environment variable BMS_CHIP_VARIANT names, or the nominal one. An unknown name ends the program
/// with a list of the names.
ChipVariant variant_under_test();

}  // namespace bms
