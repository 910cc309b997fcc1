// The boot loader of the forklift board with two images in Unicorn: the flash that both program is that of the chip's
// model. Images are signed here; the loader has the key.
#pragma once

#include <gtest/gtest.h>
#include <unicorn/unicorn.h>

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "boot/flash_map.hpp"
#include "boot/receiver.hpp"
#include "files/cell_file.hpp"
#include "images/firmware_image.hpp"
#include "tests/firmware/boot/bench.hpp"
#include "tests/firmware/unicorn_board.hpp"
#include "update/linked_image.hpp"
#include "update/loader_file.hpp"

namespace bms::boot {

/// Both slots as bytes.
class SlotBytes final : public SlotFlash {
 public:
  SlotBytes() {
    for (auto& slot : slots) slot.assign(application_slot_bytes, 0xFF);
  }
  std::uint32_t slot_bytes() const override { return application_slot_bytes; }
  bool erase(std::uint8_t slot) override {
    slots[slot].assign(application_slot_bytes, 0xFF);
    return true;
  }
  bool program(std::uint8_t slot, std::uint32_t at, std::uint32_t word) override {
    for (std::size_t k = 0; k < 4; ++k) slots[slot][at + k] &= static_cast<std::uint8_t>(word >> 8 * k);
    return true;
  }
  void read(std::uint8_t slot, std::uint32_t at, std::span<std::uint8_t> into) override {
    std::copy_n(slots[slot].begin() + at, into.size(), into.begin());
  }
  std::uint32_t one_time(std::uint32_t) override { return ~0U; }
  bool program_one_time(std::uint32_t, std::uint32_t) override { return true; }

  std::vector<std::uint8_t> slots[2];
};

inline const std::filesystem::path& linked(images::Image which) {
  static std::map<images::Image, std::filesystem::path> all;
  auto& path = all[which];
  if (path.empty()) path = images::firmware_image("stm32f405_forklift", files::read_cell("table9"), which);
  return path;
}

inline const std::filesystem::path& loader() {
  static const files::TemporaryFolder folder;
  static const std::filesystem::path path = [] {
    const auto out = folder.path() / "loader.elf";
    update::write_loader(linked(images::Image::loader).string(), {{key_of("product").public_key(), false}},
                         out.string());
    return out;
  }();
  return path;
}

inline const std::filesystem::path& image_in(std::uint8_t slot) {
  return linked(slot == 0 ? images::Image::remote_slot_a : images::Image::remote_slot_b);
}

/// The address of a function in the image of a slot, without the Thumb bit.
inline std::uint32_t address_in(std::uint8_t slot, const std::string& function) {
  static std::map<std::uint8_t, std::vector<firmware::Symbol>> symbols;
  if (symbols[slot].empty()) symbols[slot] = firmware::symbols_of(image_in(slot));
  return static_cast<std::uint32_t>(firmware::symbol_named(symbols[slot], function).address) & ~1U;
}

/// Changes the payload of an image before it is signed.
using Change = std::function<void(std::string& payload, std::uint8_t slot)>;
inline void change_nothing(std::string&, std::uint8_t) {}

/// Replaces the first instructions of a function.
inline Change patched(const std::string& function, firmware::UnicornBoard::Instructions with) {
  return [=](std::string& payload, std::uint8_t slot) {
    const std::uint32_t at = address_in(slot, function) - payload_address(Kind::application, slot);
    for (std::size_t k = 0; k < 4; ++k) payload.at(at + k) = static_cast<char>(with[k / 2] >> 8 * (k % 2));
  };
}

inline update::Container signed_image(std::uint8_t slot, std::uint32_t version, const Change& change = change_nothing,
                                      const std::string& key = "product") {
  update::Payload p = update::read_linked_image(image_in(slot));
  change(p.bytes, slot);
  std::ranges::copy(std::string("stm32f405_forklift"), p.header.board.begin());
  p.header.version = version;
  p.header.security_version = 1;
  return sign({p}, key_of(key)).front();
}
inline std::string container(std::uint8_t slot, std::uint32_t version, const Change& change = change_nothing,
                             const std::string& key = "product") {
  return signed_image(slot, version, change, key).bytes;
}

/// Version 0.2.0 in slot A, confirmed; in slot B what a transfer has left there.
class LoaderBoard {
 public:
  explicit LoaderBoard(std::uint32_t seed = 1, const std::string& runs = container(0, 0x000200))
      : board(loader(), {image_in(0), image_in(1)}, seed) {
    board.may_start_again = true;
    fill(0, runs, true);
    load();
  }
  void put_on_trial(const std::string& bytes) {
    fill(1, bytes, false);
    load();
  }
  void erase_target() {
    prepare(slots_, 1);
    load();
  }
  /// Looks ten times a second; false if it took longer.
  bool run_until(const std::function<bool()>& becomes, double within_ms) {
    for (double ms = 0; ms < within_ms; ms += 100) {
      if (becomes()) return true;
      board.run_for_ms(100);
    }
    return becomes();
  }
  /// The slot whose code runs, from the program counter; 2: the loader.
  std::uint8_t running() {
    const std::uint32_t pc = board.core().reg(UC_ARM_REG_PC);
    for (const std::uint8_t slot : {std::uint8_t{0}, std::uint8_t{1}}) {
      if (pc >= application_slots[slot] && pc < application_slots[slot] + application_slot_bytes) return slot;
    }
    return 2;
  }
  Marks marks(std::uint8_t slot) {
    const auto end = board.read_flash(application_slots[slot] + application_slot_bytes - trailer_bytes, trailer_bytes);
    std::ranges::copy(end, slots_.slots[slot].end() - trailer_bytes);
    return read_marks(slots_, slot);
  }

  firmware::UnicornBoard board;

 private:
  void fill(std::uint8_t slot, const std::string& bytes, bool confirmed) {
    prepare(slots_, slot);
    for (std::uint32_t at = 0; at < bytes.size(); at += 4) {
      std::array<std::uint8_t, 4> four{0xFF, 0xFF, 0xFF, 0xFF};
      for (std::size_t k = 0; k < 4 && at + k < bytes.size(); ++k) four[k] = static_cast<std::uint8_t>(bytes[at + k]);
      slots_.program(slot, at, hal::get_bytes<std::uint32_t>(four, 0));
    }
    begin_writing(slots_, slot);
    complete(slots_, slot);
    if (confirmed) confirm(slots_, slot, 0);
  }
  void load() {
    for (const std::uint8_t slot : {std::uint8_t{0}, std::uint8_t{1}})
      board.write_flash(application_slots[slot], slots_.slots[slot]);
  }
  SlotBytes slots_;
};

}  // namespace bms::boot
