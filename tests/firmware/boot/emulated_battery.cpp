#include "tests/firmware/boot/emulated_battery.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <stdexcept>

#include <fmt/format.h>

#include "boot/flash_map.hpp"
#include "files/text_file.hpp"
#include "images/emulator.hpp"

namespace bms::boot {

namespace {

using Clock = std::chrono::steady_clock;
constexpr std::size_t one_time_bytes = 64;

std::string hex(std::uint64_t value, int bytes) {
  std::string text;
  for (int k = 0; k < bytes; ++k) text += fmt::format("{:02X}", value >> (8 * k) & 0xFF);
  return text;
}

}  // namespace

EmulatedBattery::EmulatedBattery(std::filesystem::path loader) : loader_(std::move(loader)) {
  files::write_file(slots_file(), std::string(2 * (application_slot_bytes + cell_slot_bytes) + one_time_bytes, '\xFF'));
  start("power");
}

EmulatedBattery::~EmulatedBattery() { stop(); }

void EmulatedBattery::start(const char* cause) {
  const auto socket_path = folder_.path() / fmt::format("uart{}", starts_++);
  auto words = images::emulator_command(images::emulated_boards().front(), loader_,
                                        {(folder_.path() / "storage").string(), slots_file().string(), cause});
  words.insert(words.end(),
               {"-serial", "unix:" + socket_path.string() + ",server=on,wait=on", "-no-reboot", "-device",
                fmt::format("loader,file={},addr={:#x},force-raw=on", slots_file().string(), application_slots[0])});
  emulator_ = std::make_unique<images::ChildProcess>(words, folder_.path() / "log");
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, socket_path.c_str(), sizeof address.sun_path - 1);
  for (int tries = 0; tries < 3'000; ++tries) {
    socket_ = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return;
    close(socket_);
    socket_ = -1;
    usleep(10'000);
  }
  throw std::runtime_error("no serial line: " + files::read_file(folder_.path() / "log"));
}

void EmulatedBattery::stop() {
  emulator_.reset();
  if (socket_ >= 0) close(socket_);
  socket_ = -1;
  open_ = false;
  received_.clear();
  frames_.clear();
}

void EmulatedBattery::cut_power() {
  stop();
  start("power");
}

std::string EmulatedBattery::slot(unsigned which) const {
  return files::read_file(slots_file()).substr(which * application_slot_bytes, application_slot_bytes);
}

void EmulatedBattery::write_slot(unsigned which, const std::string& bytes) {
  std::string all = files::read_file(slots_file());
  all.replace(which * application_slot_bytes, bytes.size(), bytes);
  files::write_file(slots_file(), all);
}

std::string EmulatedBattery::last_frame_of(const std::string& id) const {
  for (auto frame = frames_.rbegin(); frame != frames_.rend(); ++frame) {
    if (frame->starts_with("t" + id)) return *frame;
  }
  return {};
}

void EmulatedBattery::to_board(const std::string& text) const {
  if (socket_ >= 0) send(socket_, text.data(), text.size(), MSG_NOSIGNAL);
}

/// Frames go to the terminal; the board's answers to single lines end here, as in an adapter. The first sign of a board
/// opens its channel.
void EmulatedBattery::from_board() {
  std::array<char, 4096> bytes;
  const ssize_t n = recv(socket_, bytes.data(), bytes.size(), MSG_DONTWAIT);
  if (n <= 0) {
    if (n == 0 || errno != EAGAIN) {
      emulator_->wait();  // the chip was reset
      stop();
      start("reset");
    }
    return;
  }
  received_.append(bytes.data(), static_cast<std::size_t>(n));
  if (!open_) to_board("O\r");
  open_ = true;
  for (std::size_t end; (end = received_.find_first_of("\r\a")) != std::string::npos; received_.erase(0, end + 1)) {
    const std::string line = received_.substr(0, end);
    if (line.empty() || line[0] != 't') continue;
    frames_.push_back(line);
    terminal_.write(line + "\r");
  }
}

void EmulatedBattery::from_terminal() {
  typed_ += terminal_.read();
  for (std::size_t end; (end = typed_.find('\r')) != std::string::npos; typed_.erase(0, end + 1)) {
    const std::string line = typed_.substr(0, end + 1);
    if (line[0] == 't' && open_) to_board(line);
    terminal_.write("\r");
  }
}

void EmulatedBattery::send_sample() {
  if (!samples || !open_ || Clock::now() < next_sample_) return;
  next_sample_ = Clock::now() + std::chrono::milliseconds(100);
  sample_us_ += 1'000'000;
  to_board("t3128" + hex(0, 4) + hex(3'290'000, 4) + "\r" + "t31D8" + hex(sample_us_, 6) + hex(2'500, 2) + "\r");
}

bool EmulatedBattery::run_until(const std::function<bool()>& done, double s) {
  const auto end = Clock::now() + std::chrono::duration<double>(s);
  while (!done()) {
    if (Clock::now() > end) return false;
    pollfd p{socket_, POLLIN, 0};
    poll(&p, 1, 1);
    from_board();
    from_terminal();
    send_sample();
  }
  return true;
}

}  // namespace bms::boot
