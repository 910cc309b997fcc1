// The two slots of an image and the one-time words, as the loader and the receiver see them.
//
// A slot is erased as a whole. A loss of power may leave any word of an interrupted step undefined, and bits that read
// differently each time (hal/flash.hpp). One-time words start as all ones; their bits can be cleared and never set.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace bms::boot {

class SlotFlash {
 public:
  virtual std::uint32_t slot_bytes() const = 0;
  /// Returns false if only the loader may erase, because an erase stops the core for seconds.
  virtual bool erases_now() const { return true; }
  /// Each returns false if the chip reports an error.
  virtual bool erase(std::uint8_t slot) = 0;
  virtual bool program(std::uint8_t slot, std::uint32_t at, std::uint32_t word) = 0;  ///< at: a multiple of 4
  virtual void read(std::uint8_t slot, std::uint32_t at, std::span<std::uint8_t> into) = 0;

  static constexpr std::uint32_t one_time_words = 8;
  virtual std::uint32_t one_time(std::uint32_t word) = 0;
  virtual bool program_one_time(std::uint32_t word, std::uint32_t value) = 0;

 protected:
  ~SlotFlash() = default;
};

/// Monotonic counter: the number of cleared bits in the one-time words 0 to 6, from the lowest on. At most 224.
inline constexpr std::uint32_t counter_words = 7, largest_counter = 32 * counter_words, revocation_word = 7;

inline std::uint32_t security_counter(SlotFlash& flash) {
  std::uint32_t count = 0;
  for (std::uint32_t k = 0; k < counter_words; ++k) {
    std::uint32_t word = flash.one_time(k);
    for (; (word & 1) == 0 && count < 32 * (k + 1); word = word >> 1 | 1U << 31) ++count;
    if (count < 32 * (k + 1)) break;
  }
  return count;
}

/// Raises the counter; a lower value changes nothing. Bits whose programming was interrupted become stable.
inline bool raise_security_counter(SlotFlash& flash, std::uint32_t to) {
  bool done = true;
  for (std::uint32_t k = 0; k < counter_words && 32 * k < to; ++k) {
    const std::uint32_t bits = to - 32 * k >= 32 ? 0 : ~0U << (to - 32 * k);
    const std::uint32_t before = flash.one_time(k);
    if ((before & ~bits) != 0) done = flash.program_one_time(k, before & bits) && done;
  }
  return done;
}

/// Bit k of the revocation word, cleared: key k of the loader is revoked.
inline bool key_revoked(SlotFlash& flash, std::uint32_t key) {
  return (flash.one_time(revocation_word) >> key & 1) == 0;
}

}  // namespace bms::boot
