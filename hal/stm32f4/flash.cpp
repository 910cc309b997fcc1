// Data in the sectors that the linker script reserves (image_storage_begin): sectors 1 to 3, the small ones after the
// vectors.
#include "hal/flash.hpp"

#include "hal/stm32f4/flash_operation.hpp"

extern "C" {
extern const std::uint8_t image_storage_begin[], image_storage_end[];  // defined by the linker script
}

namespace bms::hal {

namespace {

constexpr std::uint32_t sector_bytes = 16 * 1024, flash_origin = 0x08000000;

/// A poll takes 5 to 10 cycles: at least 0.6 s at 168 MHz. An erase needs at most 0.5 s.
constexpr std::uint32_t erase_max_polls = 20'000'000;

std::uint32_t address(std::uint32_t sector, std::uint32_t at) {
  return reinterpret_cast<std::uint32_t>(image_storage_begin) + sector * sector_bytes + at;
}

}  // namespace

FlashSize flash_start() {
  return {static_cast<std::uint32_t>(image_storage_end - image_storage_begin) / sector_bytes, sector_bytes};
}

bool flash_erase(std::uint32_t sector) {
  return stm32f4::flash_erase_sector((address(sector, 0) - flash_origin) / sector_bytes, erase_max_polls);
}

bool flash_program(std::uint32_t sector, std::uint32_t at, std::uint32_t word) {
  return stm32f4::flash_program_word(address(sector, at), word);
}

void flash_read(std::uint32_t sector, std::uint32_t at, std::span<std::uint8_t> into) {
  const auto* from = reinterpret_cast<const volatile std::uint8_t*>(address(sector, at));
  for (std::uint8_t& byte : into) byte = *from++;
}

}  // namespace bms::hal
