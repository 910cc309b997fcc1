#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <stdexcept>

#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "hal/pipe_format.hpp"
#include "hil/board_link.hpp"
#include "images/child_process.hpp"
#include "images/emulator.hpp"

namespace bms::hil {

namespace {

using namespace hal::pipe;

constexpr int longest_silence_ms = 30'000, poll_ms = 100;

class FileDescriptor {
 public:
  explicit FileDescriptor(int fd) : fd_(fd) {
    if (fd_ < 0) throw std::runtime_error("cannot open a pipe to the emulator");
  }
  ~FileDescriptor() { close(fd_); }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  int operator*() const { return fd_; }

 private:
  int fd_;
};

std::filesystem::path make_pipe(const std::filesystem::path& folder, const char* name) {
  auto path = folder / name;
  if (mkfifo(path.c_str(), 0600) != 0) throw std::runtime_error("cannot make a pipe in " + folder.string());
  return path;
}

const images::EmulatedBoard& emulator_of(const std::string& board) {
  for (const images::EmulatedBoard& b : images::emulated_boards()) {
    if (b.name == board) return b;
  }
  return images::emulated_boards().front();  // a board with the same chip, for boards without an emulator of their own
}

/// The other side of hal/emulated/can_pipe.cpp.
class EmulatedLink : public BoardLink {
 public:
  EmulatedLink(const std::string& board, const std::filesystem::path& image)
      : to_path_(make_pipe(folder_.path(), "to_board")),
        from_path_(make_pipe(folder_.path(), "from_board")),
        // opened for reading and writing, so that open() does not wait for the other side
        to_(open(to_path_.c_str(), O_RDWR | O_CLOEXEC)),
        from_(open(from_path_.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC)),
        emulator_(command(board, image), folder_.path() / "log") {}

  std::vector<can::Frame> exchange(double time_s, std::span<const can::Frame> frames) override {
    auto answer = first_ ? read_block() : std::vector<can::Frame>{};  // what it sends at start-up
    first_ = false;
    do {
      const auto part = frames.first(std::min(frames.size(), most_records - 1));
      frames = frames.subspan(part.size());
      write_block(static_cast<std::uint64_t>(1e6 * time_s), part);
      const auto received = read_block();
      answer.insert(answer.end(), received.begin(), received.end());
    } while (!frames.empty());
    return answer;
  }

 private:
  std::vector<std::string> command(const std::string& board, const std::filesystem::path& image) {
    auto arguments = images::emulator_command(emulator_of(board), image, {to_path_.string(), from_path_.string()});
    arguments.insert(arguments.end(), {"-serial", "none"});
    return arguments;
  }

  void write_block(std::uint64_t time_us, std::span<const can::Frame> frames) {
    std::vector<unsigned char> bytes(record_size * (1 + frames.size()));
    bytes[length_at] = tick;
    bytes[of_block_at] = static_cast<unsigned char>(frames.size());
    hal::put_bytes(std::span(bytes), data_at, time_us);
    for (std::size_t k = 0; k < frames.size(); ++k) {
      const std::span<unsigned char> to(bytes.data() + record_size * (1 + k), record_size);
      put(to, frames[k]);
      to[of_block_at] = static_cast<unsigned char>(frames.size() - 1 - k);
    }
    for (std::size_t done = 0; done < bytes.size();) {
      const ssize_t n = ::write(*to_, bytes.data() + done, bytes.size() - done);
      if (n <= 0) throw stopped();
      done += static_cast<std::size_t>(n);
    }
  }

  std::vector<can::Frame> read_block() {
    std::vector<can::Frame> frames;
    while (true) {
      const auto record = read_record();
      if (record[length_at] != nothing) frames.push_back(frame_of(record));
      if (record[of_block_at] == 0) return frames;
    }
  }

  std::span<const unsigned char> read_record() {
    int silent_ms = 0;
    while (end_ - begin_ < record_size) {
      if (begin_ > 0) {
        std::copy(bytes_.begin() + static_cast<std::ptrdiff_t>(begin_),
                  bytes_.begin() + static_cast<std::ptrdiff_t>(end_), bytes_.begin());
        end_ -= begin_;
        begin_ = 0;
      }
      const ssize_t n = ::read(*from_, bytes_.data() + end_, bytes_.size() - end_);
      if (n > 0) {
        end_ += static_cast<std::size_t>(n);
        continue;
      }
      pollfd p{*from_, POLLIN, 0};
      if (poll(&p, 1, poll_ms) > 0) continue;
      silent_ms += poll_ms;
      if (!emulator_.running() || silent_ms > longest_silence_ms) throw stopped();
    }
    begin_ += record_size;
    return {bytes_.data() + begin_ - record_size, record_size};
  }

  std::runtime_error stopped() const {
    return std::runtime_error("the emulated board has stopped: " + files::read_file(folder_.path() / "log"));
  }

  files::TemporaryFolder folder_;
  std::filesystem::path to_path_, from_path_;
  FileDescriptor to_, from_;
  images::ChildProcess emulator_;
  std::array<unsigned char, 65'536> bytes_{};
  std::size_t begin_ = 0, end_ = 0;
  bool first_ = true;
};

}  // namespace

std::unique_ptr<BoardLink> emulated_link(const std::string& board, const std::filesystem::path& image) {
  return std::make_unique<EmulatedLink>(board, image);
}

}  // namespace bms::hil
