// All flash of the emulated chip but the loader's, rebuilt from recorded operations: as it was after so many of them,
// with the next one torn by a loss of power.
#pragma once

#include <fmt/format.h>

#include <cstdlib>
#include <iterator>
#include <map>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/firmware/boot/loader_board.hpp"
#include "tests/firmware/boot/stored_years.hpp"
#include "tests/firmware/flash_controller_model.hpp"

namespace bms::boot {

using Operation = firmware::FlashControllerModel::Operation;

/// Blocks 1 and 2 of the one-time programmable memory, for the counters; block 0 has the device key.
inline constexpr std::uint32_t one_time_begin = 0x1FFF'7820, one_time_bytes = 64,
                               by_power = 1U << 27 | 1U << 26 | 1U << 25,
                               slots_bytes = 2 * (application_slot_bytes + cell_slot_bytes);

struct Contents {
  std::vector<std::uint8_t> stored = std::vector<std::uint8_t>(Stored::sectors * Stored::sector_bytes, 0xFF);
  std::vector<std::uint8_t> slots = std::vector<std::uint8_t>(slots_bytes, 0xFF);
  std::vector<std::uint8_t> one_time = std::vector<std::uint8_t>(one_time_bytes, 0xFF);

  std::span<std::uint8_t> place(const Operation& o) {
    if (o.address >= one_time_begin) return part_of(one_time, o.address - one_time_begin, o.bytes);
    if (o.address >= application_slots[0]) return part_of(slots, o.address - application_slots[0], o.bytes);
    return part_of(stored, o.address - Stored::memory, o.bytes);
  }
  static std::span<std::uint8_t> part_of(std::vector<std::uint8_t>& of, std::size_t at, std::size_t bytes) {
    if (at + bytes > of.size()) throw std::out_of_range("an operation outside of the flash that this test knows");
    return std::span(of).subspan(at, bytes);
  }
  void apply(const Operation& o) {
    const auto bytes = place(o);
    for (std::size_t k = 0; k < bytes.size(); ++k)
      bytes[k] = o.bytes > 4 ? 0xFF : bytes[k] & static_cast<std::uint8_t>(o.value >> 8 * k);
  }
  /// The operation in which the power failed: of its bits any may have changed already.
  void tear(const Operation& o, std::mt19937& random) {
    const auto bytes = place(o);
    for (std::size_t k = 0; k < bytes.size(); ++k) {
      const auto any = static_cast<std::uint8_t>(random());
      bytes[k] = o.bytes > 4 ? any : bytes[k] & (any | static_cast<std::uint8_t>(o.value >> 8 * k));
    }
  }
  std::span<const std::uint8_t> slot(Kind kind, std::uint8_t which) const {
    return std::span(slots).subspan(slot_begin(kind, which) - application_slots[0], slot_bytes(kind));
  }
  void into(firmware::UnicornBoard& board) const {
    board.flash.bytes = stored;
    board.write_flash(application_slots[0], slots);
    board.write_flash(one_time_begin, one_time);
  }
};

inline Contents contents_of(firmware::UnicornBoard& board) {
  Contents c;
  c.stored = board.flash.bytes;
  c.slots = board.read_flash(application_slots[0], slots_bytes);
  c.one_time = board.read_flash(one_time_begin, one_time_bytes);
  return c;
}

/// A loss of power within one of the recorded operations.
struct Cut {
  std::size_t operation = 0;
  std::string part, name;  ///< part: of an update
  Contents contents;
  Charges charges;  ///< charge before the interrupted write of records, and after it
  int operations_to_the_next_cut = -1;
};

/// Losses of power that follow from their numbers alone, one part of the update after the other.
class CutPlan {
 public:
  using PartOf = std::string (*)(const Operation&);
  CutPlan(const Contents& before, const std::vector<Operation>& operations, PartOf part_of)
      : before_(before), operations_(operations), part_of_(part_of) {
    for (std::size_t k = 0; k < operations_.size(); ++k) parts_[part_of_(operations_[k])].push_back(k);
  }
  Cut cut(unsigned number) {
    std::mt19937 random(number);
    const auto part = std::next(parts_.begin(), static_cast<long>(number % parts_.size()));
    Cut c;
    const std::size_t k = c.operation = part->second[random() % part->second.size()];
    c.part = part->first;
    c.name = fmt::format("cut {} in operation {}: {}", number, k, c.part);
    ++by_part_[c.part];
    c.contents = before_;
    for (std::size_t i = 0; i < k; ++i) c.contents.apply(operations_[i]);
    c.charges.before = charge_in(c.contents.stored);
    Contents after = c.contents;
    for (std::size_t i = k; i < operations_.size() && part_of_(operations_[i]) == "stored data";)
      after.apply(operations_[i++]);
    c.charges.after = charge_in(after.stored);
    c.contents.tear(operations_[k], random);
    c.operations_to_the_next_cut = random() % 2 == 0 ? static_cast<int>(random() % 4) : -1;
    return c;
  }
  const std::map<std::string, unsigned>& by_part() const { return by_part_; }

 private:
  const Contents& before_;
  const std::vector<Operation>& operations_;
  PartOf part_of_;
  std::map<std::string, std::vector<std::size_t>> parts_;
  std::map<std::string, unsigned> by_part_;
};

/// Starts the chip after a cut, until an image runs. Returns how often the power failed during that start.
inline unsigned start_after(const Cut& c, LoaderBoard& battery) {
  firmware::UnicornBoard& board = battery.board;
  board.can.seen.clear();
  c.contents.into(board);
  board.flash.operations_to_power_loss = c.operations_to_the_next_cut;
  const std::size_t before = board.resets.size();
  board.reset(by_power);
  EXPECT_TRUE(board.run_until([&] { return battery.running() != 2; }, 6'000)) << c.name << ": no image runs";
  board.flash.operations_to_power_loss = -1;
  return static_cast<unsigned>(board.resets.size() - before - 1);
}

inline int of_environment(const char* name, int otherwise) {
  const char* value = std::getenv(name);
  return value != nullptr ? std::atoi(value) : otherwise;
}

}  // namespace bms::boot
