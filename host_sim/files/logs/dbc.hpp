// Signals of a DBC file: what is needed to read numbers from foreign CAN frames. The project's own messages are
// generated from their DBC file (cmake/dbc_header.py).
//
// All sections of the format are accepted. Used are BO_, SG_ (with multiplexing), SG_MUL_VAL_, SIG_VALTYPE_, the texts
// of VAL_, and the attributes Invalid, VFrameFormat, ProtocolType and the long names. The reader is written here
// because Debian has no DBC library for C++; tests/host_sim/files/compare_dbc.py compares it with canmatrix.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace bms::files {

/// Raw values of a multiplexor, both included.
struct MultiplexRange {
  std::uint64_t low = 0, high = 0;
};

struct DbcSignal {
  std::string message, name, unit;
  std::string short_name;   ///< of at most 32 characters, if the file has a longer one; may be used in its place
  std::uint32_t id = 0;     ///< of the frame
  bool long_id = false;     ///< 29 bits
  bool any_source = false;  ///< J1939 without a source address in its id: a frame of any source has the signal
  unsigned start = 0;       ///< bit, as in the file
  unsigned length = 0;      ///< bits, 1 to 64
  bool little_endian = true, is_signed = false;
  int float_bits = 0;  ///< 32 or 64 if the bits are an IEEE number
  double factor = 1, offset = 0;
  int digits = -1;  ///< decimals that factor and offset have; -1: more than can be computed exactly
  std::int64_t factor_units = 0, offset_units = 0;  ///< factor and offset as multiples of 10^-digits
  double lowest = 0, highest = 0;       ///< values that the signal may have; no range is stated if highest <= lowest
  std::optional<std::int64_t> invalid;  ///< raw value that is sent for "not known" (attribute Invalid of the signal)
  std::vector<std::int64_t> not_available;  ///< raw values whose text in VAL_ says so
  bool is_multiplexor = false;
  std::string multiplexor;                  ///< signal of the message whose value selects this one; empty: always sent
  std::vector<MultiplexRange> selected_by;  ///< values of the multiplexor with which the signal is sent
  std::size_t line = 0;                     ///< of the file
};

/// All signals of the file. Throws BadInput if it cannot be read or has none.
std::vector<DbcSignal> read_dbc(const std::string& path);
/// The same of a text; `path` is for messages only.
std::vector<DbcSignal> parse_dbc(std::string_view text, const std::string& path);

/// The multiplexors of a signal, from its own to the one that is always sent. Empty for a signal that is always sent.
/// Throws BadInput if the message does not have one of them, or if they form a circle; `path` is for the message.
std::vector<DbcSignal> multiplexors_of(const DbcSignal& signal, const std::vector<DbcSignal>& all,
                                       const std::string& path);
/// Returns true if the frame has the signal: it is long enough, and each multiplexor has a value that selects the next.
bool is_sent(const DbcSignal& signal, std::span<const DbcSignal> multiplexors, std::span<const std::uint8_t> data);

/// Returns true if frames of this identifier have the signal.
bool is_of(const DbcSignal& signal, std::uint32_t id, bool long_id);

/// Returns true if the frame is long enough for the signal.
bool fits(const DbcSignal& signal, std::size_t bytes);
/// The bits of the signal without factor and offset. The frame must be long enough.
std::uint64_t raw_value(const DbcSignal& signal, std::span<const std::uint8_t> data);
/// Returns true if the bits mean "not available": the signal's invalid value, a value with such a text, a value outside
/// of its range, all ones of an unsigned signal, or the lowest number of a signed one; the last two of signals of eight
/// bits or more. The frame must be long enough.
bool is_missing(const DbcSignal& signal, std::span<const std::uint8_t> data);
/// The value with factor and offset, correctly rounded if both are decimals of usual size. The frame must be long
/// enough.
double value_of(const DbcSignal& signal, std::span<const std::uint8_t> data);

}  // namespace bms::files
