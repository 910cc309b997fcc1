// Records that outlive the power: an append-only log in the sectors of hal/flash.hpp. After whatever happened, open()
// finds the newest complete record of each type.
//
//   sector   line 0: the mark "was erased to the end"; then records. A line has 16 bytes.
//   record   header of one line: number, type and layout and length, CRC-32 of it all (written last), CRC-32 of the
//   first two; payload number   of a record: of its line, counted through all rounds, modulo 2^32; what is written
//   later has the higher one
//
// One sector is in charge: it holds the newest of every record. When it is full, those that are still good are copied
// into the next erased one and the new record is written behind them; with that record the next sector is in charge. So
// a sector that is not in charge holds nothing that is needed and may be erased at any time, and an interrupted move is
// begun again. The sectors go round: all wear alike.
//
// A word that was being programmed when the power went may read well now and badly later. So before anything else is
// written after boot, what lies behind the last complete record is made void, and that record is written once more.
//
// A type may have several layouts. A record replaces those of its type with the same or an older layout; one of a newer
// layout, which this firmware cannot read, stays and is copied on.
//
// Erasing is apart from storing, because it takes half a second: store() never erases, it says `needs_erase`;
// erase_next_sector() is called when the core may stand still. Time of store(): 16 us a word (100 at most), a record of
// 32 bytes 0.2 ms (1.2 at most); when it moves into the next sector up to 4 KiB of records more, 16 ms (0.1 s at most).
// open(): reads all sectors twice, 20 ms for 48 KiB at 168 MHz.
//
// No heap. Never fails, only says less: without flash, or with one good sector left, store() returns `refused`.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "hal/flash.hpp"

namespace bms::storage {

inline constexpr std::uint32_t line_bytes = 16;
inline constexpr std::size_t max_payload_bytes = 240;
inline constexpr std::size_t max_sectors = 8;
inline constexpr std::size_t max_records = 16;  ///< records that are in force at the same time

enum class StoreResult : std::uint8_t {
  stored,       ///< it is in flash and was read back
  needs_erase,  ///< no erased sector: after erase_next_sector() it will be
  rejected,     ///< no flash, no good sector, or more than the log can hold
};

/// type: 0 to 127; layout: of its payload, counted up.
struct Kind {
  std::uint8_t type, layout;
  constexpr bool operator==(const Kind&) const = default;
};

/// Where a record is.
struct RecordLocation {
  Kind kind;
  std::uint8_t sector;
  std::uint8_t length;  ///< of the payload [bytes]
  std::uint16_t line;   ///< of the header
  std::uint32_t number;
};

class Log {
 public:
  /// Once, at boot. Writes nothing.
  void open();

  struct LoadedRecord {
    std::uint8_t layout;
    std::span<const std::uint8_t> payload;  ///< in `into`
  };
  /// The newest record of a type whose layout is known_layout at most.
  std::optional<LoadedRecord> load(std::uint8_t type, std::uint8_t known_layout,
                                   std::span<std::uint8_t, max_payload_bytes> into);
  /// All that are in force, of whatever type and layout.
  std::span<const RecordLocation> current_records() const { return std::span(records_).first(record_count_); }

  StoreResult store(Kind kind, std::span<const std::uint8_t> payload);

  /// Whether there is a sector to erase ahead of time.
  bool needs_erase() const;
  /// Erases one sector if one is to be: the core stands still meanwhile. False: that sector is broken.
  bool erase_next_sector();

  std::uint32_t sectors() const { return size_.sectors; }
  std::uint32_t broken() const;        ///< sectors that did not erase, or did not keep what was written, since open()
  bool operational() const;            ///< there are two good sectors, which a log needs to go on
  std::uint32_t erase_cycles() const;  ///< how often each sector was erased so far: its number of lines says

 private:
  enum class Sector : std::uint8_t { dirty, erased, broken };
  struct Header {
    Kind kind;
    bool copy;
    std::uint8_t length;
    std::uint32_t number, crc;
  };
  /// What lies in a sector.
  struct Survey {
    bool begun;              ///< a header of a record, complete or not
    bool any, original;      ///< a complete record; one that is not a copy
    std::uint32_t base;      ///< number of its line 0 in the round it was written in
    std::uint16_t last_end;  ///< line behind the last complete record
    RecordLocation last;
  };
  static constexpr std::uint8_t none = 0xFF;

  bool scan();
  std::optional<RecordLocation> newest(std::uint8_t type, std::uint8_t known_layout) const;
  std::optional<std::span<const std::uint8_t>> read(const RecordLocation& record,
                                                    std::span<std::uint8_t, max_payload_bytes> into) const;
  template <class See>
  Survey survey(std::uint8_t sector, See&& see) const;
  void find_active_sector(std::span<const Survey> found);
  std::optional<Header> identity_in(const std::array<std::uint8_t, line_bytes>& bytes, std::uint16_t line) const;
  bool complete(const Header& header, std::uint8_t sector, std::uint16_t line) const;
  bool blank(std::uint8_t sector, std::uint16_t from, std::uint16_t lines) const;
  bool marked(std::uint8_t sector) const;
  bool mark(std::uint8_t sector) const;
  bool unmark(std::uint8_t sector) const;
  void add_record(const RecordLocation& record);

  bool secure_last_record();
  void void_torn_records();
  void copy_records_from(std::uint8_t sector);
  StoreResult append(Kind kind, std::span<const std::uint8_t> payload, std::uint16_t spare);
  StoreResult move(Kind kind, std::span<const std::uint8_t> payload);
  bool move_into(std::uint8_t sector, std::uint32_t base, Kind kind, std::span<const std::uint8_t> payload);
  bool write(const RecordLocation& record, bool copy, std::span<const std::uint8_t> payload) const;
  std::uint8_t after(std::uint32_t steps) const;

  hal::FlashSize size_{};
  std::uint16_t lines_ = 0;  ///< of a sector
  std::array<Sector, max_sectors> state_{};
  std::uint8_t active_sector_ = none;
  std::uint32_t base_ = 0;              ///< number of line 0 of the sector in charge
  std::uint16_t next_ = 0;              ///< line to write to
  bool interrupted_ = false;            ///< a move was begun: nothing may be added to the sector in charge any more
  bool last_record_secured_ = false;    ///< nothing that was written before boot is in doubt
  std::optional<RecordLocation> last_;  ///< the last complete record, and the line behind it, when the log was opened
  std::uint16_t last_end_ = 0;
  std::array<RecordLocation, max_records> records_{};
  std::size_t record_count_ = 0;
};

}  // namespace bms::storage
