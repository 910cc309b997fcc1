// Reads an image: an ELF file of a 32-bit little-endian controller (System V ABI, chapters 4 and 5). Throws
// std::runtime_error if the file is not such an image, or ends too early.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace bms::images {

/// Bytes for one place of the flash. address: where they are stored, not where they are used.
struct LoadedPart {
  std::uint32_t address = 0;
  std::string bytes;
};

class ImageFile {
 public:
  explicit ImageFile(const std::filesystem::path& path);

  /// Ascending by address, without those that have no bytes in the file.
  const std::vector<LoadedPart>& parts() const { return parts_; }
  /// The bytes at an address. Throws if the file has none there.
  std::string at(std::uint32_t address, std::size_t size) const;
  bool has_symbol(const std::string& name) const { return symbols_.contains(name); }
  /// Value of a symbol. Throws if there is no such symbol.
  std::uint32_t symbol(const std::string& name) const;
  /// Bytes of a section. Throws if there is no such section.
  const std::string& section(const std::string& name) const;

 private:
  std::string path_;
  std::vector<LoadedPart> parts_;
  std::map<std::string, std::string> sections_;
  std::map<std::string, std::uint32_t> symbols_;
};

}  // namespace bms::images
