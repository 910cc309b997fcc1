#include "update/linked_image.hpp"

#include <stdexcept>

#include <fmt/format.h>

#include "boot/flash_map.hpp"
#include "files/bad_input.hpp"
#include "hal/bytes.hpp"
#include "images/image_file.hpp"

namespace bms::update {

namespace {

std::string flash_content(const images::ImageFile& file, std::uint32_t begin) {
  std::string bytes;
  for (const images::LoadedPart& part : file.parts()) {
    if (part.address < begin) throw std::runtime_error(fmt::format("has bytes at {:#x}", part.address));
    bytes.resize(part.address - begin, '\xFF');
    bytes += part.bytes;
    if (bytes.size() > boot::application_slot_bytes) throw std::runtime_error("is larger than a slot");
  }
  return bytes;
}

}  // namespace

Payload read_linked_image(const std::filesystem::path& elf) {
  try {
    const images::ImageFile file(elf);
    const std::uint32_t vectors = file.symbol("image_vectors");
    for (const std::uint8_t slot : {std::uint8_t{0}, std::uint8_t{1}}) {
      if (vectors != boot::payload_address(boot::Kind::application, slot)) continue;
      Payload p;
      p.header.slot = slot;
      p.header.address = vectors;
      p.bytes = flash_content(file, vectors);
      const std::string hash = file.at(file.symbol("image_cell_hash"), sizeof(std::uint32_t));
      p.header.cell_hash =
          hal::get_bytes<std::uint32_t>(std::span(reinterpret_cast<const std::uint8_t*>(hash.data()), hash.size()), 0);
      p.header.built_for_cell_hash = p.header.cell_hash;
      return p;
    }
    throw std::runtime_error(fmt::format("has its vectors at {:#x}", vectors));
  } catch (const files::BadInput&) {
    throw;
  } catch (const std::runtime_error& error) {
    throw files::BadInput(elf.string(), 1,
                          fmt::format("{}, expected an image linked for a slot (-DBMS_SLOT=a or b)", error.what()));
  }
}

}  // namespace bms::update
