// A recording into a firmware that listens on a CAN interface, in lock step: the frames of a sample, then wait for the
// status frame that ends what it is answered with.
//
//   feed_samples INTERFACE RECORDING.csv SOC SIGMA
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "files/recording.hpp"
#include "hal/sample_frames.hpp"
#include "host_sim/replay.hpp"

namespace {

using namespace bms;

constexpr canid_t status_id = 0x182;

void send(int bus, const can::Frame& frame) {
  can_frame raw{};
  raw.can_id = frame.id;
  raw.can_dlc = frame.length;
  std::memcpy(raw.data, frame.data.data(), frame.data.size());
  while (write(bus, &raw, sizeof raw) != static_cast<ssize_t>(sizeof raw)) usleep(1'000);  // the queue is full
}

bool answered(int bus) {
  can_frame raw{};
  pollfd p{bus, POLLIN, 0};
  while (poll(&p, 1, 20'000) > 0) {
    if (read(bus, &raw, sizeof raw) == static_cast<ssize_t>(sizeof raw) && raw.can_id == status_id) return true;
  }
  return false;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  const int bus = socket(PF_CAN, SOCK_RAW, CAN_RAW);
  const can_filter status{status_id, CAN_SFF_MASK};
  setsockopt(bus, SOL_CAN_RAW, CAN_RAW_FILTER, &status, sizeof status);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(if_nametoindex(argv[1]));
  if (address.can_ifindex == 0 || bind(bus, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    std::perror(argv[1]);
    return 1;
  }
  send(bus,
       hal::frame_of(host_sim::starting_point(host_sim::SocPrior{std::atof(argv[3]), std::atof(argv[4])}).value()));
  std::size_t fed = 0;
  for (const measurement::Sample& sample : measurement::samples(files::read_recording(argv[2]))) {
    for (const can::Frame& frame : hal::frames_of(sample)) send(bus, frame);
    if (!answered(bus)) {
      std::fprintf(stderr, "no answer to sample %zu\n", fed);
      return 1;
    }
    ++fed;
  }
  std::printf("%zu samples\n", fed);
}
