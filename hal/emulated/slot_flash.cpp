// All slots and the one-time words in a file of the host, the third argument of the emulator's command line: "fw
// STORAGE SLOTS CAUSE". QEMU cannot write the flash that it executes: the same file is also its memory at 0x0802'0000,
// as it was when the emulator started. So whoever runs the emulator starts it again after each reset (-no-reboot).
#include "hal/slot_flash.hpp"

#include <array>

#include "hal/bytes.hpp"
#include "hal/emulated/semihosting.hpp"

namespace bms::hal {

namespace {

constexpr std::uint32_t one_time_at = all_slots_bytes;

int slots_file() {
  static int file = -2;  // not looked for yet
  if (file != -2) return file;
  static std::array<char, 512> text;
  std::array<const char*, 3> words{};
  file =
      semihosting::arguments(text, words) == words.size() ? semihosting::open(words[2], semihosting::Open::update) : -1;
  return file;
}

bool write_at(std::uint32_t at, std::span<const unsigned char> bytes) {
  return semihosting::seek(slots_file(), at) && semihosting::write(slots_file(), bytes);
}

void read_at(std::uint32_t at, std::span<unsigned char> into) {
  for (unsigned char& byte : into) byte = 0;
  if (semihosting::seek(slots_file(), at)) semihosting::read(slots_file(), into);
}

bool clear_bits(std::uint32_t at, std::uint32_t word) {
  std::array<unsigned char, 4> bytes{};
  read_at(at, bytes);
  put_bytes(bytes, 0, get_bytes<std::uint32_t>(bytes, 0) & word);
  return write_at(at, bytes);
}

}  // namespace

bool slot_erase(std::uint8_t slot) {
  std::array<unsigned char, 1024> erased;
  erased.fill(0xFF);
  bool done = true;
  const std::uint32_t end = slot_flash_at(static_cast<std::uint8_t>(slot + 1));
  for (std::uint32_t at = slot_flash_at(slot); at < end && done; at += erased.size()) done = write_at(at, erased);
  return done;
}

bool slot_program(std::uint8_t slot, std::uint32_t at, std::uint32_t word) {
  return clear_bits(slot_flash_at(slot) + at, word);
}

void slot_read(std::uint8_t slot, std::uint32_t at, std::span<std::uint8_t> into) {
  read_at(slot_flash_at(slot) + at, into);
}

std::uint32_t one_time_word(std::uint32_t word) {
  std::array<unsigned char, 4> bytes{};
  read_at(one_time_at + 4 * word, bytes);
  return get_bytes<std::uint32_t>(bytes, 0);
}

bool program_one_time_word(std::uint32_t word, std::uint32_t value) {
  return clear_bits(one_time_at + 4 * word, value);
}

}  // namespace bms::hal
