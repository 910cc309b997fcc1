// Three sectors of 16 KiB, as on the chip, in a file of the host. Command line: "fw FILE". Without a file the content
// lasts as long as the emulator runs, resets included. A file that is new or has another size starts as bytes 0, which
// worn flash may contain.
//
// QEMU gives this board one block of 192 KiB RAM, where the chip has 128 KiB: the sectors lie above the chip's RAM.
#include <algorithm>
#include <array>
#include <cstddef>

#include "hal/bytes.hpp"
#include "hal/emulated/semihosting.hpp"
#include "hal/flash.hpp"

namespace bms::hal {

namespace {

constexpr FlashSize size{3, 16 * 1024};
constexpr std::uintptr_t address_above_ram = 0x20020000;
int file = -1;

std::span<unsigned char> memory() {
  return {reinterpret_cast<unsigned char*>(address_above_ram), std::size_t{size.sectors} * size.sector_bytes};
}

bool write_back(std::size_t at, std::size_t bytes) {
  return file < 0 || (semihosting::seek(file, at) && semihosting::write(file, memory().subspan(at, bytes)));
}

void read_file() {
  std::size_t have = 0;
  while (have < memory().size()) {
    const std::size_t n = semihosting::read(file, memory().subspan(have));
    if (n == 0) break;
    have += n;
  }
  if (have == memory().size()) return;
  std::ranges::fill(memory(), static_cast<unsigned char>(0));
  if (!write_back(0, memory().size())) file = -1;
}

}  // namespace

FlashSize flash_start() {
  static std::array<char, 512> text;
  std::array<const char*, 2> words{};
  if (semihosting::arguments(text, words) != words.size()) return size;
  file = semihosting::open(words[1], semihosting::Open::update);
  if (file < 0) file = semihosting::open(words[1], semihosting::Open::create);
  if (file >= 0) read_file();
  return size;
}

bool flash_erase(std::uint32_t sector) {
  const std::size_t at = std::size_t{sector} * size.sector_bytes;
  std::ranges::fill(memory().subspan(at, size.sector_bytes), static_cast<unsigned char>(0xFF));
  return write_back(at, size.sector_bytes);
}

bool flash_program(std::uint32_t sector, std::uint32_t at, std::uint32_t word) {
  const std::size_t place = std::size_t{sector} * size.sector_bytes + at;
  const auto bytes = memory().subspan(place, sizeof word);
  put_bytes(bytes, 0, get_bytes<std::uint32_t>(bytes, 0) & word);
  return write_back(place, sizeof word);
}

void flash_read(std::uint32_t sector, std::uint32_t at, std::span<std::uint8_t> into) {
  std::ranges::copy(memory().subspan(std::size_t{sector} * size.sector_bytes + at, into.size()), into.begin());
}

}  // namespace bms::hal
