// Stored records and their layout: little-endian, field after field (hal/bytes.hpp). A record is decoded only if it has
// the length of its layout. Older layouts are read by the code that remains for them here.
//
//   type      layout  bytes  content
//   charge    2       32     state of charge, charge counters, time in operation; the only record that is written often
//             1       8      (older) state of charge alone
//   cells     1       1+4n   each cell relative to the mean
//   health    1       16     capacity and resistance
//   events    2       230    starts, resets by cause, the last sixteen faults with readings of the pack
//             1       118    (older) without readings
//   settings  1       3+6n   values by key
//   extremes  1       12     lowest and highest readings so far
//   actions   1       180    what service sessions have done (actions_record.hpp)
//   copy      1       3+6n   the settings once more: they contain what protects, and are written rarely
//   parameters, copy  1  3+4n  what a workshop has set (firmware/parameters/)
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "estimator/restart.hpp"
#include "hal/bytes.hpp"
#include "storage/log.hpp"

namespace bms::storage {

inline constexpr Kind parameters_kind{9, 1}, parameters_copy_kind{10, 1};

using Payload = std::span<std::uint8_t, max_payload_bytes>;
using Bytes = std::span<const std::uint8_t>;

/// Writes the fields of a record in order.
class Encoder {
 public:
  constexpr explicit Encoder(Payload into) : into_(into) {}
  template <class T>
  constexpr Encoder& put(T value, std::size_t size = sizeof(T)) {
    hal::put_bytes(into_, at_, value, size);
    at_ += size;
    return *this;
  }
  constexpr Bytes bytes() const { return into_.first(at_); }

 private:
  Payload into_;
  std::size_t at_ = 0;
};

/// Reads the fields of a record in order; zeros beyond its end.
class Decoder {
 public:
  constexpr explicit Decoder(Bytes from) : from_(from) {}
  template <class T>
  constexpr void get(T& value, std::size_t size = sizeof(T)) {
    value = at_ + size <= from_.size() ? hal::get_bytes<T>(from_, at_, size) : T{};
    at_ += size;
  }
  template <class T>
  constexpr T read() {
    T value;
    get(value);
    return value;
  }

 private:
  Bytes from_;
  std::size_t at_ = 0;
};

struct ChargeRecord {
  static constexpr Kind kind{1, 2};

  estimator::StoredEstimate pack;
  /// Possible movement of soc after this record: its movement in the minute before; 0 at a shutdown.
  std::uint32_t moved_ppb = 0;
  std::uint64_t charged_uah = 0, discharged_uah = 0;
  std::uint32_t operating_s = 0;
  std::uint32_t calendar_s = 0;  ///< hal/calendar.hpp; 0: no clock

  constexpr bool operator==(const ChargeRecord&) const = default;
};

/// Full cycles in 1/1000: discharged charge over the capacity.
constexpr std::uint64_t cycles_milli(const ChargeRecord& r, std::uint32_t capacity_uah) {
  return capacity_uah == 0 ? 0 : r.discharged_uah * 1'000 / capacity_uah;
}

constexpr Bytes encode(const ChargeRecord& r, Payload into) {
  return Encoder(into)
      .put(r.pack.soc_ppb)
      .put(r.pack.soc_sigma_ppb)
      .put(r.moved_ppb)
      .put(r.charged_uah, 6)
      .put(r.discharged_uah, 6)
      .put(r.operating_s)
      .put(r.calendar_s)
      .bytes();
}

/// Clamps soc to 0..1; the estimator's may be a little beyond. If soc is further out, or sigma is impossible, sigma is
/// set to that of an unknown soc.
constexpr estimator::StoredEstimate plausible(estimator::StoredEstimate e) {
  constexpr std::int32_t one = 1'000'000'000, beyond = one / 4, unknown_sigma = 289'000'000;
  if (e.soc_ppb < -beyond || e.soc_ppb > one + beyond || e.soc_sigma_ppb <= 0 || e.soc_sigma_ppb > unknown_sigma)
    e.soc_sigma_ppb = unknown_sigma;
  e.soc_ppb = std::clamp(e.soc_ppb, std::int32_t{0}, one);
  return e;
}

constexpr bool decode(Bytes from, std::uint8_t layout, ChargeRecord& r) {
  Decoder d(from);
  if (layout == 1 && from.size() == 8) {
    // This firmware stored soc alone: the counters start at 0, and the movement of soc is unknown.
    constexpr std::uint32_t a_minute_at_1c_ppb = 16'666'667;
    r = {};
    r.moved_ppb = a_minute_at_1c_ppb;
    d.get(r.pack.soc_ppb);
    d.get(r.pack.soc_sigma_ppb);
  } else if (layout == 2 && from.size() == 32) {
    d.get(r.pack.soc_ppb);
    d.get(r.pack.soc_sigma_ppb);
    d.get(r.moved_ppb);
    d.get(r.charged_uah, 6);
    d.get(r.discharged_uah, 6);
    d.get(r.operating_s);
    d.get(r.calendar_s);
  } else {
    return false;
  }
  r.pack = plausible(r.pack);
  return true;
}

#ifndef BMS_STORED_CELLS  // an image of up to 24 cells has no memory for more (cmake/firmware.cmake)
#define BMS_STORED_CELLS 32
#endif

struct CellsRecord {
  static constexpr Kind kind{2, 1};
  static constexpr std::size_t max_cells = BMS_STORED_CELLS;
  struct Cell {
    std::int16_t soc = 0;     ///< minus the mean, in 1e-5: +-0.32
    std::uint16_t sigma = 0;  ///< in 1e-5
    constexpr bool operator==(const Cell&) const = default;
  };

  std::uint8_t count = 0;
  std::array<Cell, max_cells> cell{};
  constexpr bool operator==(const CellsRecord&) const = default;
};

constexpr Bytes encode(const CellsRecord& r, Payload into) {
  Encoder e(into);
  e.put(r.count);
  for (std::size_t k = 0; k < r.count; ++k) e.put(r.cell[k].soc).put(r.cell[k].sigma);
  return e.bytes();
}

constexpr bool decode(Bytes from, std::uint8_t layout, CellsRecord& r) {
  Decoder d(from);
  const auto count = d.read<std::uint8_t>();
  if (layout != 1 || count > CellsRecord::max_cells || from.size() != 1 + std::size_t{4} * count) return false;
  r = {};
  r.count = count;
  for (std::size_t k = 0; k < count; ++k) {
    d.get(r.cell[k].soc);
    d.get(r.cell[k].sigma);
  }
  return true;
}

/// Relative to the cell file, in 1e-6; 1,000,000 is a new cell.
struct HealthRecord {
  static constexpr Kind kind{3, 1};

  std::int32_t capacity_ppm = 0, capacity_sigma_ppm = 0, resistance_ppm = 0, resistance_sigma_ppm = 0;
  constexpr bool operator==(const HealthRecord&) const = default;
};

constexpr Bytes encode(const HealthRecord& r, Payload into) {
  return Encoder(into)
      .put(r.capacity_ppm)
      .put(r.capacity_sigma_ppm)
      .put(r.resistance_ppm)
      .put(r.resistance_sigma_ppm)
      .bytes();
}

constexpr bool decode(Bytes from, std::uint8_t layout, HealthRecord& r) {
  if (layout != 1 || from.size() != 16) return false;
  Decoder d(from);
  d.get(r.capacity_ppm);
  d.get(r.capacity_sigma_ppm);
  d.get(r.resistance_ppm);
  d.get(r.resistance_sigma_ppm);
  return true;
}

/// Lowest and highest readings of the cells, the temperature sensors and the current.
struct ReadingRange {
  enum Quantity : std::uint8_t {
    voltage,      ///< of a cell [mV], at most 8190
    temperature,  ///< in degrees C above -60, at most 254
    current,      ///< in 0.25 A, > 0 charges, at most 8191 either way
  };
  using Values = std::array<std::int16_t, 3>;
  static constexpr Values unknown{8191, 255, -8192};

  Values lowest = unknown, highest = unknown;

  [[gnu::noinline]] constexpr void add(std::size_t quantity, std::int16_t value) {
    if (value == unknown[quantity]) return;
    const bool first = lowest[quantity] == unknown[quantity];
    if (first || value < lowest[quantity]) lowest[quantity] = value;
    if (first || value > highest[quantity]) highest[quantity] = value;
  }
  constexpr void add(const ReadingRange& other) {
    for (std::size_t k = 0; k < unknown.size(); ++k) {
      add(k, other.lowest[k]);
      add(k, other.highest[k]);
    }
  }
  constexpr bool operator==(const ReadingRange&) const = default;
};

/// Readings of the pack at one time. The lowest and the highest current are equal.
struct Readings {
  std::uint8_t soc = 255;  ///< in 0.5 %; 255: not known
  ReadingRange range;
  constexpr bool operator==(const Readings&) const = default;
};

/// All readings in one word, the raw values of the signals of StoredFaultPack and StoredFaultCells in
/// firmware/can/greybox_bms.dbc. From the lowest bit: soc 8 bits, current 14, highest and lowest temperature 8 each,
/// highest and lowest voltage 13 each.
constexpr std::uint64_t packed(const Readings& r) {
  const auto low = [&r](std::size_t k) { return static_cast<std::uint32_t>(r.range.lowest[k]); };
  const auto high = [&r](std::size_t k) { return static_cast<std::uint32_t>(r.range.highest[k]); };
  using enum ReadingRange::Quantity;
  return (r.soc | (low(current) & 0x3FFFU) << 8 | high(temperature) << 22) |
         static_cast<std::uint64_t>(low(temperature) | high(voltage) << 8) << 30 |
         static_cast<std::uint64_t>(low(voltage)) << 51;
}

struct EventsRecord {
  static constexpr Kind kind{4, 2};
  static constexpr std::size_t causes = 7, max_faults = 16;
  static constexpr std::uint16_t processor_fault_code = 0xFF00;  ///< plus the exception number, at most 127
  struct Fault {
    std::uint16_t code = 0;      ///< 1 to 127, or a processor fault; 0: no fault
    std::uint32_t time_s = 0;    ///< since 1970, if the calendar clock ran (from first_unix_s on); else in operation
    std::uint64_t readings = 0;  ///< packed(Readings)
    constexpr bool operator==(const Fault&) const = default;
  };
  static constexpr std::uint32_t first_unix_s = 946'684'800;  ///< 2000-01-01: 30 years of operation

  std::uint32_t starts = 0;
  std::array<std::uint16_t, causes> resets{};  ///< by hal::ResetCause; saturates at 65,535
  std::uint32_t faults = 0;                    ///< total; the newest is at (faults - 1) modulo 16
  std::array<Fault, max_faults> fault{};

  constexpr void add(const Fault& f) { fault[faults++ % max_faults] = f; }
  /// back: 0 for the newest, at most 15.
  constexpr Fault last(std::uint32_t back) const {
    return back < faults ? fault[(faults - 1 - back) % max_faults] : Fault{};
  }
  constexpr bool operator==(const EventsRecord&) const = default;
};

/// The code of a fault in seven bits; bit 7 marks a processor fault.
constexpr std::uint8_t short_code(std::uint16_t code) {
  return static_cast<std::uint8_t>((code & 0x7F) | (code >= EventsRecord::processor_fault_code ? 0x80 : 0));
}

constexpr Bytes encode(const EventsRecord& r, Payload into) {
  Encoder e(into);
  e.put(r.starts);
  for (const auto n : r.resets) e.put(n);
  e.put(r.faults);
  for (const auto& f : r.fault) e.put(short_code(f.code)).put(f.time_s).put(f.readings);
  return e.bytes();
}

constexpr bool decode(Bytes from, std::uint8_t layout, EventsRecord& r) {
  const bool older = layout == 1 && from.size() == 118;
  if (!older && (layout != 2 || from.size() != 230)) return false;
  Decoder d(from);
  d.get(r.starts);
  for (auto& n : r.resets) d.get(n);
  d.get(r.faults);
  for (auto& f : r.fault) {
    d.get(f.code, older ? 2 : 1);
    if (!older && f.code >= 0x80)
      f.code = static_cast<std::uint16_t>(EventsRecord::processor_fault_code + f.code - 0x80);
    d.get(f.time_s);
    f.readings = packed({});
    if (!older) d.get(f.readings);
  }
  return true;
}

/// Lowest and highest readings so far.
struct ExtremesRecord {
  static constexpr Kind kind{6, 1};
  ReadingRange range;
  constexpr bool operator==(const ExtremesRecord&) const = default;
};

constexpr Bytes encode(const ExtremesRecord& r, Payload into) {
  Encoder e(into);
  for (const auto* values : {&r.range.lowest, &r.range.highest}) {
    for (const std::int16_t value : *values) e.put(value);
  }
  return e.bytes();
}

constexpr bool decode(Bytes from, std::uint8_t layout, ExtremesRecord& r) {
  if (layout != 1 || from.size() != 12) return false;
  Decoder d(from);
  for (auto* values : {&r.range.lowest, &r.range.highest}) {
    for (std::int16_t& value : *values) d.get(value);
  }
  return true;
}

/// Values set in the field, by key; a missing key has its default. The meaning of a key never changes.
struct SettingsRecord {
  static constexpr Kind kind{5, 1}, copy{8, 1};
  static constexpr std::size_t max_settings = 24;
  struct Setting {
    std::uint16_t key = 0;
    std::int32_t value = 0;
    constexpr bool operator==(const Setting&) const = default;
  };

  std::uint16_t revision = 0;  ///< incremented with each change
  std::uint8_t count = 0;
  std::array<Setting, max_settings> setting{};

  constexpr std::optional<std::int32_t> get(std::uint16_t key) const {
    for (std::size_t k = 0; k < count; ++k) {
      if (setting[k].key == key) return setting[k].value;
    }
    return std::nullopt;
  }
  /// Returns false if there is no room for another key.
  constexpr bool set(std::uint16_t key, std::int32_t value) {
    std::size_t k = 0;
    while (k < count && setting[k].key != key) ++k;
    if (k == max_settings) return false;
    if (k == count)
      ++count;
    else if (setting[k].value == value)
      return true;
    setting[k] = {key, value};
    ++revision;
    return true;
  }
  constexpr bool operator==(const SettingsRecord&) const = default;
};

constexpr Bytes encode(const SettingsRecord& r, Payload into) {
  Encoder e(into);
  e.put(r.revision).put(r.count);
  for (std::size_t k = 0; k < r.count; ++k) e.put(r.setting[k].key).put(r.setting[k].value);
  return e.bytes();
}

constexpr bool decode(Bytes from, std::uint8_t layout, SettingsRecord& r) {
  Decoder d(from);
  const auto revision = d.read<std::uint16_t>();
  const auto count = d.read<std::uint8_t>();
  if (layout != 1 || count > SettingsRecord::max_settings || from.size() != 3 + std::size_t{6} * count) return false;
  r = {};
  r.revision = revision;
  r.count = count;
  for (std::size_t k = 0; k < count; ++k) {
    d.get(r.setting[k].key);
    d.get(r.setting[k].value);
  }
  return true;
}

}  // namespace bms::storage
