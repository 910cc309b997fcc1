#include "files/text_file.hpp"

#include <fcntl.h>
#include <openssl/evp.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <fstream>
#include <system_error>
#include <vector>

#include <fmt/format.h>

#include "files/bad_input.hpp"

namespace bms::files {

namespace {

std::string system_message() { return std::generic_category().message(errno); }

[[noreturn]] void refuse_to_write(const std::filesystem::path& path, const std::string& why) {
  throw BadInput(path.string(), 1, "cannot be written (" + why + "), expected a place to write to");
}

/// A file that does not exist yet. If it is not renamed, it is removed.
class NewFile {
 public:
  NewFile(const std::filesystem::path& wanted, mode_t mode) : wanted_(wanted) {
    std::uint64_t random = 0;
    if (getrandom(&random, sizeof random, 0) != static_cast<ssize_t>(sizeof random))
      refuse_to_write(wanted, system_message());
    path_ = fmt::format("{}.{:016x}.tmp", wanted.string(), random);
    // O_EXCL does not follow a link that somebody has put there
    fd_ = open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, mode);
    if (fd_ < 0) refuse_to_write(wanted, system_message());
  }
  ~NewFile() {
    if (fd_ >= 0) close(fd_);
    if (!path_.empty()) unlink(path_.c_str());
  }
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  void set_mode(mode_t mode) const {
    if (fchmod(fd_, mode) != 0) refuse_to_write(wanted_, system_message());
  }
  void write(std::string_view content) const {
    while (!content.empty()) {
      const ssize_t n = ::write(fd_, content.data(), content.size());
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) refuse_to_write(wanted_, system_message());
      content.remove_prefix(static_cast<std::size_t>(n));
    }
  }
  /// Forces the content to the disk and takes the place of the wanted file.
  void rename() {
    if (fsync(fd_) != 0 && errno != EINVAL) refuse_to_write(wanted_, system_message());  // EINVAL: nothing to force
    const int fd = fd_;
    fd_ = -1;
    if (close(fd) != 0) refuse_to_write(wanted_, system_message());
    if (std::rename(path_.c_str(), wanted_.c_str()) != 0) refuse_to_write(wanted_, system_message());
    path_.clear();
    const std::filesystem::path parent = wanted_.has_parent_path() ? wanted_.parent_path() : ".";
    const int folder = open(parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder < 0) return;  // a folder that cannot be read: the new name is there, but may be lost by a power cut
    fsync(folder);
    close(folder);
  }

 private:
  std::filesystem::path wanted_;
  std::string path_;
  int fd_ = -1;
};

/// A symbolic link is kept: the file that it points to is replaced.
std::filesystem::path link_target_of(const std::filesystem::path& wanted) {
  std::error_code error;
  if (!std::filesystem::is_symlink(wanted, error)) return wanted;
  std::filesystem::path target = std::filesystem::weakly_canonical(wanted, error);
  if (error) refuse_to_write(wanted, error.message());
  return target;
}

constexpr std::size_t sha256_length = 32;
using Digest = std::array<unsigned char, sha256_length>;

Digest sha256_bytes(std::string_view content) {
  Digest digest{};
  EVP_Digest(content.data(), content.size(), digest.data(), nullptr, EVP_sha256(), nullptr);
  return digest;
}

std::string hex_of(const Digest& digest) {
  std::string hex;
  for (const unsigned char byte : digest) {
    constexpr char digits[] = "0123456789abcdef";
    hex += digits[byte >> 4];
    hex += digits[byte & 15];
  }
  return hex;
}

}  // namespace

std::string read_file(const std::filesystem::path& path) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (std::filesystem::is_directory(status)) throw BadInput(path.string(), 1, "a folder, expected a file");
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    throw BadInput(path.string(), 1, "a pipe or a device, expected a regular file");
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  if (!in) throw BadInput(path.string(), 1, "cannot be read (" + system_message() + "), expected a file");
  const auto end = in.tellg();
  if (end < 0) throw BadInput(path.string(), 1, "cannot be read to its end, expected a regular file");
  if (static_cast<std::uintmax_t>(end) > largest_file_bytes) {
    throw BadInput(path.string(), 1,
                   fmt::format("{} bytes, expected at most {}", static_cast<std::uintmax_t>(end), largest_file_bytes));
  }
  std::string content(static_cast<std::size_t>(end), '\0');
  in.seekg(0);
  in.read(content.data(), end);
  if (in.gcount() != end) throw BadInput(path.string(), 1, "cannot be read to its end, expected a regular file");
  return content;
}

void write_file(const std::filesystem::path& wanted, std::string_view content) {
  write_file(wanted, [&](const Sink& sink) { sink(content); });
}

void write_file(const std::filesystem::path& wanted, const std::function<void(const Sink&)>& produce) {
  std::error_code error;
  const auto status = std::filesystem::status(wanted, error);
  const bool special = std::filesystem::exists(status) && !std::filesystem::is_regular_file(status) &&
                       !std::filesystem::is_directory(status);
  if (special) {  // a pipe or a device cannot be renamed
    std::ofstream out(wanted, std::ios::binary);
    produce([&](std::string_view piece) { out.write(piece.data(), static_cast<std::streamsize>(piece.size())); });
    out.close();
    if (!out) refuse_to_write(wanted, system_message());
    return;
  }
  constexpr mode_t usual_mode = 0666;  // the umask applies
  NewFile file(link_target_of(wanted), usual_mode);
  if (std::filesystem::is_regular_file(status)) file.set_mode(static_cast<mode_t>(status.permissions()));
  produce([&](std::string_view piece) { file.write(piece); });
  file.rename();
}

struct Sha256::Context {
  EVP_MD_CTX* of = EVP_MD_CTX_new();
  Context() { EVP_DigestInit_ex(of, EVP_sha256(), nullptr); }
  ~Context() { EVP_MD_CTX_free(of); }
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;
};

Sha256::Sha256() : context_(std::make_unique<Context>()) {}
Sha256::~Sha256() = default;

void Sha256::add(std::string_view piece) { EVP_DigestUpdate(context_->of, piece.data(), piece.size()); }

std::string Sha256::hex() {
  Digest digest{};
  EVP_DigestFinal_ex(context_->of, digest.data(), nullptr);
  return hex_of(digest);
}

std::string sha256(std::string_view content) { return hex_of(sha256_bytes(content)); }

std::string sha256_base64(std::string_view content) {
  const Digest digest = sha256_bytes(content);
  std::array<unsigned char, 64> text{};  // 32 bytes become 44 characters
  const int length = EVP_EncodeBlock(text.data(), digest.data(), static_cast<int>(digest.size()));
  return {text.begin(), text.begin() + length};
}

}  // namespace bms::files
