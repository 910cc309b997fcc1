// Signals of a DBC file: only what is needed to read numbers from foreign CAN frames. The project's own messages are
// generated from their DBC file (cmake/dbc_header.py).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace bms::files {

struct DbcSignal {
  std::string message, name, unit;
  std::uint32_t id = 0;  ///< of the frame
  bool long_id = false;  ///< 29 bits
  unsigned start = 0;    ///< bit, as in the file
  unsigned length = 0;   ///< bits, 1 to 64
  bool little_endian = true, is_signed = false;
  int float_bits = 0;  ///< 32 or 64 if the bits are an IEEE number
  double factor = 1, offset = 0;
  int multiplexed_by = -1;  ///< value of the multiplexor; -1: always there
  bool multiplexor = false;
};

/// All signals of the file. Throws BadInput if it cannot be read or has none.
std::vector<DbcSignal> read_dbc(const std::string& path);

/// Returns true if the frame is long enough for the signal.
bool fits(const DbcSignal& signal, std::size_t bytes);
/// The bits of the signal without factor and offset. The frame must be long enough.
std::uint64_t raw_value(const DbcSignal& signal, std::span<const std::uint8_t> data);
/// The value with factor and offset. The frame must be long enough.
double value_of(const DbcSignal& signal, std::span<const std::uint8_t> data);

}  // namespace bms::files
