// Where a front end is connected. A pack of more cells than a chip has inputs has two chips, which answer to the same
// address: the lower one is on I2C, the upper one behind the isolator. With one chip the bus takes no memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "board_config.hpp"  // generated from boards/<board>/board.cmake
#include "hal/bq76952/configuration.hpp"
#include "hal/i2c.hpp"
#include "hal/isolated_i2c.hpp"

namespace bms::hal::bq76952 {

inline constexpr bool stacked = pack_cells > cell_inputs;

struct OnlyBus {
  static I2cResult transfer(std::uint8_t address, const std::span<const std::uint8_t>& out,
                            const std::span<std::uint8_t>& in) {
    return i2c_transfer(address, out, in);
  }
  static bool recover() { return i2c_recover(); }
};

struct OneOfTwoBuses {
  bool isolated = false;

  I2cResult transfer(std::uint8_t address, const std::span<const std::uint8_t>& out,
                     const std::span<std::uint8_t>& in) const {
    return isolated ? isolated_i2c_transfer(address, out, in) : i2c_transfer(address, out, in);
  }
  bool recover() const { return isolated ? isolated_i2c_recover() : i2c_recover(); }
};

using Bus = std::conditional_t<stacked, OneOfTwoBuses, OnlyBus>;

}  // namespace bms::hal::bq76952
