// A frame of classic CAN (ISO 11898-1), as the drivers send it and the codec packs it.
#pragma once

#include <array>
#include <cstdint>

namespace bms::can {

struct Frame {
  std::uint32_t id = 0;     ///< 11 bits, or 29 bits if long_id
  std::uint8_t length = 0;  ///< bytes of `data` in use, 0..8
  std::array<std::uint8_t, 8> data{};
  bool long_id = false;  ///< extended identifier
};

}  // namespace bms::can
