// Any bytes from a serial adapter: all frames are valid, and a complete frame after any bytes is read.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "monitor/bus_state.hpp"
#include "monitor/slcan_stream.hpp"
#include "tests/fuzz/require.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace bms::monitor;
  SlcanStream stream;
  BusState bus;
  BusFrame frame;
  for (std::size_t k = 0; k < size; ++k) {
    if (!stream.push(static_cast<char>(data[k]), frame)) continue;
    require(frame.length <= 8 && frame.id <= (frame.long_id ? 0x1FFF'FFFFU : 0x7FFU));
    bus.receive(frame);
  }
  bool whole = false;
  for (const char c : std::string_view("\rt1232AB12\r")) whole = stream.push(c, frame);
  require(whole && frame.id == 0x123 && frame.length == 2 && frame.data[1] == 0x12);
  return 0;
}
