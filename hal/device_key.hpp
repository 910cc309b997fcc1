// The secret of this unit, from which the keys of its trucks and workshops follow (firmware/authentication/codes.hpp).
// The production line writes it once. Back ends: stm32f4/device_key (one-time programmable memory), absent/ (a chip
// without a place for it, or an emulator).
#pragma once

#include <array>
#include <cstdint>
#include <optional>

namespace bms::hal {

/// Nothing if none was written or its check is wrong.
std::optional<std::array<std::uint8_t, 16>> device_key();

/// Returns true if this image was built for development (BMS_PRODUCTION off). Only such an image works without a key.
/// Back ends: image_kind/development, image_kind/product.
bool development_image();

}  // namespace bms::hal
