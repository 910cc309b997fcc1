// Flash as hal/flash.hpp describes it, cell by cell, with what goes wrong: the power that goes in the middle of a step,
// cells that read differently each time, sectors that wear out. Knows nothing of storage/. Strict: whoever programs a
// word that is not erased is told so.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "hal/flash.hpp"

namespace bms {

/// Thrown out of the step in whose middle the power goes.
struct PowerCut {};
/// Thrown out of a read beyond the limit.
struct TooManyReads {};

class FlashModel {
 public:
  FlashModel(hal::FlashSize size, std::uint64_t seed);

  /// The power goes in the middle of the step so many steps from now (0: the next one). A step is a word programmed or
  /// a sector erased.
  void cut_in(std::uint64_t steps) { cut_at_ = steps_ + steps; }
  void no_cut() { cut_at_ = never; }
  void reseed(std::uint64_t seed) { random_.seed(seed); }
  std::uint64_t steps() const { return steps_; }

  enum class Wear { erase_fails, erase_leaves_zeros, bits_stuck_at_one, bits_stuck_at_zero };
  void wear_out(std::uint32_t sector, Wear how);
  void fill(std::uint32_t sector, const std::vector<std::uint8_t>& bytes);  ///< the rest as it was
  std::vector<std::uint8_t> bytes(std::uint32_t sector);
  void flip(std::uint32_t sector, std::uint32_t at, std::uint8_t bits);  ///< a cell that decays

  /// A cell that reads otherwise every so many-th time that it is read.
  void make_unsteady(std::uint32_t sector, std::uint32_t at, std::uint8_t bits, std::uint32_t every);
  /// Who reads more words than that is thrown out: it would never end.
  void limit_reads(std::uint64_t words) { reads_left_ = words; }

  const std::vector<std::uint64_t>& erases() const { return erases_; }
  std::uint64_t violations() const { return violations_; }  ///< words programmed that were not erased

  hal::FlashSize size() const { return size_; }
  bool erase(std::uint32_t sector);
  bool program(std::uint32_t sector, std::uint32_t at, std::uint32_t word);
  void read(std::uint32_t sector, std::uint32_t at, std::span<std::uint8_t> into);

 private:
  static constexpr std::uint64_t never = ~0ULL;
  struct Word {
    std::uint32_t bits = 0xFFFFFFFF;   ///< as they are for sure
    std::uint32_t weak = 0;            ///< these read as 0 or 1
    std::uint32_t asked = 0xFFFFFFFF;  ///< what it was programmed with since the last erase
    bool erased = true;
  };
  struct Worn {
    bool erase_fails = false, leaves_zeros = false;
    std::uint32_t stuck_at_one = 0, stuck_at_zero = 0;
  };
  Word& word(std::uint32_t sector, std::uint32_t at) { return words_[(sector * size_.sector_bytes + at) / 4]; }
  std::uint32_t seen(std::uint32_t sector, std::uint32_t at);
  bool power_goes();
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

/// What hal/flash.hpp works on in this program; may be nothing.
void plug_in(FlashModel* model);

}  // namespace bms
