// Reads and writes whole files. A file is written completely or not at all.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace bms::files {

/// Content of a regular file. Throws BadInput if it cannot be read.
std::string read_file(const std::filesystem::path& path);

/// Writes to a temporary file next to `path` and renames it, so that no other program sees an incomplete file. A path
/// that is not a regular file (a pipe, /dev/stdout) is written directly. Throws BadInput if it cannot be written.
void write_file(const std::filesystem::path& path, std::string_view content);

/// SHA-256 in lower-case hexadecimal.
std::string sha256(std::string_view content);

}  // namespace bms::files
