#include "monitor/frame_source.hpp"

#include <ctime>

namespace bms::monitor {

std::int64_t clock_us() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000 + now.tv_nsec / 1'000;
}

std::unique_ptr<FrameSource> open_source(const std::string& name) {
  if (name.starts_with("file:")) return open_dump(name.substr(5));
  if (name.starts_with("slcan:")) return open_slcan(name.substr(6));
  if (name.empty() || name.find_first_of(":/. ") != std::string::npos) {
    throw SourceError(name, 1, "unknown source, expected a CAN interface (can0), slcan:DEVICE or file:DUMP.log");
  }
  return open_socketcan(name);
}

}  // namespace bms::monitor
