// The slots in the chip's own flash (hal/slot_flash.hpp), and the battery that loader and application see.
#pragma once

#include "boot/flash_map.hpp"
#include "boot/key_table.hpp"
#include "boot/slots.hpp"
#include "hal/slot_flash.hpp"

namespace bms::boot {

static_assert(hal::slot_flash_bytes == application_slot_bytes && hal::cell_slot_flash_bytes == cell_slot_bytes);
static_assert(application_slots[0] + hal::slot_flash_at(1) == application_slots[1] &&
              application_slots[0] + hal::slot_flash_at(hal::first_cell_slot) == cell_slots[0]);

/// erases: true in the loader, which no sample waits for. The slots of cell constants have one-time words of their own,
/// so that their counter never forbids the running application.
class ChipSlots final : public SlotFlash {
 public:
  explicit ChipSlots(bool erases, Kind kind = Kind::application)
      : first_(kind == Kind::cell ? hal::first_cell_slot : std::uint8_t{0}),
        first_word_(kind == Kind::cell ? one_time_words : 0),
        bytes_(boot::slot_bytes(kind)),
        erases_(erases) {}
  std::uint32_t slot_bytes() const override { return bytes_; }
  bool erases_now() const override { return erases_; }
  bool erase(std::uint8_t slot) override { return erases_ && hal::slot_erase(of_chip(slot)); }
  bool program(std::uint8_t slot, std::uint32_t at, std::uint32_t word) override {
    return hal::slot_program(of_chip(slot), at, word);
  }
  void read(std::uint8_t slot, std::uint32_t at, std::span<std::uint8_t> into) override {
    hal::slot_read(of_chip(slot), at, into);
  }
  std::uint32_t one_time(std::uint32_t word) override { return hal::one_time_word(first_word_ + word); }
  bool program_one_time(std::uint32_t word, std::uint32_t value) override {
    return hal::program_one_time_word(first_word_ + word, value);
  }

 private:
  std::uint8_t of_chip(std::uint8_t slot) const { return static_cast<std::uint8_t>(first_ + slot); }

  std::uint8_t first_;
  std::uint32_t first_word_, bytes_;
  bool erases_;
};

inline std::span<const std::uint8_t> key_table_bytes() {
  return {reinterpret_cast<const std::uint8_t*>(key_table_address), most_keys * key_entry_bytes};
}

inline Battery chip_battery(std::string_view board, const KeyTable& keys, SlotFlash& flash,
                            std::uint32_t loader_version) {
  return {
      board,          keys.keys(),      security_counter(flash), loader_version, hal::slot_flash_bytes - trailer_bytes,
      keys.product(), Kind::application};
}

}  // namespace bms::boot
