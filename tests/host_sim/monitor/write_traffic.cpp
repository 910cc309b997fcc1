// Writes the traffic of tests/host_sim/monitor/traffic.hpp to standard output at a constant rate:
//
//   write_traffic dump  FRAMES_PER_S SECONDS       candump lines; FRAMES_PER_S 0: as fast as they are read
//   write_traffic slcan FRAMES_PER_S SECONDS       SLCAN lines, as a serial adapter sends them
//
// At the end it writes the number of frames to standard error.
#include <time.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>

#include "hal/slcan/codec.hpp"
#include "monitor/candump_line.hpp"
#include "monitor/frame_source.hpp"
#include "tests/host_sim/monitor/traffic.hpp"

namespace {

bool put(const std::string& text) {
  for (std::size_t at = 0; at < text.size();) {
    const ssize_t n = write(STDOUT_FILENO, text.data() + at, text.size() - at);
    if (n <= 0) return false;
    at += static_cast<std::size_t>(n);
  }
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace bms;
  if (argc != 4) return 2;
  const bool slcan = std::string(argv[1]) == "slcan";
  const double per_s = std::atof(argv[2]), seconds = std::atof(argv[3]);
  constexpr double frames_per_sample = 4;
  const auto step_us = static_cast<std::int64_t>(per_s > 0 ? 1e6 * frames_per_sample / per_s : 10'000);
  const std::int64_t begin_us = monitor::clock_us();
  monitor::Traffic traffic(begin_us, step_us);
  unsigned long frames = 0;
  std::string text;
  while (true) {
    const auto sample = traffic.sample();
    if (traffic.now_us() - begin_us >= static_cast<std::int64_t>(1e6 * seconds)) break;
    for (const monitor::BusFrame& frame : sample) {
      std::array<char, hal::slcan::longest_frame> line;
      if (slcan)
        text += hal::slcan::encode(to_can_frame(frame), line);
      else
        monitor::append_dump_line(text, frame, "can0");
      ++frames;
    }
    const std::int64_t early_us = traffic.now_us() - monitor::clock_us();
    if (per_s > 0 && early_us > 0) usleep(static_cast<useconds_t>(early_us));
    if ((per_s > 0 || text.size() > 60'000) && !put(text)) break;
    if (per_s > 0 || text.size() > 60'000) text.clear();
  }
  put(text);
  std::fprintf(stderr, "%lu\n", frames);
}
