// The STM32F405's flash interface as its registers show it, with the three sectors behind the vectors, written from
// RM0090, 3, and the datasheet alone: it shares nothing with hal/. Programming clears bits; erasing sets those of a
// sector; the core, which runs from flash, stands still meanwhile.
//
// What a driver must not do (a control register that is locked, a word that is not erased, another width than it set
// up) is in violations.
#pragma once

#include <cstdint>
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
  /// Of the registers; what is stored stays.
  void reset();
  /// For how long the core stands still since this was asked last.
  double take_stall_us();

  std::vector<std::uint8_t> bytes = std::vector<std::uint8_t>(sectors * sector_bytes, 0xFF);
  std::uint32_t option_bytes = 0x0FFFAAED & ~(3U << 2);  ///< FLASH_OPTCR as delivered, but brown-out reset at level 3
  std::vector<std::string> violations;
  unsigned words_programmed = 0, sectors_erased = 0;
  bool worn_out = false;  ///< what is programmed does not stay, and no error flag says so

 private:
  enum class Keys { none, first, refused_until_reset };
  void unlock(std::uint32_t key);
  void control(std::uint32_t value);
  void erase(std::uint32_t number);

  std::uint32_t acr_ = 0, sr_ = 0, cr_ = 1U << 31;
  Keys keys_ = Keys::none;
  double stall_us_ = 0;
};

}  // namespace bms::firmware
