#include "storage/persistence.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "hal/bytes.hpp"
#include "hal/watchdog.hpp"
#include "storage/crc32.hpp"

namespace bms::storage {

namespace {

constexpr std::int32_t moved_soc_ppb = 1'000'000;
constexpr std::int32_t moved_cell = 100, moved_health_ppm = 1'000;  // 0.1 % each
constexpr std::uint16_t charge_at_least_minutes = 60, cells_every_minutes = 30, health_every_minutes = 60,
                        fault_every_minutes = 10, extremes_every_minutes = 10, charge_in_last_sector_minutes = 10;
constexpr std::uint32_t unknown_moved_ppb = 289'000'000;  // sigma of an unknown soc
constexpr std::uint8_t most_faults_at_once = 16, most_settings_at_once = 8, most_actions_at_once = 16,
                       grant_every_minutes = 60;
constexpr std::uint64_t uaus_per_uah = 3'600'000'000;

constexpr std::array known_kinds{ChargeRecord::kind,   CellsRecord::kind,    HealthRecord::kind,   EventsRecord::kind,
                                 SettingsRecord::kind, SettingsRecord::copy, ExtremesRecord::kind, ActionsRecord::kind,
                                 parameters_kind,      parameters_copy_kind};

template <class R>
bool get(Log& log, R& record, Kind kind = R::kind) {
  std::array<std::uint8_t, max_payload_bytes> bytes;
  const auto found = log.load(kind.type, kind.layout, bytes);
  return found && decode(found->payload, found->layout, record);
}

bool differs_by(std::int32_t a, std::int32_t b, std::int32_t by) { return std::abs(std::int64_t{a} - b) >= by; }

constexpr std::uint16_t incremented(std::uint16_t minutes) {
  return minutes < 0xFFFF ? static_cast<std::uint16_t>(minutes + 1) : minutes;
}

/// Returns true for causes that reset only the core.
constexpr bool power_stayed_on(hal::ResetCause cause) {
  return cause == hal::ResetCause::software || cause == hal::ResetCause::watchdog || cause == hal::ResetCause::pin;
}

}  // namespace

bool Persistence::put(Kind kind, Bytes payload, Urgency urgency) {
  const StoreResult result = log_.store(kind, payload, urgency);
  full_ = result == StoreResult::needs_erase;
  return result == StoreResult::stored;
}

template <class R>
bool Persistence::put(const R& record, Urgency urgency, Kind kind) {
  std::array<std::uint8_t, max_payload_bytes> bytes;
  return put(kind, encode(record, bytes), urgency);
}

/// The newer one of the two copies. If they differ, both are written again with the first minute.
void Persistence::read_settings() {
  const bool first = get(log_, settings_);
  SettingsRecord copy;
  const bool second = get(log_, copy, SettingsRecord::copy);
  const bool newer = static_cast<std::int16_t>(copy.revision - settings_.revision) > 0;
  if (second && (!first || newer)) settings_ = copy;
  settings_changed_ = first != second || (first && copy.revision != settings_.revision) || (second && newer);
}

void Persistence::start(hal::ResetCause cause, const std::optional<hal::FaultRecord>& processor_fault,
                        std::optional<std::uint32_t> calendar_s, std::span<std::uint8_t> retained) {
  log_.open();
  charge_known_ = get(log_, charge_stored_);
  retained_ = retained;
  if (charge_known_ && power_stayed_on(cause)) read_retained();
  charge_ = charge_stored_;
  soc_before_ppb_ = charge_.pack.soc_ppb;
  get(log_, cells_);
  if (HealthRecord health; get(log_, health)) health_ = health;
  get(log_, events_);
  read_settings();
  get(log_, actions_);
  get(log_, extremes_);
  extremes_stored_ = extremes_;
  if (power_stayed_on(cause))
    off_s_ = 0;
  else if (charge_known_ && calendar_s && charge_stored_.calendar_s != 0 && *calendar_s >= charge_stored_.calendar_s)
    off_s_ = *calendar_s - charge_stored_.calendar_s;

  ++events_.starts;
  auto& resets = events_.resets[static_cast<std::size_t>(cause) % EventsRecord::causes];
  if (resets < 0xFFFF) ++resets;
  if (processor_fault)
    events_.add({static_cast<std::uint16_t>(EventsRecord::processor_fault_code | (processor_fault->exception & 0x7FU)),
                 calendar_s.value_or(charge_.operating_s), packed({})});
  events_changed_ = true;
  for (std::uint32_t k = 0; k < log_.sectors() && log_.needs_erase(); ++k) {
    log_.erase_next_sector();
    hal::watchdog_feed();
  }
}

/// Takes the retained charge if it is intact and at least as new as the record.
void Persistence::read_retained() {
  if (retained_.size() < retained_bytes) return;
  const Bytes content = Bytes(retained_).first(retained_bytes - 4);
  ChargeRecord charge;
  if (hal::get_bytes<std::uint32_t>(retained_, content.size()) == crc32(content) &&
      decode(content, ChargeRecord::kind.layout, charge) && charge.operating_s >= charge_stored_.operating_s)
    charge_stored_ = charge;
}

std::optional<measurement::StartingPoint> Persistence::starting_point() const {
  if (!charge_known_) return std::nullopt;
  estimator::StoredEstimate stored = charge_stored_.pack;
  const std::int64_t sigma = std::int64_t{stored.soc_sigma_ppb} + charge_stored_.moved_ppb;
  stored.soc_sigma_ppb = static_cast<std::int32_t>(std::min<std::int64_t>(sigma, 1'000'000'000));
  return estimator::starting_point_after_off_time(stored, off_s_);
}

/// Adds whole units counted since the last call; the fractions remain.
void Persistence::advance_time() {
  charge_.charged_uah += charged_uaus_ / uaus_per_uah;
  charged_uaus_ %= uaus_per_uah;
  charge_.discharged_uah += discharged_uaus_ / uaus_per_uah;
  discharged_uaus_ %= uaus_per_uah;
  us_ += since_us_;
  since_us_ = 0;
  charge_.operating_s += us_ / 1'000'000;
  us_ %= 1'000'000;
}

void Persistence::store(const EstimatorSnapshot& now, std::optional<std::uint32_t> calendar_s) {
  advance_time();
  charge_minutes_ = incremented(charge_minutes_);
  cells_minutes_ = incremented(cells_minutes_);
  health_minutes_ = incremented(health_minutes_);
  extremes_minutes_ = incremented(extremes_minutes_);
  full_minutes_ = full() ? incremented(full_minutes_) : std::uint16_t{0};
  if (faults_at_once_ < most_faults_at_once && ++fault_minutes_ >= fault_every_minutes) {
    fault_minutes_ = 0;
    ++faults_at_once_;
  }
  grant();
  if (now.pack) {
    const auto moved_ppb = static_cast<std::uint32_t>(std::abs(std::int64_t{now.pack->soc_ppb} - soc_before_ppb_));
    soc_before_ppb_ = now.pack->soc_ppb;
    const bool first = !charge_known_ || !stored_in_this_run_;
    const bool has_moved = differs_by(now.pack->soc_ppb, charge_stored_.pack.soc_ppb, moved_soc_ppb) ||
                           differs_by(now.pack->soc_sigma_ppb, charge_stored_.pack.soc_sigma_ppb,
                                      std::max(moved_soc_ppb / 10, charge_stored_.pack.soc_sigma_ppb / 10));
    const bool long_ago =
        charge_minutes_ >= charge_at_least_minutes &&
        (charge_.charged_uah != charge_stored_.charged_uah || charge_.discharged_uah != charge_stored_.discharged_uah);
    const std::uint16_t every_minutes = log_.has_erased_sector() ? 1 : charge_in_last_sector_minutes;
    set_charge(*now.pack, std::min(moved_ppb, unknown_moved_ppb), calendar_s);
    charge_.moved_ppb *= every_minutes;
    // A record whose sigma covers only a minute is followed by another one after a minute.
    if (first || long_ago || (has_moved && charge_minutes_ >= std::min(covered_minutes_, every_minutes))) {
      covered_minutes_ = every_minutes;
      store_charge();
    }
  }
  if (cells_minutes_ >= cells_every_minutes) store_cells(now.cells);
  if (health_minutes_ >= health_every_minutes) store_health(now.health);
  if (events_changed_) store_events_in_turn();
  if (settings_changed_) store_settings();
  if (actions_changed_ && actions_at_once_ > 0) {
    actions_changed_ = !put(actions_);
    if (!actions_changed_) --actions_at_once_;
  }
  if (extremes_minutes_ >= extremes_every_minutes) store_extremes();
}

/// Once an hour, one more setting and one more record of actions may be written.
void Persistence::grant() {
  if (++grant_minutes_ < grant_every_minutes) return;
  grant_minutes_ = 0;
  if (settings_at_once_ < most_settings_at_once) ++settings_at_once_;
  if (actions_at_once_ < most_actions_at_once) ++actions_at_once_;
}

void Persistence::power_failing(const EstimatorSnapshot& now, std::optional<std::uint32_t> calendar_s) {
  advance_time();
  if (now.pack) {
    set_charge(*now.pack, 0, calendar_s);
    covered_minutes_ = 1;
    store_charge(Urgency::last_charge);
  }
  if (events_changed_) store_events();
  store_cells(now.cells);
  store_health(now.health);
  if (settings_changed_) store_settings();
  if (actions_changed_ && actions_at_once_ > 0) actions_changed_ = !put(actions_);
  store_extremes();
}

void Persistence::supply_failing(const EstimatorSnapshot& now, std::optional<std::uint32_t> calendar_s) {
  advance_time();
  if (now.pack) {
    set_charge(*now.pack, 0, calendar_s);
    covered_minutes_ = 1;
    store_charge(Urgency::last_charge);
  }
}

void Persistence::observe(const Readings& readings) {
  readings_ = readings;
  extremes_.range.add(readings.range);
}

void Persistence::fault(std::uint16_t code, std::optional<std::uint32_t> calendar_s) {
  events_.add({code, calendar_s.value_or(charge_.operating_s), packed(readings_)});
  events_changed_ = true;
  store_events_in_turn();
}

bool Persistence::set(std::uint16_t key, std::int32_t value, Urgency urgency) {
  const std::uint16_t before = settings_.revision;
  const bool known = settings_.get(key) == value;
  if (!known && urgency == Urgency::usual && !may_set()) return false;
  if (!settings_.set(key, value)) return false;
  if (settings_.revision != before) {
    settings_changed_ = true;
    if (urgency == Urgency::usual)
      --settings_at_once_;
    else
      settings_urgency_ = urgency;
  }
  if (settings_changed_) store_settings();
  return settings_stored();
}

void Persistence::action(ActionsRecord::Action action, std::optional<std::uint32_t> calendar_s) {
  action.time_s = calendar_s.value_or(charge_.operating_s);
  actions_.add(action);
  actions_changed_ = true;
}

/// Sets the charge to be stored, and its copy in the retained RAM.
void Persistence::set_charge(const estimator::StoredEstimate& now, std::uint32_t moved_ppb,
                             std::optional<std::uint32_t> calendar_s) {
  charge_.pack = now;
  charge_.moved_ppb = moved_ppb;
  charge_.calendar_s = calendar_s.value_or(0);
  if (retained_.size() < retained_bytes) return;
  std::array<std::uint8_t, max_payload_bytes> into;
  const Bytes content = encode(charge_, into);
  std::ranges::copy(content, retained_.begin());
  hal::put_bytes(retained_, content.size(), crc32(content));
}

void Persistence::store_charge(Urgency urgency) {
  ChargeRecord stored = charge_;
  if (!put(stored, urgency)) {
    // The last record of a full log must not look like a recent one. It is written once.
    if (!full_ || charge_stored_.moved_ppb == unknown_moved_ppb) return;
    stored.moved_ppb = unknown_moved_ppb;
    std::array<std::uint8_t, max_payload_bytes> bytes;
    if (log_.store_in_reserve(ChargeRecord::kind, encode(stored, bytes)) != StoreResult::stored) return;
  }
  charge_stored_ = stored;
  charge_known_ = stored_in_this_run_ = true;
  charge_minutes_ = 0;
}

void Persistence::store_cells(std::span<const CellsRecord::Cell> now) {
  if (now.empty() || now.size() > CellsRecord::max_cells) return;
  bool moved = cells_.count != now.size();
  for (std::size_t k = 0; !moved && k < now.size(); ++k) moved = differs_by(now[k].soc, cells_.cell[k].soc, moved_cell);
  if (!moved) return;
  CellsRecord next;
  next.count = static_cast<std::uint8_t>(now.size());
  std::ranges::copy(now, next.cell.begin());
  if (!put(next)) return;
  cells_ = next;
  cells_minutes_ = 0;
}

void Persistence::store_health(const HealthRecord& now) {
  const bool moved = !health_ || differs_by(now.capacity_ppm, health_->capacity_ppm, moved_health_ppm) ||
                     differs_by(now.resistance_ppm, health_->resistance_ppm, moved_health_ppm) ||
                     differs_by(now.capacity_sigma_ppm, health_->capacity_sigma_ppm, moved_health_ppm) ||
                     differs_by(now.resistance_sigma_ppm, health_->resistance_sigma_ppm, moved_health_ppm);
  if (!moved || !put(now)) return;
  health_ = now;
  health_minutes_ = 0;
}

void Persistence::store_events() { events_changed_ = !put(events_); }
/// Writes the events if the rate limit allows it. A failed write does not count.
void Persistence::store_events_in_turn() {
  if (faults_at_once_ == 0) return;
  store_events();
  if (!events_changed_) --faults_at_once_;
}
void Persistence::store_settings() {
  settings_changed_ = !put(settings_, settings_urgency_);
  settings_changed_ = !put(settings_, settings_urgency_, SettingsRecord::copy) || settings_changed_;
  if (!settings_changed_) settings_urgency_ = Urgency::usual;
}
void Persistence::store_extremes() {
  if (extremes_ == extremes_stored_ || !put(extremes_)) return;
  extremes_stored_ = extremes_;
  extremes_minutes_ = 0;
}

std::uint32_t Persistence::newer_records() const {
  const auto newer = [](const RecordLocation& r) {
    return std::ranges::none_of(known_kinds,
                                [&](const Kind& k) { return k.type == r.kind.type && k.layout >= r.kind.layout; });
  };
  return static_cast<std::uint32_t>(std::ranges::count_if(log_.current_records(), newer));
}

}  // namespace bms::storage
