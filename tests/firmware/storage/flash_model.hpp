// Model of the flash of hal/flash.hpp, bit by bit, with its faults: loss of power during a step, bits that read
// differently each time, sectors that wear out. Independent of firmware/storage/. It counts every word that is
// programmed without an erase.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "hal/flash.hpp"

namespace bms {

/// Thrown by the step during which the power fails.
struct PowerCut {};
/// Thrown by a read beyond the limit.
struct TooManyReads {};

class FlashModel {
 public:
  FlashModel(hal::FlashSize size, std::uint64_t seed);

  /// Lets the power fail during a later step; steps = 0: during the next one. A step programs a word or erases a
  /// sector.
  void cut_in(std::uint64_t steps) { cut_at_ = steps_ + steps; }
  void no_cut() { cut_at_ = never; }
  void reseed(std::uint64_t seed) { random_.seed(seed); }
  std::uint64_t steps() const { return steps_; }

  enum class Wear { erase_fails, erase_leaves_zeros, bits_stuck_at_one, bits_stuck_at_zero };
  void wear_out(std::uint32_t sector, Wear how);
  void fill(std::uint32_t sector, const std::vector<std::uint8_t>& bytes);  ///< the remaining bytes are unchanged
  std::vector<std::uint8_t> bytes(std::uint32_t sector);
  void flip(std::uint32_t sector, std::uint32_t at, std::uint8_t bits);  ///< decayed bits

  /// Bits that read wrongly in every `every`-th read.
  void make_unsteady(std::uint32_t sector, std::uint32_t at, std::uint8_t bits, std::uint32_t every);
  /// Throws TooManyReads after this number of words, to detect an endless loop.
  void limit_reads(std::uint64_t words) { reads_left_ = words; }

  const std::vector<std::uint64_t>& erases() const { return erases_; }
  std::uint64_t violations() const { return violations_; }  ///< words programmed without an erase

  hal::FlashSize size() const { return size_; }
  bool erase(std::uint32_t sector);
  bool program(std::uint32_t sector, std::uint32_t at, std::uint32_t word);
  void read(std::uint32_t sector, std::uint32_t at, std::span<std::uint8_t> into);

 private:
  static constexpr std::uint64_t never = ~0ULL;
  struct Word {
    std::uint32_t bits = 0xFFFFFFFF;   ///< stable value
    std::uint32_t weak = 0;            ///< bits that read as 0 or 1
    std::uint32_t asked = 0xFFFFFFFF;  ///< programmed value since the last erase
    bool erased = true;
  };
  struct Worn {
    bool erase_fails = false, leaves_zeros = false;
    std::uint32_t stuck_at_one = 0, stuck_at_zero = 0;
  };
  Word& word(std::uint32_t sector, std::uint32_t at) { return words_[(sector * size_.sector_bytes + at) / 4]; }
  std::uint32_t seen(std::uint32_t sector, std::uint32_t at);
  bool power_fails();
  std::uint32_t random() { return static_cast<std::uint32_t>(random_()); }

  hal::FlashSize size_;
  std::mt19937_64 random_;
  std::vector<Word> words_;
  std::vector<Worn> worn_;
  std::vector<std::uint64_t> erases_;
  std::uint64_t steps_ = 0, cut_at_ = never, violations_ = 0, reads_left_ = never;
  struct Unsteady {
    std::uint32_t sector = 0, at = 0, bits = 0, every = 0, reads = 0;
  } unsteady_;
};

/// Selects the flash behind hal/flash.hpp; nullptr: no flash.
void plug_in(FlashModel* model);

}  // namespace bms
