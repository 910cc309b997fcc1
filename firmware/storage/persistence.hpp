// What the battery stores, and when. The policy bounds the wear of the flash in all cases:
//
//   charge    at most once a minute, if soc has moved by 0.1 % or its sigma by a tenth; after an hour if any charge
//             flowed. In the last sector, without an erased one, at most every ten minutes
//   cells     at most every half hour, if one has moved by 0.1 %
//   health    at most every hour, if one value has moved by 0.1 %
//   events    a fault at once: sixteen in a row, then one every ten minutes. Starts and resets with the first minute of
//             a run, so a battery that restarts repeatedly writes nothing.
//   settings  when set, twice: eight in a row, then one an hour, beyond which they are refused. Latched faults are
//             written always, and have lines of their own in a full log
//   actions   of service sessions: with the next minute, sixteen in a row, then one an hour
//   extremes  at most every ten minutes, if one has changed
//   all       power_failing() writes all changes at once
//
// A failed write is tried again a minute later. The caller decides when to erase: start() erases before anything runs,
// later erase_next_sector() when the core may stop for half a second (hal/flash.hpp), with open contactors. When the
// log is full, the last record of charge says that soc is unknown from that minute.
//
// A copy of the charge, updated every minute in RAM that a reset of the core does not change, is newer than the record
// when no write was due or possible. It is used after a reset if its CRC is right.
//
// Time is the samples' time. Cost per sample: counting its charge, about thirty instructions; less without flash.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>

#include "estimator/restart.hpp"
#include "hal/power.hpp"
#include "measurement/sample.hpp"
#include "storage/actions_record.hpp"
#include "storage/log.hpp"
#include "storage/records.hpp"

namespace bms::storage {

/// Current results of the estimator.
struct EstimatorSnapshot {
  std::optional<estimator::StoredEstimate> pack;  ///< nothing: not started
  std::span<const CellsRecord::Cell> cells;
  HealthRecord health;
};

class Persistence {
 public:
  static constexpr std::size_t retained_bytes = 36;
  /// Call at boot: reads the stored records and erases sectors in advance. calendar_s: hal/calendar.hpp. retained: RAM
  /// that a reset does not change (hal/retained.hpp), or nothing.
  void start(hal::ResetCause cause, const std::optional<hal::FaultRecord>& processor_fault,
             std::optional<std::uint32_t> calendar_s, std::span<std::uint8_t> retained = {});

  /// Starting point of the estimator, if any: the stored one, with a sigma widened for the time off and for the last
  /// minute before the record.
  std::optional<measurement::StartingPoint> starting_point() const;

  /// Call with every sample: counts its charge and time. Returns true once a minute; then call store().
  bool count(const measurement::Sample& sample) {
    if (log_.sectors() == 0) return false;
    const std::uint64_t us = counting_ && sample.time_us > time_us_ ? sample.time_us - time_us_ : 0;
    const auto step_us = static_cast<std::uint32_t>(std::min<std::uint64_t>(us, minute_us));
    counting_ = true;
    time_us_ = sample.time_us;
    if (sample.current_ua > 0)
      charged_uaus_ += static_cast<std::uint64_t>(sample.current_ua) * step_us;
    else if (sample.current_ua != measurement::no_reading)
      discharged_uaus_ += static_cast<std::uint64_t>(static_cast<std::uint32_t>(-sample.current_ua)) * step_us;
    since_us_ += step_us;
    return since_us_ >= minute_us;
  }
  /// Writes the records that are due.
  void store(const EstimatorSnapshot& now, std::optional<std::uint32_t> calendar_s);

  /// Call with every sample, before fault(): the readings that a fault is stored with.
  void observe(const Readings& readings);
  /// Records a fault with its time and the readings. code: 1 to 127, defined by the caller.
  void fault(std::uint16_t code, std::optional<std::uint32_t> calendar_s = std::nullopt);
  /// Stores a setting. Returns false if it is not stored: there is no room for another key, the write failed, or there
  /// were too many. After a failed write the value is valid in this run, and the write is tried again every minute.
  bool set(std::uint16_t key, std::int32_t value, Urgency urgency = Urgency::usual);
  bool may_set() const { return settings_at_once_ > 0; }  ///< not too many settings so far
  /// Records what a service session has done; its time_s is set here.
  void action(ActionsRecord::Action action, std::optional<std::uint32_t> calendar_s);
  /// A record whose content the caller defines (storage/records.hpp: parameters_kind). Returns false if it is not
  /// stored.
  bool store_block(Kind kind, Bytes payload) { return put(kind, payload, Urgency::usual); }
  /// The newest record of a kind, part of `into`.
  std::optional<Bytes> load_block(Kind kind, std::span<std::uint8_t, max_payload_bytes> into) {
    const auto found = log_.load(kind.type, kind.layout, into);
    return found && found->layout == kind.layout ? std::optional(found->payload) : std::nullopt;
  }
  bool settings_stored() const { return !settings_changed_; }  ///< no write of a setting has failed
  /// Call before the battery is switched off: writes charge first, 0.2 ms; everything takes 3 ms, at most 16 ms.
  void power_failing(const EstimatorSnapshot& now, std::optional<std::uint32_t> calendar_s);

  /// Call when the supply falls, which may be temporary: writes charge alone, 0.2 ms; at most 1.2 ms if its sector has
  /// room, otherwise at most 24 ms.
  void supply_failing(const EstimatorSnapshot& now, std::optional<std::uint32_t> calendar_s);

  bool needs_erase() const { return log_.needs_erase(); }
  void erase_next_sector() { log_.erase_next_sector(); }
  /// Returns true if the last write found no room; see erase_next_sector().
  bool full() const { return full_ && log_.needs_erase(); }
  /// Returns true after an hour of full().
  bool full_for_long() const { return full() && full_minutes_ >= 60; }

  const ChargeRecord& charge() const { return charge_; }
  const CellsRecord& cells() const { return cells_; }
  const std::optional<HealthRecord>& health() const { return health_; }
  const EventsRecord& events() const { return events_; }
  const SettingsRecord& settings() const { return settings_; }
  const ActionsRecord& actions() const { return actions_; }
  const ExtremesRecord& extremes() const { return extremes_; }
  const Log& log() const { return log_; }
  /// Number of records of a newer firmware, which are preserved but cannot be read.
  std::uint32_t newer_records() const;
  std::optional<std::uint32_t> off_s() const { return off_s_; }  ///< time without power, if known

 private:
  static constexpr std::uint32_t minute_us = 60'000'000;

  template <class R>
  bool put(const R& record, Urgency urgency = Urgency::usual, Kind kind = R::kind);
  bool put(Kind kind, Bytes payload, Urgency urgency);
  void read_settings();
  void grant();
  void advance_time();
  void read_retained();
  void set_charge(const estimator::StoredEstimate& now, std::uint32_t moved_ppb,
                  std::optional<std::uint32_t> calendar_s);
  void store_charge(Urgency urgency = Urgency::usual);
  void store_cells(std::span<const CellsRecord::Cell> now);
  void store_health(const HealthRecord& now);
  void store_events();
  void store_events_in_turn();
  void store_settings();
  void store_extremes();

  Log log_;
  ChargeRecord charge_, charge_stored_;
  CellsRecord cells_;
  std::optional<HealthRecord> health_;
  EventsRecord events_;
  SettingsRecord settings_;
  ActionsRecord actions_;
  ExtremesRecord extremes_, extremes_stored_;
  Readings readings_;
  std::span<std::uint8_t> retained_;
  bool full_ = false;
  bool charge_known_ = false;  ///< charge_stored_ was read from a record
  bool events_changed_ = false, settings_changed_ = false, actions_changed_ = false, stored_in_this_run_ = false;
  Urgency settings_urgency_ = Urgency::usual;
  std::optional<std::uint32_t> off_s_;
  std::int32_t soc_before_ppb_ = 0;

  bool counting_ = false;
  std::uint64_t time_us_ = 0, charged_uaus_ = 0, discharged_uaus_ = 0;
  std::uint32_t since_us_ = 0, us_ = 0;
  std::uint16_t charge_minutes_ = 0, cells_minutes_ = 0, health_minutes_ = 0, fault_minutes_ = 0, extremes_minutes_ = 0,
                full_minutes_ = 0, covered_minutes_ = 1;
  std::uint8_t faults_at_once_ = 16, settings_at_once_ = 8, actions_at_once_ = 16, grant_minutes_ = 0;
};

}  // namespace bms::storage
