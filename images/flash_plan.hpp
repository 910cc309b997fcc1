// What OpenOCD is told to write an image onto a chip: only the places that the image has bytes for, one after the
// other, so that nothing between them is erased; read back and compared; the stored records (storage/) read before and
// compared after; reset.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "images/image_file.hpp"

namespace bms::images {

/// From `begin` up to, not including, `end`: whole sectors.
struct AddressRange {
  std::uint32_t begin = 0, end = 0;
};

struct Probe {
  std::string interface;  ///< file in OpenOCD's interface/, without .cfg
  std::string target;     ///< file in its target/
  std::string serial;     ///< of the probe, where there are several; empty: the one that is there
};

/// A part of the image in a file of its own, as it is handed over.
struct PartFile {
  std::uint32_t address = 0;
  std::filesystem::path path;
};

/// Sectors for stored records that the image says it leaves alone (image_storage_begin, image_storage_end); none on a
/// board without.
std::optional<AddressRange> storage_of(const ImageFile& image);

/// What is written: one part on each side of the stored records, gaps as erased flash is (two parts in one sector would
/// erase each other). Throws std::runtime_error when a part lies in the stored records' sectors.
std::vector<LoadedPart> parts_to_write(const std::vector<LoadedPart>& parts,
                                       const std::optional<AddressRange>& storage);

/// Program and arguments. kept: file that the stored records are read into.
std::vector<std::string> openocd_command(const Probe& probe, const std::vector<PartFile>& parts,
                                         const std::optional<AddressRange>& storage, const std::filesystem::path& kept);

/// What it said, in one sentence, when it failed.
struct FlashFailure {
  std::string what;
  bool nothing_to_talk_to = false;  ///< no probe: nothing was tried
};
FlashFailure failure_in(const std::string& log, const Probe& probe);

}  // namespace bms::images
