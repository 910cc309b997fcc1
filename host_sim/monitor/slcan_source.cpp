#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <system_error>
#include <utility>

#include "monitor/frame_source.hpp"
#include "monitor/slcan_stream.hpp"

namespace bms::monitor {

namespace {

class Slcan : public FrameSource {
 public:
  Slcan(const std::string& device, char speed) : fd_(open(device.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)) {
    if (fd_ < 0)
      throw SourceError(device, 1,
                        "cannot be opened, expected a serial port (" + std::generic_category().message(errno) + ")");
    if (tcgetattr(fd_, &before_) != 0) {
      close(fd_);
      throw SourceError(device, 1, "is not a serial port, expected one, for example /dev/ttyACM0");
    }
    termios raw = before_;
    cfmakeraw(&raw);
    raw.c_cflag |= CLOCAL | CREAD;
    cfsetspeed(&raw, B921600);
    tcsetattr(fd_, TCSANOW, &raw);
    tcflush(fd_, TCIOFLUSH);
    send(std::string("\rC\rS") + speed + "\rO\r");  // the first \r ends a partial line of the adapter
  }
  ~Slcan() override {
    send("C\r");
    tcsetattr(fd_, TCSANOW, &before_);
    close(fd_);
  }
  Slcan(const Slcan&) = delete;
  Slcan& operator=(const Slcan&) = delete;

  std::size_t read(std::span<BusFrame> room, int wait_ms) override {
    std::size_t taken = decode(room);
    if (taken > 0 || ended_) return taken;
    pollfd p{fd_, POLLIN, 0};
    if (poll(&p, 1, wait_ms) <= 0) return 0;
    const ssize_t n = ::read(fd_, bytes_.data(), bytes_.size());
    if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR)) ended_ = true;  // unplugged: end of file, or EIO
    if (n <= 0) return 0;
    used_ = 0;
    size_ = static_cast<std::size_t>(n);
    at_us_ = clock_us();
    return decode(room);
  }
  bool ended() const override { return ended_; }
  bool send(const can::Frame& frame) override {
    std::array<char, hal::slcan::longest_frame> text;
    return send(hal::slcan::encode(frame, text));
  }
  bool live() const override { return true; }

 private:
  static constexpr int most_tries = 100, retry_us = 10'000;

  /// Returns false if the adapter did not take the text within a second.
  bool send(std::string_view text) const {
    for (int tries = 0; tries < most_tries && !text.empty(); ++tries) {
      const ssize_t n = write(fd_, text.data(), text.size());
      if (n > 0)
        text.remove_prefix(static_cast<std::size_t>(n));
      else if (n < 0 && errno != EAGAIN && errno != EINTR)
        return false;
      else
        usleep(retry_us);
    }
    return text.empty();
  }
  std::size_t decode(std::span<BusFrame> room) {
    std::size_t taken = 0;
    while (used_ < size_ && taken < room.size()) {
      if (!stream_.push(bytes_[used_++], room[taken])) continue;
      room[taken++].time_us = at_us_;
    }
    malformed_ = stream_.malformed();
    return taken;
  }

  int fd_ = -1;
  termios before_{};
  bool ended_ = false;
  SlcanStream stream_;
  std::array<char, 4096> bytes_{};
  std::size_t used_ = 0, size_ = 0;
  std::int64_t at_us_ = 0;
};

}  // namespace

std::unique_ptr<FrameSource> open_slcan(const std::string& device, unsigned kbit_s) {
  const std::pair<unsigned, char> speeds[] = {{125, '4'}, {250, '5'}, {500, '6'}, {1'000, '8'}};
  for (const auto& [rate, speed] : speeds) {
    if (rate == kbit_s) return std::make_unique<Slcan>(device, speed);
  }
  throw SourceError(device, 1, "has a bit rate that is unknown, expected rate=125, 250, 500 or 1000");
}

}  // namespace bms::monitor
