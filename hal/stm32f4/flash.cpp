// The flash interface, programmed word by word at a supply of 2.7 to 3.6 V (RM0090, 3.6: parallelism x32). It uses only
// the sectors that the linker script reserves (image_storage_begin): sectors 1 to 3, the small ones after the vectors.
#include "hal/flash.hpp"

#include "hal/stm32f4/registers.hpp"

extern "C" {
extern const std::uint8_t image_storage_begin[], image_storage_end[];  // defined by the linker script
}

namespace bms::hal {

namespace {

constexpr std::uint32_t sector_bytes = 16 * 1024, flash_origin = 0x08000000;
// FLASH_SR: BSY; OPERR, WRPERR, PGAERR, PGPERR, PGSERR
constexpr std::uint32_t busy = 1U << 16, errors = 1U << 1 | 1U << 4 | 1U << 5 | 1U << 6 | 1U << 7;
constexpr std::uint32_t program = 1U << 0, sector_erase = 1U << 1, by_words = 2U << 8, start = 1U << 16,
                        locked = 1U << 31;
constexpr std::uint32_t data_cache = 1U << 10, data_cache_reset = 1U << 12;

// A poll takes 5 to 10 cycles. At 168 MHz the erase limit is at least 0.6 s, and an erase needs at most 0.5 s; the
// limit of a word is 0.3 ms, and a word needs at most 0.1 ms.
constexpr std::uint32_t erase_max_polls = 20'000'000, program_max_polls = 10'000;

bool ready(std::uint32_t max_polls) {
  while ((stm32f4::flash_sr() & busy) != 0) {
    if (max_polls-- == 0) return false;
  }
  return true;
}

std::uint32_t address(std::uint32_t sector, std::uint32_t at) {
  return reinterpret_cast<std::uint32_t>(image_storage_begin) + sector * sector_bytes + at;
}

/// Unlocks the flash for one operation. The chip rejects stray writes at all other times.
template <class Operation>
bool unlocked(std::uint32_t control, std::uint32_t max_polls, Operation operation) {
  if (!ready(max_polls)) return false;
  if ((stm32f4::flash_cr() & locked) != 0) {
    stm32f4::flash_keyr() = 0x45670123;
    stm32f4::flash_keyr() = 0xCDEF89AB;
  }
  stm32f4::flash_sr() = errors;  // clears errors of earlier operations by writing 1
  stm32f4::flash_cr() = by_words | control;
  operation();
  asm volatile("dsb" ::: "memory");
  const bool done = ready(max_polls) && (stm32f4::flash_sr() & errors) == 0;
  stm32f4::flash_cr() = locked;
  return done;
}

}  // namespace

FlashSize flash_start() {
  return {static_cast<std::uint32_t>(image_storage_end - image_storage_begin) / sector_bytes, sector_bytes};
}

bool flash_erase(std::uint32_t sector) {
  const std::uint32_t number = (address(sector, 0) - flash_origin) / sector_bytes, control = sector_erase | number << 3;
  const bool done = unlocked(control, erase_max_polls, [&] { stm32f4::flash_cr() = by_words | control | start; });
  // The data cache may contain old content of the sector (RM0090, 3.5.3). It can be reset only while it is off.
  const std::uint32_t access = stm32f4::flash_acr();
  stm32f4::flash_acr() = access & ~data_cache;
  stm32f4::flash_acr() = (access & ~data_cache) | data_cache_reset;
  stm32f4::flash_acr() = access;
  return done;
}

bool flash_program(std::uint32_t sector, std::uint32_t at, std::uint32_t word) {
  return unlocked(program, program_max_polls,
                  [&] { *reinterpret_cast<volatile std::uint32_t*>(address(sector, at)) = word; });
}

void flash_read(std::uint32_t sector, std::uint32_t at, std::span<std::uint8_t> into) {
  const auto* from = reinterpret_cast<const volatile std::uint8_t*>(address(sector, at));
  for (std::uint8_t& byte : into) byte = *from++;
}

}  // namespace bms::hal
