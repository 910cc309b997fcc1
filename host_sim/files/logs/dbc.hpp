// Signals of a DBC file: only what is needed to read numbers from foreign CAN frames. The project's own messages are
// generated from their DBC file (cmake/dbc_header.py).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
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
  int digits = -1;                      ///< decimals that factor and offset have; -1: more than nine
  double lowest = 0, highest = 0;       ///< values that the signal may have; no range is stated if highest <= lowest
  std::optional<std::int64_t> invalid;  ///< raw value that is sent for "not known" (attribute Invalid of the signal)
  int multiplexed_by = -1;              ///< value of the multiplexor; -1: always there
  bool multiplexor = false;
};

/// All signals of the file. Throws BadInput if it cannot be read or has none.
std::vector<DbcSignal> read_dbc(const std::string& path);
/// The same of a text; `path` is for messages only.
std::vector<DbcSignal> parse_dbc(std::string_view text, const std::string& path);

/// Returns true if the frame is long enough for the signal.
bool fits(const DbcSignal& signal, std::size_t bytes);
/// The bits of the signal without factor and offset. The frame must be long enough.
std::uint64_t raw_value(const DbcSignal& signal, std::span<const std::uint8_t> data);
/// Returns true if the bits mean "not available": the signal's invalid value, a value outside of its range, all ones of
/// an unsigned signal, or the lowest number of a signed one; the last two of signals of eight bits or more. The frame
/// must be long enough.
bool is_missing(const DbcSignal& signal, std::span<const std::uint8_t> data);
/// The value with factor and offset. The frame must be long enough.
double value_of(const DbcSignal& signal, std::span<const std::uint8_t> data);

}  // namespace bms::files
