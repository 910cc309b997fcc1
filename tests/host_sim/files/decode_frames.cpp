// Prints the signals of frames by a DBC file, for the comparison with canmatrix (compare_dbc.py).
//
//   decode_frames DBC < frames     a line a frame: identifier in hexadecimal, x behind one of 29 bits, bytes
//
// Prints for each signal that the frame has "line message signal value", the value as the bits of a double.
#include <bit>
#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/logs/dbc.hpp"

namespace {

using namespace bms::files;

std::vector<std::uint8_t> bytes_of(const std::string& text) {
  std::vector<std::uint8_t> bytes;
  for (std::size_t k = 0; k + 1 < text.size(); k += 2)
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(k, 2), nullptr, 16)));
  return bytes;
}

int print(const std::string& dbc) {
  const std::vector<DbcSignal> signals = read_dbc(dbc);
  std::vector<std::vector<DbcSignal>> multiplexors;
  for (const DbcSignal& s : signals) multiplexors.push_back(multiplexors_of(s, signals, dbc));
  std::string id, data;
  for (int line = 1; std::cin >> id >> data; ++line) {
    const bool long_id = id.ends_with('x');
    const auto number = static_cast<std::uint32_t>(std::stoul(id, nullptr, 16));
    const std::vector<std::uint8_t> bytes = bytes_of(data);
    for (std::size_t k = 0; k < signals.size(); ++k) {
      if (!is_of(signals[k], number, long_id) || !is_sent(signals[k], multiplexors[k], bytes)) continue;
      fmt::print("{} {} {} {:016x}\n", line, signals[k].message, signals[k].name,
                 std::bit_cast<std::uint64_t>(value_of(signals[k], bytes)));
    }
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  try {
    return print(argv[1]);
  } catch (const BadInput& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 2;
  }
}
