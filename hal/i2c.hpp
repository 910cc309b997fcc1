// One I2C bus: single master, 400 kHz, 7-bit addresses.
//
// Every call returns within a bounded time, whatever the other devices do with the two wires: i2c_transfer() within
// i2c_time_us(), i2c_recover() within 1 ms. Back ends: stm32f4/i2c (I2C1), absent/i2c (no device acknowledges). A test
// links a model of the devices on the bus.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace bms::hal {

enum class I2cResult : std::uint8_t {
  done,
  no_acknowledge,  ///< the address or a written byte was not acknowledged; the bus is free
  bus_stuck,       ///< a wire is low before the start, or another device drives it: call i2c_recover()
  timed_out,       ///< a device stretched the clock for too long: call i2c_recover()
};

/// Configures the pins and the controller. Call once, before the first transfer.
void i2c_start();

/// Sends start, address and `out`; if `in` is not empty, a repeated start, the address, and reads `in`; then stop.
/// At least one of the two is not empty. Unless the result is `done`, the content of `in` is undefined.
I2cResult i2c_transfer(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in);

/// Sends up to nine clocks, until the device that holds the data wire low has shifted out its byte, and a stop
/// (UM10204, 3.1.16). Returns true if both wires are high.
bool i2c_recover();

/// Time limit of a transfer of `bytes` bytes [us]: five times its duration, and 2 ms for clock stretching.
constexpr std::uint32_t i2c_time_us(std::size_t bytes) {
  return 2'000 + 5 * 9 * 5 / 2 * static_cast<std::uint32_t>(bytes + 2);
}

}  // namespace bms::hal
