// Flash for data: a few sectors that are erased as a whole.
//
//   erase     sets every bit of one sector
//   program   clears bits of one word; a word is programmed once between two erases, or again with the same value or
//             with 0
//   read      any bytes
//
// A loss of power while a word is programmed may clear any of its bits; while a sector is erased it leaves undefined
// content. Bits that were being changed may read differently each time. Erase and program do not verify; a caller that
// needs it reads the content back.
//
// Time: a word 16 us (at most 100), an erase of 16 KiB 250 ms (at most 500; STM32F405 datasheet DS8626, "Flash memory
// programming", x32). The chip has one bank: a core that runs from flash stops meanwhile, including its interrupts, and
// SysTick loses that time.
//
// Back ends: stm32f4/ (sectors reserved in the board's memory.ld), emulated/ (a file through the debugger, or RAM),
// absent/ (none).
#pragma once

#include <cstdint>
#include <span>

namespace bms::hal {

struct FlashSize {
  std::uint32_t sectors = 0;  ///< 0: no flash for data
  std::uint32_t sector_bytes = 0;
};

/// Call before the other functions.
FlashSize flash_start();

/// Returns false if the chip reports an error or does not finish; the content is then undefined.
bool flash_erase(std::uint32_t sector);

/// at: bytes from the beginning of the sector, a multiple of 4. Returns false as flash_erase() does.
bool flash_program(std::uint32_t sector, std::uint32_t at, std::uint32_t word);

/// Reads within one sector. at: bytes from its beginning.
void flash_read(std::uint32_t sector, std::uint32_t at, std::span<std::uint8_t> into);

}  // namespace bms::hal
