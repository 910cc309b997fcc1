#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <string>
#include <system_error>

#include "monitor/candump_line.hpp"
#include "monitor/frame_source.hpp"

namespace bms::monitor {

namespace {

// a file without frames is rejected early: an endless one, or a small one that decompresses to many gigabytes
constexpr std::uint64_t most_lines_without_frame = 1'000'000, most_bytes_without_frame = 64U << 20;

/// The bytes of a file or pipe, decompressed if they start with the gzip magic number. read() never waits longer than
/// requested, so that a pipe can be followed.
class Decompressed {
 public:
  explicit Decompressed(int fd) : fd_(fd) {}
  ~Decompressed() {
    if (compressed_) inflateEnd(&inflate_);
    close(fd_);
  }
  Decompressed(const Decompressed&) = delete;
  Decompressed& operator=(const Decompressed&) = delete;

  enum class State { open, ended, broken };
  State state() const { return state_; }

  /// Returns 0 after wait_ms without bytes, or if state() is not `open`.
  std::size_t read(std::span<char> room, int wait_ms) {
    if (state_ != State::open) return 0;
    if (inflate_.avail_in == 0 && !eof_ && !fetch(wait_ms)) return 0;
    return compressed_ ? decompress(room) : copy(room);
  }

 private:
  static constexpr int window_bits_and_gzip_header = 15 + 16;  // zlib.h, inflateInit2()

  std::size_t copy(std::span<char> room) {
    if (inflate_.avail_in == 0) state_ = State::ended;
    const std::size_t n = std::min<std::size_t>(room.size(), inflate_.avail_in);
    std::copy_n(inflate_.next_in, n, room.data());
    inflate_.next_in += n;
    inflate_.avail_in -= static_cast<uInt>(n);
    return n;
  }

  std::size_t decompress(std::span<char> room) {
    inflate_.next_out = reinterpret_cast<Bytef*>(room.data());
    inflate_.avail_out = static_cast<uInt>(room.size());
    const int result = inflate(&inflate_, Z_NO_FLUSH);  // also without new input: output may be pending
    if (result == Z_STREAM_END) {
      complete_ = true;
      inflateReset(&inflate_);  // another gzip member may follow
    } else if (result == Z_OK) {
      complete_ = false;
    } else if (result != Z_BUF_ERROR) {
      state_ = complete_ ? State::ended : State::broken;  // after a complete member it is padding
    }
    if (eof_ && inflate_.avail_in == 0 && inflate_.avail_out != 0 && state_ == State::open)
      state_ = complete_ ? State::ended : State::broken;
    return room.size() - inflate_.avail_out;
  }

  bool fetch(int wait_ms) {
    pollfd p{fd_, POLLIN, 0};
    if (poll(&p, 1, wait_ms) <= 0) return false;
    // until two bytes have been read, the format is unknown
    const ssize_t n = ::read(fd_, bytes_.data() + (begun_ ? 0 : head_), bytes_.size() - head_);
    if (n < 0) {
      if (errno != EAGAIN && errno != EINTR) state_ = State::broken;
      return false;
    }
    eof_ = n == 0;
    std::size_t available = static_cast<std::size_t>(n);
    if (!begun_) {
      head_ = available += head_;
      if (available < 2 && !eof_) return false;
      begun_ = true;
      head_ = 0;
      compressed_ = available >= 2 && bytes_[0] == 0x1F && bytes_[1] == 0x8B;
      if (compressed_ && inflateInit2(&inflate_, window_bits_and_gzip_header) != Z_OK) throw std::bad_alloc();
    }
    inflate_.next_in = bytes_.data();
    inflate_.avail_in = static_cast<uInt>(available);
    return true;
  }

  int fd_;
  bool begun_ = false, compressed_ = false, eof_ = false, complete_ = false;
  std::size_t head_ = 0;
  State state_ = State::open;
  z_stream inflate_{};
  std::array<Bytef, 16'384> bytes_{};
};

class Dump : public FrameSource {
 public:
  Dump(const std::string& path, int fd) : path_(path), file_(fd) {}

  std::size_t read(std::span<BusFrame> room, int wait_ms) override {
    std::size_t taken = decode(room);
    if (taken > 0 || ended_) return taken;
    size_ = file_.read(text_, wait_ms);
    used_ = 0;
    bytes_ += size_;
    if (!any_ && bytes_ > most_bytes_without_frame) reject();
    taken = decode(room);
    if (size_ == 0 && file_.state() != Decompressed::State::open) taken += finish(room[0]);
    return taken;
  }
  bool ended() const override { return ended_; }
  bool live() const override { return false; }

 private:
  std::size_t decode(std::span<BusFrame> room) {
    std::size_t taken = 0;
    while (used_ < size_ && taken < room.size()) {
      if (lines_.push(text_[used_++])) taken += line(room[taken]);
    }
    return taken;
  }
  std::size_t line(BusFrame& frame) {
    ++count_;
    if (lines_.line().empty() && !lines_.too_long()) return 0;
    if (parse_dump_line(lines_.line(), frame)) {
      any_ = true;
      return 1;
    }
    ++malformed_;
    if (!any_ && count_ > most_lines_without_frame) reject();
    return 0;
  }
  /// Parses the last line, which may have no end.
  std::size_t finish(BusFrame& frame) {
    ended_ = true;
    const std::size_t taken = lines_.pending() && lines_.push('\n') ? line(frame) : 0;
    if (file_.state() == Decompressed::State::broken) ++malformed_;  // truncated or corrupted
    if (!any_) reject();
    return taken;
  }
  [[noreturn]] void reject() const {
    throw SourceError(
        path_, 1,
        "no frame in " + std::to_string(count_) + " lines, expected a log of candump -L, plain or compressed by gzip");
  }

  std::string path_;
  Decompressed file_;
  DumpLines lines_;
  std::array<char, 16'384> text_{};
  std::size_t used_ = 0, size_ = 0;
  std::uint64_t count_ = 0, bytes_ = 0;
  bool any_ = false, ended_ = false;
};

}  // namespace

std::unique_ptr<FrameSource> open_dump(const std::string& path) {
  const int fd = path == "-" ? dup(0) : open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0)
    throw SourceError(path, 1,
                      "cannot be read, expected a log of candump -L (" + std::generic_category().message(errno) + ")");
  struct stat status {};
  if (fstat(fd, &status) != 0 || S_ISDIR(status.st_mode)) {
    close(fd);
    throw SourceError(path, 1, "is a folder, expected a log of candump -L");
  }
  return std::make_unique<Dump>(path, fd);
}

}  // namespace bms::monitor
