// Sends a recording to firmware on a CAN interface in lock step: the frames of a sample, then it waits for the status
// frame that ends the answer. For each frame of the firmware it sends one frame of noise to a second interface. The
// amount of noise is therefore bounded, and the buffers of all readers hold it even on a slow machine.
//
//   feed_samples INTERFACE NOISE_INTERFACE RECORDING.csv SOC SIGMA
//
// Prints the last status frame, as candump -L does, and the number of samples.
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <random>
#include <span>

#include "files/recording.hpp"
#include "hal/sample_frames.hpp"
#include "replay/replay.hpp"

namespace {

using namespace bms;

constexpr canid_t status_id = 0x182;
constexpr std::array bms_ids{can_filter{0x180, 0x7E0}};
constexpr int patience_ms = 120'000;  // a limit for a failure, not for a slow machine

/// A raw socket with receive filters; -1 if the interface does not exist.
int open_bus(const char* interface, std::span<const can_filter> filters) {
  const int bus = socket(PF_CAN, SOCK_RAW, CAN_RAW), on = 1;
  setsockopt(bus, SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), static_cast<socklen_t>(filters.size_bytes()));
  setsockopt(bus, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(if_nametoindex(interface));
  if (address.can_ifindex != 0 && bind(bus, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0)
    return bus;
  std::perror(interface);
  return -1;
}

void send(int bus, const can::Frame& frame) {
  can_frame raw{};
  raw.can_id = frame.id;
  raw.can_dlc = frame.length;
  std::memcpy(raw.data, frame.data.data(), frame.data.size());
  while (write(bus, &raw, sizeof raw) != static_cast<ssize_t>(sizeof raw)) usleep(1'000);  // while the queue is full
}

/// Sends frames that are not those of the BMS.
class Noise {
 public:
  explicit Noise(int bus) : bus_(bus) {}
  bool send() {
    canfd_frame raw{};
    const unsigned kind = sent_++ % 8;  // 0: remote, 1 and 2: long, 3: CAN FD, 4: of any length
    raw.can_id = 0x5A5;
    if (kind == 0) raw.can_id = 0x6A6U | CAN_RTR_FLAG;
    if (kind == 1 || kind == 2) raw.can_id = (random_() & CAN_EFF_MASK) | CAN_EFF_FLAG;
    raw.len = 8;
    if (kind == 3) raw.len = 64;
    if (kind == 4) raw.len = static_cast<__u8>(random_() % 9);
    for (__u8& byte : raw.data) byte = static_cast<__u8>(random_());
    const std::size_t bytes = kind == 3 ? CANFD_MTU : CAN_MTU;
    return write(bus_, &raw, bytes) == static_cast<ssize_t>(bytes);
  }

 private:
  int bus_;
  unsigned sent_ = 0;
  std::mt19937 random_{1};
};

/// Returns the status frame, or nothing if it does not arrive. Sends one frame of noise per received frame.
std::optional<can_frame> answer(int bus, Noise& noise) {
  can_frame raw{};
  pollfd p{bus, POLLIN, 0};
  while (poll(&p, 1, patience_ms) > 0) {
    if (read(bus, &raw, sizeof raw) != static_cast<ssize_t>(sizeof raw)) continue;
    if (!noise.send()) return std::nullopt;
    if (raw.can_id == status_id) return raw;
  }
  return std::nullopt;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 6) return 2;
  const int bus = open_bus(argv[1], bms_ids), noisy = open_bus(argv[2], {});
  if (bus < 0 || noisy < 0) return 1;
  Noise noise(noisy);
  send(bus, hal::frame_of(replay::starting_point(replay::SocPrior{std::atof(argv[4]), std::atof(argv[5])}).value()));
  std::size_t fed = 0;
  can_frame last{};
  for (const measurement::Sample& sample : measurement::samples(files::read_recording(argv[3]))) {
    for (const can::Frame& frame : hal::frames_of(sample)) send(bus, frame);
    const auto status = answer(bus, noise);
    if (!status) {
      std::fprintf(stderr, "no answer to sample %zu\n", fed);
      return 1;
    }
    last = *status;
    ++fed;
  }
  std::printf("last frame %03X#", last.can_id);
  for (unsigned k = 0; k < last.can_dlc; ++k) std::printf("%02X", last.data[k]);
  std::printf("\n%zu samples\n", fed);
}
