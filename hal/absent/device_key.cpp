// No place for a key.
#include "hal/device_key.hpp"

#include "board_config.hpp"  // generated from boards/<board>/board.cmake and the build options

namespace bms::hal {

std::optional<std::array<std::uint8_t, 16>> device_key() { return std::nullopt; }
bool development_image() { return development; }

}  // namespace bms::hal
