// The slots in the chip's own flash (hal/slot_flash.hpp), and the battery that loader and application see.
#pragma once

#include "boot/flash_map.hpp"
#include "boot/key_table.hpp"
#include "boot/slots.hpp"
#include "hal/slot_flash.hpp"

namespace bms::boot {

static_assert(hal::slot_flash_bytes == application_slot_bytes);

/// erases: true in the loader, which no sample waits for.
class ChipSlots final : public SlotFlash {
 public:
  explicit ChipSlots(bool erases) : erases_(erases) {}
  std::uint32_t slot_bytes() const override { return hal::slot_flash_bytes; }
  bool erases_now() const override { return erases_; }
  bool erase(std::uint8_t slot) override { return erases_ && hal::slot_erase(slot); }
  bool program(std::uint8_t slot, std::uint32_t at, std::uint32_t word) override {
    return hal::slot_program(slot, at, word);
  }
  void read(std::uint8_t slot, std::uint32_t at, std::span<std::uint8_t> into) override {
    hal::slot_read(slot, at, into);
  }
  std::uint32_t one_time(std::uint32_t word) override { return hal::one_time_word(word); }
  bool program_one_time(std::uint32_t word, std::uint32_t value) override {
    return hal::program_one_time_word(word, value);
  }

 private:
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
