// Bytes to and from the chip, each checked: direct commands, subcommands, data memory (SLUUBY2B, 3.1, 9.4, 13.1).
//
//   checked   a CRC-8 follows every byte: the first covers all bytes since the start (addresses, command, byte), each
//             further one only its byte
//   plain     no CRC, as the chip starts; the transfer buffer has a checksum, which is verified in both modes
//
// A transfer is repeated once if it was not acknowledged, failed its check, or found a stuck bus that could be freed.
// It is not repeated after a clock that was stretched for too long. After a result of false, `into` is undefined. Time
// of a transfer: at most twice i2c_time_us(), and i2c_recover().
//
// Two properties of the chip are not certain (README.md), so they are found out:
//   by_words   a read returns one direct command of two bytes only; then longer reads are split
//   checksum   the blocks DASTATUS have another checksum than the manual's. If it has never been right, a second read
//              with the same bytes replaces it; the CRCs protect the wire.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/bq76952/bus.hpp"

namespace bms::hal::bq76952 {

enum class Check : std::uint8_t { plain, checked };

struct WireCounters {  // since boot; they wrap
  std::uint32_t transfers = 0, repeated = 0;
  std::uint32_t not_acknowledged = 0, stuck = 0, timed_out = 0;
  std::uint32_t bad_crc = 0;       ///< wrong CRC of a byte
  std::uint32_t bad_checksum = 0;  ///< wrong checksum of a transfer buffer, or an impossible length
  std::uint32_t not_ready = 0;     ///< answers that were not ready yet
};

class Wire {
 public:
  static constexpr std::size_t most_bytes = 40;  ///< in one read

  Check check = Check::plain;
  bool by_words = false;
  [[no_unique_address]] Bus bus;

  /// Direct command: reads into.size() bytes, at most most_bytes.
  bool read(std::uint8_t command, std::span<std::uint8_t> into);
  /// Direct command: writes at most 8 bytes.
  bool write(std::uint8_t command, std::span<const std::uint8_t> data);

  /// Reads a little-endian word.
  bool read_word(std::uint8_t command, std::uint16_t& word);

  /// Sends a subcommand, or an address of the data memory.
  bool select(std::uint16_t address);

  /// Reads the answer to select(). It is ready at most 2 ms after select(), typically after 0.5 ms.
  bool fetch(std::uint16_t address, std::span<std::uint8_t> into);

  /// Writes data of a subcommand or into the data memory, which takes 2 ms.
  bool send(std::uint16_t address, std::span<const std::uint8_t> data);

  /// Determines whether the chip uses CRCs now, and reads its battery status. Returns false if it does not answer.
  bool detect(std::uint16_t& status);

  const WireCounters& counters() const { return counters_; }

 private:
  bool transfer(std::span<const std::uint8_t> out, std::span<std::uint8_t> in);
  bool read_once(std::uint8_t command, std::span<std::uint8_t> into);
  bool read_or_repeat(std::uint8_t command, std::span<std::uint8_t> into);
  bool has_another_checksum();
  bool same_again(std::span<const std::uint8_t> block);
  bool fail(std::uint32_t& counter);

  WireCounters counters_;
  bool retry_useful_ = false;           ///< a second attempt may succeed
  bool status_checksum_right_ = false;  ///< once at least
  std::uint8_t status_checksum_wrong_ = 0;
};

}  // namespace bms::hal::bq76952
