// Any bytes as a candump log: its lines go to the parser, the frames to the bus state, and the state to a screen. A
// parsed frame that is written and parsed again must be equal.
#include <cstddef>
#include <cstdint>
#include <string>

#include "monitor/bus_state.hpp"
#include "monitor/candump_line.hpp"
#include "monitor/results.hpp"
#include "monitor/screen.hpp"
#include "tests/fuzz/require.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace bms::monitor;
  DumpLines lines;
  BusState bus;
  for (std::size_t k = 0; k < size; ++k) {
    if (!lines.push(static_cast<char>(data[k]))) continue;
    BusFrame frame;
    if (!parse_dump_line(lines.line(), frame)) continue;
    require(frame.length <= (frame.kind == FrameKind::fd ? 64 : 8));
    bus.receive(frame);
    std::string written;
    append_dump_line(written, frame, "can0");
    BusFrame again;
    written.pop_back();
    require(parse_dump_line(written, again));
    require(again.id == frame.id && again.kind == frame.kind && again.length == frame.length &&
            again.data == frame.data && again.time_us == frame.time_us);
  }
  require(bus.unknown_ids().size() <= 64 && bus.accepted() <= bus.frames());
  const ScreenSize size_of_screen{1 + size % 200, 1 + size % 60};
  const auto picture = screen(bus, {}, size_of_screen);
  require(picture.size() <= size_of_screen.rows);
  for (const ScreenLine& line : picture) require(line.columns() <= size_of_screen.columns);
  require(!json_of(bus, {}).empty() && !csv_row(bus).empty() && !status_line(bus, {}).empty());
  return 0;
}
