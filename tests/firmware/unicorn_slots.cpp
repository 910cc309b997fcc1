// What a board with a boot loader and two slots adds to unicorn_board.cpp.
#include <stdexcept>

#include <fmt/format.h>

#include "tests/firmware/unicorn_board.hpp"

namespace bms::firmware {

UnicornBoard::UnicornBoard(const std::filesystem::path& loader, const std::vector<std::filesystem::path>& images,
                           std::uint32_t seed)
    : symbols_(symbols_of(loader)), random_(seed) {
  map_memories(true);
  std::vector<Symbol> all = symbols_;
  load(loader);
  for (const auto& image : images) {
    load(image);
    const auto more = symbols_of(image);
    all.insert(all.end(), more.begin(), more.end());
  }
  core_.find_instructions(all);
  start();
}

void UnicornBoard::write_flash(std::uint32_t address, std::span<const std::uint8_t> bytes) {
  if (!core_.write(address, bytes)) throw std::runtime_error(fmt::format("no memory at {:08x}", address));
}

std::vector<std::uint8_t> UnicornBoard::read_flash(std::uint32_t address, std::size_t bytes) const {
  std::vector<std::uint8_t> content(bytes);
  if (!core_.read(address, content)) throw std::runtime_error(fmt::format("no memory at {:08x}", address));
  return content;
}

/// Bits that were being changed are undefined afterwards.
void UnicornBoard::lose_power() {
  std::vector<std::uint8_t> content = read_flash(flash.torn.address, flash.torn.size);
  for (std::size_t k = 0; k < content.size(); ++k)
    content[k] = static_cast<std::uint8_t>(content[k] | (random_() & flash.torn.before >> 8 * (k % 4)));
  core_.write(flash.torn.address, content);
  flash.power_failed = false;
  start_again(1U << 27 | 1U << 26 | 1U << 25);
}

}  // namespace bms::firmware
