// Register model of the STM32F405's flash interface with the three sectors after the vectors. Written only from RM0090,
// 3, and the datasheet; it shares no code with hal/. Programming clears bits, erasing sets all bits of a sector. The
// core runs from flash and stops meanwhile.
//
// `violations` lists driver errors: access to a locked register, programming of a word that is not erased, a wrong
// width.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace bms::firmware {

class FlashControllerModel {
 public:
  static constexpr std::uint32_t registers = 0x40023C00, memory = 0x08004000, sector_bytes = 0x4000, sectors = 3;

  /// offset from `registers`.
  std::uint32_t read(std::uint32_t offset) const;
  void write(std::uint32_t offset, std::uint32_t value);
  /// offset from `memory`; size: bytes at once.
  std::uint32_t read_memory(std::uint32_t offset, unsigned size) const;
  void write_memory(std::uint32_t offset, unsigned size, std::uint32_t value);
  /// Sectors 5 to 10, the slots of a boot loader, and the one-time memory are executed or read directly; here only the
  /// rules apply: what the core is about to store at an address, and what is there. The caller stores.
  void program_elsewhere(std::uint32_t address, unsigned size, std::uint32_t value, std::uint32_t before);
  /// Fills an address range with erased bytes; without it a sector outside the three holds code.
  std::function<void(std::uint32_t begin, std::uint32_t size)> erase_slot_sector;
  /// The power fails within the operation after so many; -1: never. Then `power_failed` is set, and the place of the
  /// operation is in `torn`.
  int operations_to_power_loss = -1;
  bool power_failed = false;
  struct Torn {
    std::uint32_t address = 0, size = 0;
    std::uint32_t before = ~0U;  ///< of a word: its bits that are 0 already stay so
  } torn;
  unsigned slot_words = 0, slot_sectors = 0;  ///< programmed, erased
  /// Every word that is programmed and every sector that is erased, in their order.
  struct Operation {
    std::uint32_t address = 0, bytes = 4;  ///< more than a word: erased
    std::uint32_t value = 0;
  };
  std::function<void(const Operation&)> on_operation;
  double slot_erase_us = 1'000'000;  ///< 128 KiB, usual time; at most 2 s

  /// Resets the registers. The stored data stay.
  void reset();
  /// Returns how long the core has been stopped since the last call.
  double take_stall_us();

  std::vector<std::uint8_t> bytes = std::vector<std::uint8_t>(sectors * sector_bytes, 0xFF);
  std::uint32_t option_bytes = 0x0FFFAAED & ~(3U << 2);  ///< FLASH_OPTCR as delivered, except brown-out reset level 3
  std::vector<std::string> violations;
  unsigned words_programmed = 0, sectors_erased = 0;
  /// Datasheet DS8626, flash memory programming, x32: usual times. An erase of 16 KiB takes at most 500 ms.
  double word_us = 16, erase_us = 250'000;
  bool worn_out = false;  ///< programming has no effect and sets no error flag

 private:
  enum class Keys { none, first, refused_until_reset };
  void unlock(std::uint32_t key);
  void control(std::uint32_t value);
  void erase(std::uint32_t number);
  bool fails_now(std::uint32_t address, std::uint32_t size, std::uint32_t before);

  std::uint32_t acr_ = 0, sr_ = 0, cr_ = 1U << 31;
  Keys keys_ = Keys::none;
  double stall_us_ = 0;
};

}  // namespace bms::firmware
