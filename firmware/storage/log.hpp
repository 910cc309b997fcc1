// Records that survive a loss of power: an append-only log in the sectors of hal/flash.hpp. After any interruption,
// open() finds the newest complete record of each type.
//
//   sector   line 0: the mark "completely erased"; then records. A line has 16 bytes.
//   record   header of one line: number, type, layout, length, CRC-32 of the whole record (written last), CRC-32 of the
//            first fields; then the payload
//   number   of a record: number of its line, counted through all rounds, modulo 2^32; later records have higher
//            numbers
//
// The active sector contains the newest record of each type. When it is full, the current records are copied into the
// next erased sector and the new record is written after them; with that record the next sector becomes active. A
// sector that is not active therefore contains nothing that is needed and may be erased at any time, and an interrupted
// move starts again. The sectors are used in turn, so all wear equally.
//
// A word that was being programmed when the power failed may read correctly now and wrongly later. Before the first
// write after boot, everything after the last complete record is made void, and that record is written once more.
//
// A type may have several layouts. A record replaces those of its type with the same or an older layout. A record with
// a newer layout, which this firmware cannot read, stays and is copied in each move.
//
// An erase takes half a second, so store() never erases: it returns `needs_erase`, and the caller calls
// erase_next_sector() when the core may stop. Time of store(): 16 us per word (at most 100), a record of 32 bytes 0.2
// ms (at most 1.2). A move into the next sector copies up to 4 KiB more, 16 ms (at most 0.1 s). open() reads all
// sectors twice, 20 ms for 48 KiB at 168 MHz.
//
// No heap. Without flash, or with a single good sector, store() returns `rejected`.
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
inline constexpr std::size_t max_records = 16;  ///< current records at the same time

enum class StoreResult : std::uint8_t {
  stored,       ///< written to flash and read back
  needs_erase,  ///< no erased sector; try again after erase_next_sector()
  rejected,     ///< no flash, no good sector, or more than the log can store
};

/// Which lines of the last sector a record may use while no other one is erased. The reserve is an eighth of a sector,
/// at most 96 lines; a third of it is for the last charge, the rest for what protects.
enum class Urgency : std::uint8_t {
  usual,        ///< leaves the reserve free
  last_charge,  ///< written when the supply falls
  safety,       ///< latched faults
};

/// type: 0 to 127. layout: version of the payload; newer layouts have higher numbers.
struct Kind {
  std::uint8_t type, layout;
  constexpr bool operator==(const Kind&) const = default;
};

/// Location of a record.
struct RecordLocation {
  Kind kind;
  std::uint8_t sector;
  std::uint8_t length;  ///< payload [bytes]
  std::uint16_t line;   ///< line of the header
  std::uint32_t number;
};

class Log {
 public:
  /// Call once at boot. Writes nothing.
  void open();

  struct LoadedRecord {
    std::uint8_t layout;
    std::span<const std::uint8_t> payload;  ///< part of `into`
  };
  /// Reads the newest record of a type with a layout up to known_layout.
  std::optional<LoadedRecord> load(std::uint8_t type, std::uint8_t known_layout,
                                   std::span<std::uint8_t, max_payload_bytes> into);
  /// All current records, of every type and layout.
  std::span<const RecordLocation> current_records() const { return std::span(records_).first(record_count_); }

  /// payload: at most max_payload_bytes. Never erases.
  StoreResult store(Kind kind, std::span<const std::uint8_t> payload, Urgency urgency = Urgency::usual);
  /// For one last record after store() has returned `needs_erase`: writes it into the lines that store() leaves free.
  /// Call it once, with at most 64 bytes.
  StoreResult store_in_reserve(Kind kind, std::span<const std::uint8_t> payload);

  /// Returns true if a sector can be erased in advance.
  bool needs_erase() const;
  /// Erases one sector if needs_erase(); the core stops meanwhile. Returns false if the sector is broken.
  bool erase_next_sector();

  std::uint32_t sectors() const { return size_.sectors; }
  bool has_erased_sector() const;      ///< there is room beyond the active sector
  std::uint32_t broken() const;        ///< sectors that failed to erase or to store since open()
  bool operational() const;            ///< at least two good sectors, which the log needs
  std::uint32_t erase_cycles() const;  ///< erase cycles of each sector so far, from the record numbers

 private:
  enum class Sector : std::uint8_t { dirty, erased, broken };
  struct Header {
    Kind kind;
    bool copy;
    std::uint8_t length;
    std::uint32_t number, crc;
  };
  /// Content of a sector.
  struct Survey {
    bool begun;              ///< contains a record header, complete or not
    bool any, original;      ///< contains a complete record; one that is not a copy
    std::uint32_t base;      ///< record number that its line 0 would have
    std::uint16_t last_end;  ///< line after the last complete record
    RecordLocation last;
  };
  static constexpr std::uint8_t none = 0xFF;

  bool scan();
  std::optional<RecordLocation> newest(std::uint8_t type, std::uint8_t known_layout) const;
  std::optional<std::span<const std::uint8_t>> read(const RecordLocation& record,
                                                    std::span<std::uint8_t, max_payload_bytes> into) const;
  template <class Visit>
  Survey survey(std::uint8_t sector, Visit&& visit) const;
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
  std::uint16_t reserve(Urgency urgency) const;
  bool move_into(std::uint8_t sector, std::uint32_t base, Kind kind, std::span<const std::uint8_t> payload);
  bool write(const RecordLocation& record, bool copy, std::span<const std::uint8_t> payload) const;
  std::uint8_t after(std::uint32_t steps) const;

  hal::FlashSize size_{};
  std::uint16_t lines_ = 0;  ///< lines per sector
  std::array<Sector, max_sectors> state_{};
  std::uint8_t active_sector_ = none;
  std::uint32_t base_ = 0;              ///< record number of line 0 of the active sector
  std::uint16_t next_ = 0;              ///< next line to write
  bool interrupted_ = false;            ///< a move has begun: the active sector takes no more records
  bool last_record_secured_ = false;    ///< no record written before boot is uncertain
  std::optional<RecordLocation> last_;  ///< last complete record at open(); last_end_: the line after it
  std::uint16_t last_end_ = 0;
  std::array<RecordLocation, max_records> records_{};
  std::size_t record_count_ = 0;
};

}  // namespace bms::storage
