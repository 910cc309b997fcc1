// Whole files: read at once, written whole or not at all.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace bms::files {

/// Content of a regular file. Throws BadInput when there is none to read.
std::string read_file(const std::filesystem::path& path);

/// Writes to a temporary file beside `path`, then renames: nobody ever sees half of it. What is no regular file (a
/// pipe, /dev/stdout) is written to as it is. Throws BadInput when it can't.
void write_file(const std::filesystem::path& path, std::string_view content);

/// SHA-256 in lower-case hexadecimal.
std::string sha256(std::string_view content);

}  // namespace bms::files
