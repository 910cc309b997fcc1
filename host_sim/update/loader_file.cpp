#include "update/loader_file.hpp"

#include <optional>
#include <span>

#include <fmt/format.h>

#include "boot/key_table.hpp"
#include "files/bad_input.hpp"
#include "files/text_file.hpp"
#include "hal/bytes.hpp"

namespace bms::update {

namespace {

/// Position in an ELF file of 32 bits of the bytes for an address (System V ABI, chapter 5).
std::optional<std::size_t> offset_of(const std::string& elf, std::uint32_t address, std::size_t size) {
  const std::span all(reinterpret_cast<const std::uint8_t*>(elf.data()), elf.size());
  if (elf.size() < 52 || !elf.starts_with("\x7F"
                                          "ELF\x01"))
    return std::nullopt;
  const auto begin = hal::get_bytes<std::uint32_t>(all, 28);
  const auto each = hal::get_bytes<std::uint16_t>(all, 42), count = hal::get_bytes<std::uint16_t>(all, 44);
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t at = begin + k * each;
    if (at + 32 > elf.size()) return std::nullopt;
    const auto offset = hal::get_bytes<std::uint32_t>(all, at + 4),
               physical = hal::get_bytes<std::uint32_t>(all, at + 12),
               bytes = hal::get_bytes<std::uint32_t>(all, at + 16);
    if (address < physical || address - physical > bytes || size > bytes - (address - physical)) continue;
    const std::size_t found = std::size_t{offset} + (address - physical);
    if (found + size <= elf.size()) return found;
  }
  return std::nullopt;
}

}  // namespace

void write_loader(const std::string& elf, const std::vector<LoaderKey>& keys, const std::string& out) {
  if (keys.empty() || keys.size() > boot::most_keys)
    throw files::BadInput(elf, 1, fmt::format("{} keys, expected 1 to {}", keys.size(), boot::most_keys));
  std::string all = files::read_file(elf);
  const auto at = offset_of(all, boot::key_table_address, boot::most_keys * boot::key_entry_bytes);
  if (!at) throw files::BadInput(elf, 1, "no place for keys, expected a boot loader (bms_BOARD_loader.elf)");
  const std::span table(reinterpret_cast<std::uint8_t*>(all.data()) + *at, boot::most_keys * boot::key_entry_bytes);
  std::ranges::fill(table, std::uint8_t{0xFF});
  for (std::size_t k = 0; k < keys.size(); ++k) {
    const auto entry = table.subspan(k * boot::key_entry_bytes, boot::key_entry_bytes);
    hal::put_bytes(entry, 0, keys[k].development ? boot::development_key_kind : boot::product_key_kind);
    std::ranges::copy(keys[k].point, entry.begin() + 4);
  }
  files::write_file(out, all);
}

}  // namespace bms::update
