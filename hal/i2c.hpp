// One I2C bus, this side its only master, 400 kHz, 7-bit addresses.
//
// Every call comes back within a bounded time, whatever the other side does with the two wires: i2c_time_us() at most,
// i2c_recover() 1 ms. Back ends: stm32f4/i2c (I2C1), absent/i2c (nobody acknowledges); a test brings a model of what
// hangs on the bus.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace bms::hal {

enum class I2cResult : std::uint8_t {
  done,
  no_acknowledge,  ///< of the address or of a byte that was written; the bus is free again
  bus_stuck,       ///< a wire is held low before the start, or somebody else drives it: i2c_recover()
  timed_out,       ///< a clock that is stretched for too long: i2c_recover()
};

void i2c_start();

/// Start, address, `out`; if `in` is not empty a repeated start, address, `in`; stop. One of both is not empty. `in` is
/// whole or of no use.
I2cResult i2c_transfer(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in);

/// Up to nine clocks, until whoever holds the data wire low has got rid of its byte, and a stop (UM10204, 3.1.16). True
/// when both wires are high.
bool i2c_recover();

/// The longest that a transfer of so many bytes may take: five times what it needs, and 2 ms of stretched clock.
constexpr std::uint32_t i2c_time_us(std::size_t bytes) {
  return 2'000 + 5 * 9 * 5 / 2 * static_cast<std::uint32_t>(bytes + 2);
}

}  // namespace bms::hal
