// Slots in sectors 5 to 10, 128 KiB each (RM0090, table 5). One-time words: blocks 1 and 2 of the one-time programmable
// memory (3.6.5); block 0 has the device key.
#include "hal/slot_flash.hpp"

#include "hal/stm32f4/flash_operation.hpp"
#include "hal/watchdog.hpp"

namespace bms::hal {

namespace {

constexpr std::uint32_t slots_begin = 0x0802'0000, first_sector = 5, sector_bytes = 128 * 1024,
                        one_time_begin = 0x1FFF'7820;

/// A poll takes 5 to 10 cycles: at least 3 s at 168 MHz. An erase of 128 KiB needs at most 2 s.
constexpr std::uint32_t erase_max_polls = 100'000'000;

std::uint32_t address(std::uint8_t slot, std::uint32_t at) { return slots_begin + slot_flash_at(slot) + at; }

}  // namespace

bool slot_erase(std::uint8_t slot) {
  bool done = true;
  const std::uint32_t end = slot_flash_at(static_cast<std::uint8_t>(slot + 1)) / sector_bytes;
  for (std::uint32_t k = slot_flash_at(slot) / sector_bytes; k < end && done; ++k) {
    watchdog_feed();
    done = stm32f4::flash_erase_sector(first_sector + k, erase_max_polls);
  }
  watchdog_feed();
  return done;
}

bool slot_program(std::uint8_t slot, std::uint32_t at, std::uint32_t word) {
  return stm32f4::flash_program_word(address(slot, at), word);
}

void slot_read(std::uint8_t slot, std::uint32_t at, std::span<std::uint8_t> into) {
  const auto* from = reinterpret_cast<const volatile std::uint8_t*>(address(slot, at));
  for (std::uint8_t& byte : into) byte = *from++;
}

std::uint32_t one_time_word(std::uint32_t word) {
  return *reinterpret_cast<const volatile std::uint32_t*>(one_time_begin + 4 * word);
}

bool program_one_time_word(std::uint32_t word, std::uint32_t value) {
  return stm32f4::flash_program_word(one_time_begin + 4 * word, value);
}

}  // namespace bms::hal
