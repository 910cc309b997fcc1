// Flash for two images of the application, and eight one-time words (firmware/boot/slot_flash.hpp says what for).
//
// Time: a word 16 us (at most 100); an erase of a slot 2 s (at most 4; STM32F405 datasheet DS8626, x32). The chip has
// one bank: a core that runs from flash stops meanwhile, including its interrupts. So only the boot loader erases,
// before the application runs.
//
// Back ends: stm32f4/slot_flash (sectors 5 to 8, one-time programmable memory), emulated/slot_flash (a file, or none).
#pragma once

#include <cstdint>
#include <span>

namespace bms::hal {

inline constexpr std::uint32_t slot_flash_bytes = 256 * 1024;

/// Each returns false if the chip reports an error or does not finish; the content is then undefined.
bool slot_erase(std::uint8_t slot);
/// at: a multiple of 4. A word is programmed once, or again with the same value or with 0.
bool slot_program(std::uint8_t slot, std::uint32_t at, std::uint32_t word);
void slot_read(std::uint8_t slot, std::uint32_t at, std::span<std::uint8_t> into);

/// Words whose bits can be cleared and never set again. word: 0 to 7.
std::uint32_t one_time_word(std::uint32_t word);
bool program_one_time_word(std::uint32_t word, std::uint32_t value);

}  // namespace bms::hal
