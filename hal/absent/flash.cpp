// No flash for data: nothing is stored.
#include "hal/flash.hpp"

namespace bms::hal {

FlashSize flash_start() { return {}; }
bool flash_erase(std::uint32_t) { return false; }
bool flash_program(std::uint32_t, std::uint32_t, std::uint32_t) { return false; }
void flash_read(std::uint32_t, std::uint32_t, std::span<std::uint8_t>) {}

}  // namespace bms::hal
