// Reads and writes whole files. A file is written completely or not at all.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace bms::files {

inline constexpr std::uintmax_t largest_file_bytes = 1U
                                                     << 30;  ///< of read_file(); a recording needs several times that

/// Content of a regular file. Throws BadInput if it cannot be read or is larger than largest_file_bytes. A pipe or a
/// device is rejected without opening it, because opening a pipe can wait for ever.
std::string read_file(const std::filesystem::path& path);

/// Writes to a new file of random name next to `path`, forces it to the disk and renames it: no other program sees an
/// incomplete file, and after a power cut either the old or the new content is there. An existing file keeps its
/// permissions. A path that is not a regular file (a pipe, /dev/stdout) is written directly. Throws BadInput if it
/// cannot be written.
void write_file(const std::filesystem::path& path, std::string_view content);

/// Takes the next piece of a file's content.
using Sink = std::function<void(std::string_view piece)>;
/// The same for a content that is produced piece by piece and need not fit into memory.
void write_file(const std::filesystem::path& path, const std::function<void(const Sink&)>& produce);

/// SHA-256 of a content that comes piece by piece.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;
  void add(std::string_view piece);
  std::string hex();  ///< of all pieces, in lower case; ends the calculation

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};

/// SHA-256 in lower-case hexadecimal.
std::string sha256(std::string_view content);
/// SHA-256 in base64, as a Content-Security-Policy has it.
std::string sha256_base64(std::string_view content);

}  // namespace bms::files
