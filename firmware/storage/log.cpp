#include "storage/log.hpp"

#include <algorithm>

#include "hal/bytes.hpp"
#include "storage/crc32.hpp"
#include "storage/log_line.hpp"

namespace bms::storage {

namespace {

using hal::get_bytes;
using hal::put_bytes;

constexpr std::uint16_t longest_record = 1 + max_payload_bytes / line_bytes;
constexpr std::array<std::uint8_t, 4> zeros{};
constexpr int tries_in_a_sector = 3, max_scans = 16;
constexpr std::uint16_t most_reserve_lines = 96;
constexpr std::size_t max_reserve_bytes = 64;  // with its copy less than longest_record

/// Comparison of numbers that wrap.
constexpr bool later(std::uint32_t a, std::uint32_t b) { return static_cast<std::int32_t>(a - b) > 0; }

bool replaces(const RecordLocation& later_one, const RecordLocation& r) {
  return later_one.kind.type == r.kind.type && later_one.kind.layout >= r.kind.layout &&
         later(later_one.number, r.number);
}

}  // namespace

void Log::open() {
  *this = {};
  const hal::FlashSize size = hal::flash_start();
  const std::uint32_t lines = size.sector_bytes / line_bytes;
  // A power of two, so that the numbers of lines remain unique when they wrap.
  const bool usable =
      size.sectors >= 2 && lines >= 4U * longest_record && lines <= 0x8000 && (lines & (lines - 1)) == 0;
  if (!usable) return;
  size_ = {std::min<std::uint32_t>(size.sectors, max_sectors), size.sector_bytes};
  lines_ = static_cast<std::uint16_t>(lines);
  for (int k = 0; k < max_scans && !scan(); ++k) {
  }
}

/// Returns false if a torn record read differently the second time; then scan again.
bool Log::scan() {
  active_sector_ = none;
  record_count_ = 0;
  interrupted_ = false;
  last_record_secured_ = true;
  std::array<Survey, max_sectors> found{};
  const auto sectors = static_cast<std::uint8_t>(size_.sectors);
  for (std::uint8_t s = 0; s < sectors; ++s) {
    found[s] = survey(s, [](const RecordLocation&) {});
    if (state_[s] != Sector::broken)
      state_[s] = marked(s) && blank(s, 1, static_cast<std::uint16_t>(lines_ - 1)) ? Sector::erased : Sector::dirty;
  }
  find_active_sector(std::span(found).first(size_.sectors));
  if (active_sector_ == none) return true;
  const auto adding = [this](const RecordLocation& r) { add_record(r); };
  for (std::uint8_t s = 0; s < sectors; ++s) {
    if (s == active_sector_) continue;
    const bool ahead = found[s].begun && later(found[s].base, base_);
    // The log never writes two sectors of one round; the numbers in the other would look like those of the active one.
    const bool same_round = found[s].begun && found[s].base == base_;
    interrupted_ = interrupted_ || ahead;
    if (!ahead && !same_round) survey(s, adding);
  }
  const Survey again = survey(active_sector_, adding);
  last_ = again.last;
  last_end_ = again.last_end;
  const bool unchanged = again.any && again.original == found[active_sector_].original;
  if (!unchanged) last_.reset();
  last_record_secured_ = unchanged && interrupted_;  // a move begins only when no record is uncertain
  return unchanged;
}

/// The sector with the highest numbers that contains more than copies; otherwise the highest one with copies.
void Log::find_active_sector(std::span<const Survey> found) {
  const auto sectors = static_cast<std::uint8_t>(found.size());
  for (std::uint8_t s = 0; s < sectors; ++s) {
    if (!found[s].any) continue;
    const bool better =
        active_sector_ == none ||
        (found[s].original != found[active_sector_].original ? found[s].original : later(found[s].base, base_));
    if (!better) continue;
    active_sector_ = s;
    base_ = found[s].base;
  }
}

template <class Visit>
Log::Survey Log::survey(std::uint8_t sector, Visit&& visit) const {
  Survey s{};
  for (std::uint16_t at = 1; at < lines_;) {
    const auto header = identity_in(read_line(sector, at), at);
    if (!header) {
      ++at;
      continue;
    }
    const std::uint32_t base = header->number - at;
    if (!s.begun || later(base, s.base)) s.base = base;
    s.begun = true;
    const auto end = static_cast<std::uint16_t>(at + lines_of(header->length));
    if (complete(*header, sector, at)) {
      s.any = true;
      s.original = s.original || !header->copy;
      s.last = {header->kind, sector, header->length, at, header->number};
      s.last_end = end;
      visit(s.last);
    }
    at = end;
  }
  return s;
}

std::optional<Log::Header> Log::identity_in(const std::array<std::uint8_t, line_bytes>& bytes,
                                            std::uint16_t line) const {
  Header h;
  h.number = get_bytes<std::uint32_t>(bytes, 0);
  if ((h.number & (lines_ - 1U)) != line) return std::nullopt;
  if (get_bytes<std::uint32_t>(bytes, check_at) != crc32(std::span(bytes).first(identity_bytes))) return std::nullopt;
  h.kind = {static_cast<std::uint8_t>(bytes[4] & ~copy_bit), bytes[5]};
  h.copy = (bytes[4] & copy_bit) != 0;
  h.length = bytes[6];
  h.crc = get_bytes<std::uint32_t>(bytes, commit_at);
  if (h.length > max_payload_bytes || line + lines_of(h.length) > lines_) return std::nullopt;
  return h;
}

bool Log::complete(const Header& header, std::uint8_t sector, std::uint16_t line) const {
  Line bytes = read_line(sector, line);
  Crc32 sum;
  sum.add(std::span(bytes).first(identity_bytes));
  for (std::size_t k = 0; k < header.length; k += line_bytes) {
    bytes = read_line(sector, line + 1 + static_cast<std::uint32_t>(k) / line_bytes);
    sum.add(std::span(bytes).first(std::min<std::size_t>(line_bytes, header.length - k)));
  }
  return sum.value() == header.crc;
}

bool Log::blank(std::uint8_t sector, std::uint16_t from, std::uint16_t lines) const {
  for (std::uint32_t line = from; line < std::uint32_t{from} + lines; ++line) {
    if (!std::ranges::all_of(read_line(sector, line), [](std::uint8_t byte) { return byte == 0xFF; })) return false;
  }
  return true;
}

bool Log::marked(std::uint8_t sector) const { return read_line(sector, 0) == mark_line(); }
bool Log::mark(std::uint8_t sector) const { return program_and_verify(sector, 0, mark_line()); }
/// Call before an erase: an interrupted erase must not leave the old mark above half-erased cells.
bool Log::unmark(std::uint8_t sector) const { return program_and_verify(sector, 0, Line{}); }

/// Adds a current record and removes those that it replaces. The order of calls does not matter.
void Log::add_record(const RecordLocation& record) {
  const auto begin = records_.begin(), end = begin + static_cast<std::ptrdiff_t>(record_count_);
  if (std::any_of(begin, end,
                  [&](const RecordLocation& r) { return r.number == record.number || replaces(r, record); }))
    return;
  record_count_ = static_cast<std::size_t>(
      std::remove_if(begin, end, [&](const RecordLocation& r) { return replaces(record, r); }) - begin);
  if (record_count_ < records_.size()) records_[record_count_++] = record;
}

std::optional<RecordLocation> Log::newest(std::uint8_t type, std::uint8_t known_layout) const {
  std::optional<RecordLocation> found;
  for (const RecordLocation& r : current_records()) {
    if (r.kind.type == type && r.kind.layout <= known_layout && (!found || later(r.number, found->number))) found = r;
  }
  return found;
}

std::optional<Log::LoadedRecord> Log::load(std::uint8_t type, std::uint8_t known_layout,
                                           std::span<std::uint8_t, max_payload_bytes> into) {
  for (int k = 0; k < max_scans; ++k) {
    const auto record = newest(type, known_layout);
    if (!record) return std::nullopt;
    if (const auto payload = read(*record, into)) return LoadedRecord{record->kind.layout, *payload};
    scan();  // torn: an older one is in force
  }
  return std::nullopt;
}

/// Returns nothing if the record can no longer be read.
std::optional<std::span<const std::uint8_t>> Log::read(const RecordLocation& record,
                                                       std::span<std::uint8_t, max_payload_bytes> into) const {
  const auto payload = into.first(record.length);
  hal::flash_read(record.sector, (record.line + 1U) * line_bytes, payload);
  // the checksum of `into`, because another read may differ
  const Line header = read_line(record.sector, record.line);
  Crc32 sum;
  sum.add(std::span(header).first(identity_bytes)).add(payload);
  if (sum.value() != get_bytes<std::uint32_t>(header, commit_at)) return std::nullopt;
  return payload;
}

/// Lines that a record of this urgency leaves free.
std::uint16_t Log::reserve(Urgency urgency) const {
  if (urgency == Urgency::safety || has_erased_sector()) return 0;
  const std::uint16_t all = std::min<std::uint16_t>(most_reserve_lines, static_cast<std::uint16_t>(lines_ / 8));
  return urgency == Urgency::usual ? all : static_cast<std::uint16_t>(all - all / 3);
}

StoreResult Log::store(Kind kind, std::span<const std::uint8_t> payload, Urgency urgency) {
  if (payload.size() > max_payload_bytes || (kind.type & copy_bit) != 0) return StoreResult::rejected;
  if (!secure_last_record()) return StoreResult::rejected;
  std::uint32_t together = lines_of(payload.size()), records = 1;
  for (const RecordLocation& r : current_records()) {
    if (r.kind.type == kind.type && r.kind.layout <= kind.layout) continue;
    together += lines_of(r.length);
    ++records;
  }
  if (together > lines_ / 2U || records > max_records) return StoreResult::rejected;  // without flash, lines_ is 0
  const auto spare = static_cast<std::uint16_t>(longest_record + reserve(urgency));
  if (append(kind, payload, spare) == StoreResult::stored) return StoreResult::stored;
  return move(kind, payload);
}

StoreResult Log::store_in_reserve(Kind kind, std::span<const std::uint8_t> payload) {
  if (payload.size() > max_reserve_bytes || !secure_last_record()) return StoreResult::rejected;
  return append(kind, payload, lines_of(payload.size()));  // and a copy of it, which the next boot may need
}

bool Log::secure_last_record() {
  for (int k = 0; k < max_scans && !last_record_secured_; ++k) {
    std::array<std::uint8_t, max_payload_bytes> payload;
    const auto bytes = last_ ? read(*last_, payload) : std::nullopt;
    if (!bytes) {
      while (k < max_scans && !scan()) ++k;
      continue;
    }
    void_torn_records();
    append(last_->kind, *bytes, 0);  // every other record leaves room for it
    last_record_secured_ = true;
  }
  return last_record_secured_;
}

/// Completes everything that was begun after the last complete record, so that each later boot reads the same, and
/// makes it void. next_ is the line after it.
void Log::void_torn_records() {
  next_ = last_end_;
  for (std::uint16_t at = last_end_; at < lines_;) {
    const Line bytes = read_line(active_sector_, at);
    const std::uint32_t place = at * line_bytes;
    const auto word = [&](std::size_t k) { return std::span(bytes).subspan(k, 4); };
    if (const auto header = identity_in(bytes, at)) {
      program_and_verify(active_sector_, place + check_at, word(check_at));
      program_and_verify(active_sector_, place + commit_at, zeros);
      next_ = at = static_cast<std::uint16_t>(at + lines_of(header->length));
      continue;
    }
    const bool numbered = get_bytes<std::uint32_t>(bytes, 0) == base_ + at;
    if (numbered) {
      program_and_verify(active_sector_, place, word(0));
      program_and_verify(active_sector_, place + check_at, zeros);
    }
    // Otherwise the line is empty or has an unfinished number, which is written again later.
    const bool other_bits = std::any_of(bytes.begin() + 4, bytes.end(), [](std::uint8_t byte) { return byte != 0xFF; });
    ++at;
    if (numbered || other_bits) next_ = at;
  }
}

StoreResult Log::append(Kind kind, std::span<const std::uint8_t> payload, std::uint16_t spare) {
  if (active_sector_ == none || interrupted_) return StoreResult::needs_erase;
  const std::uint16_t lines = lines_of(payload.size());
  for (int tries = 0; tries < tries_in_a_sector; ++tries) {
    if (next_ + lines + spare > lines_) return StoreResult::needs_erase;
    const RecordLocation record{kind, active_sector_, static_cast<std::uint8_t>(payload.size()), next_, base_ + next_};
    next_ = static_cast<std::uint16_t>(next_ + lines);
    if (!write(record, false, payload)) continue;
    add_record(record);
    return StoreResult::stored;
  }
  state_[active_sector_] = Sector::broken;
  next_ = lines_;
  return StoreResult::needs_erase;
}

StoreResult Log::move(Kind kind, std::span<const std::uint8_t> payload) {
  if ((active_sector_ == none || interrupted_) && needs_erase())
    return StoreResult::needs_erase;  // a dirty sector may still contain a record
  const std::uint32_t others = active_sector_ == none ? size_.sectors : size_.sectors - 1;
  for (std::uint32_t steps = 1; steps <= others; ++steps) {
    const std::uint8_t sector = after(steps);
    if (state_[sector] != Sector::erased) continue;
    state_[sector] = Sector::dirty;
    if (move_into(sector, (active_sector_ == none ? sector : base_ / lines_ + steps) * lines_, kind, payload))
      return StoreResult::stored;
    state_[sector] = Sector::broken;
  }
  return needs_erase() ? StoreResult::needs_erase : StoreResult::rejected;
}

bool Log::move_into(std::uint8_t sector, std::uint32_t base, Kind kind, std::span<const std::uint8_t> payload) {
  interrupted_ = true;
  std::uint16_t line = 1;
  const auto place = [&](Kind what, std::size_t length) {
    const RecordLocation at{what, sector, static_cast<std::uint8_t>(length), line, base + line};
    line = static_cast<std::uint16_t>(line + lines_of(length));
    return at;
  };
  std::array<RecordLocation, max_records> moved{};
  std::size_t count = 0;
  for (const RecordLocation& old : current_records()) {
    if (old.kind.type == kind.type && old.kind.layout <= kind.layout) continue;
    std::array<std::uint8_t, max_payload_bytes> bytes;
    const auto content = read(old, bytes);
    if (!content) continue;  // its bits have decayed since it was found
    moved[count] = place(old.kind, old.length);
    if (!write(moved[count], true, *content)) return false;
    ++count;
  }
  const RecordLocation record = place(kind, payload.size());
  if (!write(record, false, payload)) return false;
  active_sector_ = sector;
  base_ = base;
  interrupted_ = false;
  next_ = line;
  records_ = moved;
  record_count_ = count;
  add_record(record);
  return true;
}

/// Writes the identity and its check first: they state how many lines are used. The checksum of the whole record comes
/// last and makes the record valid.
bool Log::write(const RecordLocation& record, bool copy, std::span<const std::uint8_t> payload) const {
  Line header{};
  put_bytes(header, 0, record.number);
  header[4] = static_cast<std::uint8_t>(record.kind.type | (copy ? copy_bit : 0));
  header[5] = record.kind.layout;
  header[6] = record.length;
  const auto identity = std::span(header).first(identity_bytes), commit = std::span(header).subspan(commit_at, 4),
             check = std::span(header).subspan(check_at, 4);
  put_bytes(commit, 0, Crc32().add(identity).add(payload).value());
  put_bytes(check, 0, crc32(identity));
  const std::uint32_t at = record.line * line_bytes;
  return program_and_verify(record.sector, at, identity) && program_and_verify(record.sector, at + check_at, check) &&
         program_and_verify(record.sector, at + line_bytes, payload) &&
         program_and_verify(record.sector, at + commit_at, commit);
}

bool Log::needs_erase() const {
  for (std::uint8_t s = 0; s < size_.sectors; ++s) {
    if (s != active_sector_ && state_[s] == Sector::dirty) return true;
  }
  return false;
}

bool Log::has_erased_sector() const { return std::ranges::count(state_, Sector::erased) > 0; }

bool Log::erase_next_sector() {
  if (!needs_erase() || !secure_last_record()) return true;
  for (std::uint32_t steps = 1; steps <= size_.sectors; ++steps) {
    const std::uint8_t sector = after(steps);
    if (sector == active_sector_ || state_[sector] != Sector::dirty) continue;
    copy_records_from(sector);
    const bool good = unmark(sector) && hal::flash_erase(sector) && blank(sector, 0, lines_) && mark(sector);
    state_[sector] = good ? Sector::erased : Sector::broken;
    return good;
  }
  return true;  // the sector to erase has become active meanwhile
}

/// Copies the current records in `sector` to the active sector. They exist only if a newer one has decayed there.
void Log::copy_records_from(std::uint8_t sector) {
  for (std::size_t k = 0; k < record_count_; ++k) {
    if (records_[k].sector != sector) continue;
    std::array<std::uint8_t, max_payload_bytes> payload;
    const RecordLocation record = records_[k];
    const auto bytes = read(record, payload);
    if (bytes && append(record.kind, *bytes, 0) == StoreResult::stored)
      k = static_cast<std::size_t>(-1);  // the current records have changed
  }
}

std::uint32_t Log::broken() const { return static_cast<std::uint32_t>(std::ranges::count(state_, Sector::broken)); }
bool Log::operational() const { return size_.sectors >= 2 + broken(); }
std::uint32_t Log::erase_cycles() const {
  if (size_.sectors == 0 || active_sector_ == none) return 0;
  return base_ / lines_ / size_.sectors + 1;
}

/// Sector `steps` after the active one, in turn; without an active one, counted from sector 0.
std::uint8_t Log::after(std::uint32_t steps) const {
  return static_cast<std::uint8_t>((active_sector_ == none ? steps - 1 : active_sector_ + steps) % size_.sectors);
}

}  // namespace bms::storage
