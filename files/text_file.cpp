#include "files/text_file.hpp"

#include <openssl/evp.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "files/bad_input.hpp"

namespace bms::files {

namespace {

std::string system_message() { return std::generic_category().message(errno); }

}  // namespace

std::string read_file(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) throw BadInput(path.string(), 1, "a folder, expected a file");
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  if (!in) throw BadInput(path.string(), 1, "cannot be read (" + system_message() + "), expected a file");
  const auto end = in.tellg();
  if (end < 0) throw BadInput(path.string(), 1, "cannot be read to its end, expected a regular file");
  std::string content(static_cast<std::size_t>(end), '\0');
  in.seekg(0);
  in.read(content.data(), end);
  if (in.gcount() != end) throw BadInput(path.string(), 1, "cannot be read to its end, expected a regular file");
  return content;
}

void write_file(const std::filesystem::path& wanted, std::string_view content) {
  std::error_code none;
  const bool special = std::filesystem::exists(wanted, none) && !std::filesystem::is_regular_file(wanted, none) &&
                       !std::filesystem::is_directory(wanted, none);
  if (special) {  // a pipe or a device cannot be renamed
    std::ofstream out(wanted, std::ios::binary);
    out.write(content.data(), static_cast<std::streamsize>(content.size()));
    out.close();
    if (!out)
      throw BadInput(wanted.string(), 1, "cannot be written (" + system_message() + "), expected a place to write to");
    return;
  }
  // a symbolic link is kept: the file that it points to is replaced
  const std::filesystem::path path =
      std::filesystem::is_symlink(wanted, none) ? std::filesystem::weakly_canonical(wanted, none) : wanted;
  const std::filesystem::path temporary = path.string() + "." + std::to_string(getpid()) + ".tmp";
  std::ofstream out(temporary, std::ios::binary);
  out.write(content.data(), static_cast<std::streamsize>(content.size()));
  out.close();
  std::error_code error;
  if (out) std::filesystem::rename(temporary, path, error);
  if (!out || error) {
    const std::string why = error ? error.message() : system_message();
    std::filesystem::remove(temporary, error);
    throw BadInput(path.string(), 1, "cannot be written (" + why + "), expected a place to write to");
  }
}

std::string sha256(std::string_view content) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int length = 0;
  EVP_Digest(content.data(), content.size(), digest.data(), &length, EVP_sha256(), nullptr);
  std::string hex;
  for (unsigned int k = 0; k < length; ++k) {
    constexpr char digits[] = "0123456789abcdef";
    hex += digits[digest[k] >> 4];
    hex += digits[digest[k] & 15];
  }
  return hex;
}

}  // namespace bms::files
