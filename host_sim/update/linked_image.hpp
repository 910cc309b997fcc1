// The payload of a slot from an image that was linked for it.
#pragma once

#include <filesystem>
#include <string>

#include "update/container_file.hpp"

namespace bms::update {

/// Reads an ELF image of an application. Slot and address follow from where its vectors lie, the cell file's hash from
/// its symbol; gaps are filled with 0xFF. Throws BadInput if it is not such an image, or not linked for a slot.
Payload read_linked_image(const std::filesystem::path& elf);

}  // namespace bms::update
