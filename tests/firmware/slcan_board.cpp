#include "tests/firmware/slcan_board.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <stdexcept>

#include <fmt/format.h>

#include "files/text_file.hpp"
#include "images/emulator.hpp"

namespace bms::firmware {

namespace {

std::vector<std::string> command(const images::EmulatedBoard& board, const std::filesystem::path& image,
                                 const std::vector<std::string>& arguments, const std::vector<std::string>& more,
                                 const std::filesystem::path& socket) {
  auto words = images::emulator_command(board, image, arguments);
  words.insert(words.end(), {"-serial", "unix:" + socket.string() + ",server=on,wait=on"});
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

std::string hex(std::uint64_t value, int bytes) {
  std::string text;
  for (int k = 0; k < bytes; ++k) text += fmt::format("{:02X}", value >> (8 * k) & 0xFF);
  return text;
}

std::uint64_t little_endian(const std::string& frame, std::size_t at, std::size_t bytes) {
  std::uint64_t value = 0;
  for (std::size_t k = 0; k < bytes; ++k)
    value |= static_cast<std::uint64_t>(std::stoul(frame.substr(5 + 2 * (at + k), 2), nullptr, 16)) << (8 * k);
  return value;
}

}  // namespace

SlcanBoard::SlcanBoard(const std::filesystem::path& image, const std::vector<std::string>& arguments,
                       const std::vector<std::string>& more, const images::EmulatedBoard& board)
    : emulator_(command(board, image, arguments, more, folder_.path() / "uart"), folder_.path() / "log") {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string path = (folder_.path() / "uart").string();
  std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
  for (int tries = 0; tries < 12'000; ++tries) {
    line_ = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (connect(line_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return;
    close(line_);
    usleep(10'000);
  }
  throw std::runtime_error("no serial line: " + files::read_file(folder_.path() / "log"));
}

SlcanBoard::~SlcanBoard() { close(line_); }

void SlcanBoard::write(const std::string& bytes) const {
  for (std::size_t sent = 0; sent < bytes.size();) {
    const ssize_t n = ::send(line_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (n <= 0) throw std::runtime_error("the serial line is closed");
    sent += static_cast<std::size_t>(n);
  }
}

std::string SlcanBoard::read() {
  while (true) {
    const std::size_t end = received_.find_first_of("\r\a");
    if (end != std::string::npos) {
      std::string line = received_.substr(0, end);
      if (received_[end] == '\a') line += '\a';
      received_.erase(0, end + 1);
      return line;
    }
    pollfd p{line_, POLLIN, 0};
    std::array<char, 4096> bytes;
    const ssize_t n = poll(&p, 1, 120'000) > 0 ? recv(line_, bytes.data(), bytes.size(), 0) : 0;
    if (n <= 0) throw std::runtime_error("the board has stopped sending after: " + received_);
    received_.append(bytes.data(), static_cast<std::size_t>(n));
  }
}

std::string SlcanBoard::read_until(const std::string& what) {
  while (true) {
    const std::string line = read();
    if (line.starts_with(what)) return line;
  }
}

void SlcanBoard::send_sample(std::uint64_t time_us, std::int32_t current_ua, std::int32_t voltage_uv,
                             std::int16_t temperature_cdegc) const {
  write("t3128" + hex(static_cast<std::uint32_t>(current_ua), 4) + hex(static_cast<std::uint32_t>(voltage_uv), 4) +
        "\r" + "t31D8" + hex(time_us, 6) + hex(static_cast<std::uint16_t>(temperature_cdegc), 2) + "\r");
}

BoardTelemetry SlcanBoard::telemetry() {
  BoardTelemetry t;
  const std::string state = read_until("t1808"), electrical = read_until("t1818"), detail = read_until("t1898"),
                    status = read_until("t1828");
  const auto signed_24 = [](std::uint64_t raw) { return static_cast<std::int32_t>(raw << 8) >> 8; };
  t.soc_quality = static_cast<unsigned>(little_endian(state, 1, 1) >> 4);
  t.soc = static_cast<unsigned>(little_endian(state, 2, 2));
  t.soc_sigma = static_cast<unsigned>(little_endian(state, 4, 2));
  t.soc_display = static_cast<unsigned>(little_endian(state, 6, 2));
  t.voltage = static_cast<unsigned>(little_endian(electrical, 2, 2));
  t.current = static_cast<std::int16_t>(little_endian(electrical, 4, 2));
  t.temperature = static_cast<std::int16_t>(little_endian(electrical, 6, 2));
  t.v_rc_uv = signed_24(little_endian(detail, 2, 3));
  t.voltage_predicted_uv = signed_24(little_endian(detail, 5, 3));
  t.flags = static_cast<std::uint32_t>(little_endian(status, 2, 4));
  t.sample_counter = static_cast<unsigned>(little_endian(status, 6, 2));
  t.status_counter = static_cast<unsigned>(little_endian(status, 1, 1) & 15);
  t.reset_cause = static_cast<unsigned>(little_endian(status, 1, 1) >> 4);
  return t;
}

}  // namespace bms::firmware
