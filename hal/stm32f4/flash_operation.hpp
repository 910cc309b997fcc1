// One operation of the flash interface (RM0090, 3.6), at a supply of 2.7 to 3.6 V: parallelism x32.
#pragma once

#include "hal/stm32f4/registers.hpp"

namespace bms::hal::stm32f4 {

// FLASH_SR: BSY; OPERR, WRPERR, PGAERR, PGPERR, PGSERR
inline constexpr std::uint32_t flash_busy = 1U << 16, flash_errors = 1U << 1 | 1U << 4 | 1U << 5 | 1U << 6 | 1U << 7;
// FLASH_CR
inline constexpr std::uint32_t flash_program_bit = 1U << 0, flash_sector_erase = 1U << 1, flash_by_words = 2U << 8,
                               flash_start_bit = 1U << 16, flash_locked = 1U << 31;
// FLASH_ACR
inline constexpr std::uint32_t flash_data_cache = 1U << 10, flash_data_cache_reset = 1U << 12;

/// A poll takes 5 to 10 cycles. At 168 MHz the limit of a word is at least 0.3 ms; it needs at most 0.1 ms.
inline constexpr std::uint32_t flash_program_max_polls = 10'000;

inline bool flash_ready(std::uint32_t max_polls) {
  while ((flash_sr() & flash_busy) != 0) {
    if (max_polls-- == 0) return false;
  }
  return true;
}

/// Unlocks the flash for one operation. The chip rejects stray writes at all other times.
template <class Operation>
bool flash_unlocked(std::uint32_t control, std::uint32_t max_polls, Operation operation) {
  if (!flash_ready(max_polls)) return false;
  if ((flash_cr() & flash_locked) != 0) {
    flash_keyr() = 0x45670123;
    flash_keyr() = 0xCDEF89AB;
  }
  flash_sr() = flash_errors;  // clears errors of earlier operations by writing 1
  flash_cr() = flash_by_words | control;
  operation();
  asm volatile("dsb" ::: "memory");
  const bool done = flash_ready(max_polls) && (flash_sr() & flash_errors) == 0;
  flash_cr() = flash_locked;
  return done;
}

inline bool flash_program_word(std::uint32_t address, std::uint32_t word) {
  return flash_unlocked(flash_program_bit, flash_program_max_polls,
                        [&] { *reinterpret_cast<volatile std::uint32_t*>(address) = word; });
}

/// number: of the sector, RM0090, table 5.
inline bool flash_erase_sector(std::uint32_t number, std::uint32_t max_polls) {
  const std::uint32_t control = flash_sector_erase | number << 3;
  const bool done =
      flash_unlocked(control, max_polls, [&] { flash_cr() = flash_by_words | control | flash_start_bit; });
  // The data cache may contain old content of the sector (RM0090, 3.5.3). It can be reset only while it is off.
  const std::uint32_t access = flash_acr();
  flash_acr() = access & ~flash_data_cache;
  flash_acr() = (access & ~flash_data_cache) | flash_data_cache_reset;
  flash_acr() = access;
  return done;
}

}  // namespace bms::hal::stm32f4
