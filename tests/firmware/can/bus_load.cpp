// Prints bus load and worst-case response time of every message of firmware/can/greybox_bms.dbc (response_time.hpp).
// The table includes the frames of a sample of 16 cells, which are on the bus only if another node measures the cells,
// and those of the J1939 profile. The response times hold for all of them together.
//
//   bus_load [BITS_PER_SECOND [SAMPLES_PER_SECOND]]      default: 250000, 10
//
// Exit code 1 if the load is 30 % or more in any combination, or if a message may come later than its next one is due.
#include <cstdlib>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "tests/firmware/can/response_time.hpp"

int main(int argc, char** argv) {
  using namespace bms::can_bus;
  char* end = nullptr;
  const double bits_per_second = argc > 1 ? std::strtod(argv[1], &end) : 250e3;
  const bool first_read = argc < 2 || *end == '\0';
  const double samples_per_second = argc > 2 ? std::strtod(argv[2], &end) : 10;
  if (argc > 3 || !first_read || (argc > 2 && *end != '\0') || !(bits_per_second > 0) || !(samples_per_second > 0)) {
    fmt::print(stderr, "usage: bus_load [BITS_PER_SECOND [SAMPLES_PER_SECOND]], both above 0\n");
    return 2;
  }
  constexpr double most = 0.3;
  const auto messages =
      messages_on_the_bus(samples_per_second, sample_to_queue_s, Cells::measured_by_another_node, Profile::j1939);
  bool in_time = true;
  fmt::print("{:10} {:20} {:>9} {:>5} {:>7} {:>11}\n", "id", "message", "every ms", "bits", "load %", "response ms");
  for (std::size_t k = 0; k < messages.size(); ++k) {
    const Message& m = messages[k];
    const double response = response_on_the_bus_s(messages, k, bits_per_second);
    in_time = in_time && response <= m.period_s;
    fmt::print("{:<#10x} {:20} {:9.0f} {:5} {:7.2f} {:11.2f}{}\n", m.id, m.name, 1e3 * m.period_s, worst_bits(m),
               100 * load({m}, bits_per_second), 1e3 * response, response <= m.period_s ? "" : "  too late");
  }
  fmt::print("{:.0f} bit/s, {:g} samples per second, limit of the load: {:.0f} %\n", bits_per_second,
             samples_per_second, 100 * most);
  bool light = true;
  for (const auto& [cells, measured_by] : {std::pair{Cells::measured_by_the_board, "the board measures its cells"},
                                           {Cells::measured_by_another_node, "another node measures and sends them"}}) {
    for (const auto& [profile, added] : {std::pair{Profile::none, ""},
                                         {Profile::cia418, ", with CiA 418 profile"},
                                         {Profile::j1939, ", with J1939 profile"}}) {
      const auto on_the_bus = messages_on_the_bus(samples_per_second, sample_to_queue_s, cells, profile);
      const double part = load(on_the_bus, bits_per_second);
      light = light && part < most;
      fmt::print("{:59} {:2} messages, load {:5.2f} %\n", fmt::format("{}{}", measured_by, added), on_the_bus.size(),
                 100 * part);
    }
  }
  return light && in_time ? 0 : 1;
}
