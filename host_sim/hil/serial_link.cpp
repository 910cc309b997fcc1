#include <fcntl.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <chrono>
#include <stdexcept>
#include <string_view>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "files/bad_input.hpp"
#include "hal/sample_frames.hpp"
#include "hal/slcan/codec.hpp"
#include "hil/board_link.hpp"

namespace bms::hil {

namespace {

class SerialLink : public BoardLink {
 public:
  explicit SerialLink(const std::string& port) : fd_(open(port.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC)) {
    if (fd_ < 0)
      throw files::BadInput(port, 1, "cannot be opened, expected the serial port of a board or a pseudo-terminal");
    termios line{};
    if (tcgetattr(fd_, &line) == 0) {
      cfmakeraw(&line);
      cfsetspeed(&line, B921600);
      tcsetattr(fd_, TCSANOW, &line);
    }
    send("\rC\rS6\rO\r");  // end a partial line, close, 500 kbit/s, open
    listen(0, start_up_ms);
  }
  SerialLink(const SerialLink&) = delete;
  SerialLink& operator=(const SerialLink&) = delete;
  ~SerialLink() override {
    try {
      send("C\r");
    } catch (const std::exception&) {  // the port is already closed
    }
    close(fd_);
  }

  std::vector<can::Frame> exchange(double, std::span<const can::Frame> frames) override {
    std::array<char, hal::slcan::longest_frame> text;
    std::string lines;
    bool has_sample = false;
    for (const can::Frame& f : frames) {
      lines += hal::slcan::encode(f, text);
      has_sample = has_sample || f.id == hal::time_frame_id;
    }
    send(lines);
    return has_sample ? listen(can::Status::id, answer_ms) : listen(0, other_answer_ms);
  }

 private:
  static constexpr int start_up_ms = 200, answer_ms = 1'000, other_answer_ms = 20;

  void send(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t n = ::write(fd_, bytes.data(), bytes.size());
      if (n <= 0) throw std::runtime_error("the serial port is closed");
      bytes.remove_prefix(static_cast<std::size_t>(n));
    }
  }

  /// Frames until one with the id `last_id` (0: none), for at most `most_ms`.
  std::vector<can::Frame> listen(std::uint16_t last_id, int most_ms) {
    std::vector<can::Frame> frames;
    const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(most_ms);
    while (true) {
      const auto left =
          std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now()).count();
      pollfd p{fd_, POLLIN, 0};
      if (left <= 0 || poll(&p, 1, static_cast<int>(left)) <= 0) return frames;
      std::array<char, 4096> bytes;
      const ssize_t n = ::read(fd_, bytes.data(), bytes.size());
      if (n <= 0) throw std::runtime_error("the board has closed its serial port");
      bool ended = false;
      for (const char byte : std::string_view(bytes.data(), static_cast<std::size_t>(n))) {
        can::Frame frame;
        if (!reader_.push(byte) || !hal::slcan::decode(reader_.line(), frame)) continue;
        frames.push_back(frame);
        ended = ended || (last_id != 0 && frame.id == last_id);
      }
      if (ended) return frames;
    }
  }

  int fd_;
  hal::slcan::LineReader reader_;
};

}  // namespace

std::unique_ptr<BoardLink> serial_link(const std::string& port) { return std::make_unique<SerialLink>(port); }

}  // namespace bms::hil
