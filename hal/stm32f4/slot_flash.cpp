// Slots in sectors 5 to 8, 128 KiB each (RM0090, table 5). One-time words: block 1 of the one-time programmable memory
// (3.6.5); block 0 has the device key.
#include "hal/slot_flash.hpp"

#include "hal/stm32f4/flash_operation.hpp"
#include "hal/watchdog.hpp"

namespace bms::hal {

namespace {

constexpr std::uint32_t slots_begin = 0x0802'0000, first_sector = 5, sectors_per_slot = 2, one_time_begin = 0x1FFF'7820;

/// A poll takes 5 to 10 cycles: at least 3 s at 168 MHz. An erase of 128 KiB needs at most 2 s.
constexpr std::uint32_t erase_max_polls = 100'000'000;

std::uint32_t address(std::uint8_t slot, std::uint32_t at) { return slots_begin + slot * slot_flash_bytes + at; }

}  // namespace

bool slot_erase(std::uint8_t slot) {
  bool done = true;
  for (std::uint32_t k = 0; k < sectors_per_slot && done; ++k) {
    watchdog_feed();
    done = stm32f4::flash_erase_sector(first_sector + sectors_per_slot * slot + k, erase_max_polls);
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
