// The commands with which OpenOCD writes an image into the flash of a chip.
//
// Only the places for which the image has bytes are written, one after the other, so that nothing between them is
// erased. They are read back and compared. The stored records (firmware/storage/) are read before and compared
// afterwards. At the end the chip is reset.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "images/image_file.hpp"

namespace bms::images {

/// Whole sectors, [begin, end).
struct AddressRange {
  std::uint32_t begin = 0, end = 0;
};

struct Probe {
  std::string interface;  ///< file in interface/ of OpenOCD, without .cfg
  std::string target;     ///< file in target/ of OpenOCD, without .cfg
  std::string serial;     ///< serial number, if there are several probes; empty: the only one
};

/// A part of the image in a separate file, for OpenOCD.
struct PartFile {
  std::uint32_t address = 0;
  std::filesystem::path path;
};

/// Sectors of the stored records, which the image does not use (symbols image_storage_begin, image_storage_end).
/// Nothing if the board has no storage.
std::optional<AddressRange> storage_of(const ImageFile& image);

/// The parts to write: one on each side of the stored records. Gaps are filled with 0xFF, as erased flash reads,
/// because two parts in one sector would erase each other. Throws std::runtime_error if a part lies in the sectors of
/// the stored records.
std::vector<LoadedPart> parts_to_write(const std::vector<LoadedPart>& parts,
                                       const std::optional<AddressRange>& storage);

/// Program and arguments. kept: file for a copy of the stored records.
std::vector<std::string> openocd_command(const Probe& probe, const std::vector<PartFile>& parts,
                                         const std::optional<AddressRange>& storage, const std::filesystem::path& kept);

/// Why OpenOCD failed, in one sentence.
struct FlashFailure {
  std::string what;
  bool no_probe = false;  ///< nothing was tried
};
/// Reads the cause from the log of OpenOCD.
FlashFailure failure_in(const std::string& log, const Probe& probe);

}  // namespace bms::images
