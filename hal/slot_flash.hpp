// Flash for two images of the application and two sets of cell constants, and eight one-time words for each of both
// (firmware/boot/slot_flash.hpp says what for).
//
// Time: a word 16 us (at most 100); an erase of a slot 2 s (at most 4; STM32F405 datasheet DS8626, x32). The chip has
// one bank: a core that runs from flash stops meanwhile, including its interrupts. So only the boot loader erases,
// before the application runs.
//
// Back ends: stm32f4/slot_flash (sectors 5 to 10, one-time programmable memory), emulated/slot_flash (a file, or none).
#pragma once

#include <cstdint>
#include <span>

namespace bms::hal {

/// Slots 0 and 1 are those of the application, 2 and 3 those of cell constants.
inline constexpr std::uint32_t slot_flash_bytes = 256 * 1024, cell_slot_flash_bytes = 128 * 1024;
inline constexpr std::uint8_t first_cell_slot = 2;

/// From the begin of slot 0.
constexpr std::uint32_t slot_flash_at(std::uint8_t slot) {
  return slot < first_cell_slot ? slot * slot_flash_bytes
                                : first_cell_slot * slot_flash_bytes + (slot - first_cell_slot) * cell_slot_flash_bytes;
}
inline constexpr std::uint32_t all_slots_bytes = slot_flash_at(4);

/// Each returns false if the chip reports an error or does not finish; the content is then undefined.
bool slot_erase(std::uint8_t slot);
/// at: a multiple of 4. A word is programmed once, or again with the same value or with 0.
bool slot_program(std::uint8_t slot, std::uint32_t at, std::uint32_t word);
void slot_read(std::uint8_t slot, std::uint32_t at, std::span<std::uint8_t> into);

/// Words whose bits can be cleared and never set again. word: 0 to 7 for the application, 8 to 15 for cell constants.
std::uint32_t one_time_word(std::uint32_t word);
bool program_one_time_word(std::uint32_t word, std::uint32_t value);

}  // namespace bms::hal
