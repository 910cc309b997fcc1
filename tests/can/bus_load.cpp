// Load of the bus and worst-case response of every message of can/greybox_bms.dbc (response_time.hpp), as a table.
//
//   bus_load [BITS_PER_SECOND [SAMPLES_PER_SECOND]]      250000, 10
//
// Exit code 1 when the load is 30 % or more, or a message may come later than its next one is due.
#include <cstdlib>
#include <string>

#include <fmt/format.h>

#include "tests/can/response_time.hpp"

int main(int argc, char** argv) {
  using namespace bms::can_bus;
  char* end = nullptr;
  const double bits_per_second = argc > 1 ? std::strtod(argv[1], &end) : 250e3;
  const bool first_read = argc < 2 || *end == '\0';
  const double samples_per_second = argc > 2 ? std::strtod(argv[2], &end) : 10;
  if (argc > 3 || !first_read || (argc > 2 && *end != '\0') || !(bits_per_second > 0) || !(samples_per_second > 0)) {
    fmt::print(stderr, "usage: bus_load [BITS_PER_SECOND [SAMPLES_PER_SECOND]], numbers above 0\n");
    return 2;
  }
  constexpr double most = 0.3, sample_to_queue_s = 1e-3;
  const auto messages = messages_on_the_bus(samples_per_second, sample_to_queue_s);
  bool in_time = true;
  fmt::print("{:5} {:20} {:>9} {:>5} {:>7} {:>11}\n", "id", "message", "every ms", "bits", "load %", "response ms");
  for (std::size_t k = 0; k < messages.size(); ++k) {
    const Message& m = messages[k];
    const double response = response_on_the_bus_s(messages, k, bits_per_second);
    in_time = in_time && response <= m.period_s;
    fmt::print("{:#05x} {:20} {:9.0f} {:5} {:7.2f} {:11.2f}{}\n", m.id, m.name, 1e3 * m.period_s, worst_bits(m.length), 100 * load({m}, bits_per_second), 1e3 * response, response <= m.period_s ? "" : "  too late");
  }
  const double all = load(messages, bits_per_second);
  fmt::print("{} messages at {:.0f} bit/s and {:g} samples a second: load {:.2f} %, to be below {:.0f} %\n", messages.size(), bits_per_second, samples_per_second, 100 * all, 100 * most);
  return all < most && in_time ? 0 : 1;
}
