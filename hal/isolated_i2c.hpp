// The second I2C bus of a board, behind an isolator: the same master as hal/i2c.hpp on another controller, with the
// same results and time limits. Without the supply of the isolator's far side both wires are high here and nothing
// answers. Back end: stm32f4/i2c (I2C2). A test links a model of the devices on both buses.
#pragma once

#include "hal/i2c.hpp"

namespace bms::hal {

/// As i2c_start().
void isolated_i2c_start();
/// As i2c_transfer().
I2cResult isolated_i2c_transfer(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in);
/// As i2c_recover().
bool isolated_i2c_recover();

}  // namespace bms::hal
