// Flash for data: a few sectors that are erased as a whole.
//
//   erase     sets every bit of one sector
//   program   clears bits of one word; a word is programmed once between two erases, or again with the same value or
//   with 0 read      any bytes
//
// A loss of power while a word is programmed leaves any of its bits cleared, one while a sector is erased leaves
// anything in it; bits that were on their way may read differently each time. Neither call checks what was written: who
// needs that reads it back.
//
// Time: a word 16 us (100 at most), an erase of 16 KiB 250 ms (500 at most; STM32F405 datasheet DS8626, "Flash memory
// programming", x32). The chip has one bank: a core that runs from flash stands still meanwhile, interrupts too, and
// SysTick loses what it would have counted.
//
// Back ends: stm32f4/ (sectors set aside in the board's memory.ld), emulated/ (a file through the debugger, or RAM),
// absent/ (none).
#pragma once

#include <cstdint>
#include <span>

namespace bms::hal {

struct FlashSize {
  std::uint32_t sectors = 0;  ///< 0: there is no flash for data
  std::uint32_t sector_bytes = 0;
};

/// Before any other call.
FlashSize flash_start();

/// False when the chip reports an error or does not get ready; the content is anything then.
bool flash_erase(std::uint32_t sector);

/// at: bytes from the sector's beginning, a multiple of 4. False as above.
bool flash_program(std::uint32_t sector, std::uint32_t at, std::uint32_t word);

/// Inside one sector.
void flash_read(std::uint32_t sector, std::uint32_t at, std::span<std::uint8_t> into);

}  // namespace bms::hal
