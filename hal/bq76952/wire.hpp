// Bytes to and from the chip, each checked: direct commands, subcommands, data memory (SLUUBY2B, 3.1, 9.4, 13.1).
//
//   checked   behind every byte its CRC-8: of the first over all since the start (addresses, command, byte), of each
//   other over the byte alone plain     as the chip wakes: no CRC; the transfer buffer has a checksum, which is looked
//   at in both
//
// What is not acknowledged, does not check, or found a bus stuck that could be freed, is asked once more; a clock that
// was stretched for too long is not. A false means that `into` is of no use. Time: bounded by i2c_time_us() twice, and
// i2c_recover().
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/i2c.hpp"

namespace bms::hal::bq76952 {

enum class Check : std::uint8_t { plain, checked };

struct WireCounters {  // since boot; they wrap
  std::uint32_t transfers = 0, repeated = 0;
  std::uint32_t not_acknowledged = 0, stuck = 0, timed_out = 0;
  std::uint32_t bad_crc = 0;       ///< of a byte
  std::uint32_t bad_checksum = 0;  ///< of a transfer buffer, or a length that cannot be
  std::uint32_t not_ready = 0;     ///< times that an answer was not there yet
};

class Wire {
 public:
  static constexpr std::size_t most_bytes = 40;  ///< in one read

  Check check = Check::plain;

  bool read(std::uint8_t command, std::span<std::uint8_t> into);
  bool write(std::uint8_t command, std::span<const std::uint8_t> data);

  /// A word, little-endian.
  bool read_word(std::uint8_t command, std::uint16_t& word);

  /// A subcommand; or where in the data memory.
  bool select(std::uint16_t address);

  /// Of what select() has asked for; 2 ms after that it is there, typically after 0.5.
  bool fetch(std::uint16_t address, std::span<std::uint8_t> into);

  /// Data of a subcommand, or into the data memory, which takes 2 ms.
  bool send(std::uint16_t address, std::span<const std::uint8_t> data);

  /// Which way the chip talks now, and its battery status; false: it does not.
  bool find(std::uint16_t& status);

  const WireCounters& counters() const { return counters_; }

 private:
  bool transfer(std::span<const std::uint8_t> out, std::span<std::uint8_t> in);
  bool read_once(std::uint8_t command, std::span<std::uint8_t> into);
  bool bad(std::uint32_t& counter);

  WireCounters counters_;
  bool again_ = false;  ///< whether asking once more may help
};

}  // namespace bms::hal::bq76952
