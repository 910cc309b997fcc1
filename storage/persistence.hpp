// What the battery stores, and when. The policy bounds the wear of the flash in all cases:
//
//   charge    at most once a minute, if soc has moved by 0.1 % or its sigma by a tenth; after an hour if any charge
//             flowed
//   cells     at most every half hour, if one has moved by 0.1 %
//   health    at most every hour, if one value has moved by 0.1 %
//   events    a fault at once: sixteen in a row, then one every ten minutes. Starts and resets with the first minute of
//             a run, so a battery that restarts repeatedly writes nothing.
//   settings  when set
//   all       power_failing() writes all changes at once
//
// A failed write is tried again a minute later. The caller decides when to erase: start() erases before anything runs,
// later erase_next_sector() when the core may stop for half a second (hal/flash.hpp), e.g. with open contactors or
// without current.
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
  /// Call at boot: reads the stored records and erases sectors in advance. calendar_s: hal/calendar.hpp.
  void start(hal::ResetCause cause, const std::optional<hal::FaultRecord>& processor_fault,
             std::optional<std::uint32_t> calendar_s);

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

  /// Records a fault. code: not 0, defined by the caller.
  void fault(std::uint16_t code);
  /// Stores a setting. Returns false if there is no room for another key.
  bool set(std::uint16_t key, std::int32_t value);
  /// Call before the battery is switched off: writes charge first, 0.2 ms; everything takes 2 ms, at most 12 ms.
  void power_failing(const EstimatorSnapshot& now, std::optional<std::uint32_t> calendar_s);

  /// Call when the supply falls, which may be temporary: writes charge alone, 0.2 ms; at most 1.2 ms if its sector has
  /// room, otherwise at most 20 ms.
  void supply_failing(const EstimatorSnapshot& now, std::optional<std::uint32_t> calendar_s);

  bool needs_erase() const { return log_.needs_erase(); }
  void erase_next_sector() { log_.erase_next_sector(); }

  const ChargeRecord& charge() const { return charge_; }
  const CellsRecord& cells() const { return cells_; }
  const std::optional<HealthRecord>& health() const { return health_; }
  const EventsRecord& events() const { return events_; }
  const SettingsRecord& settings() const { return settings_; }
  const Log& log() const { return log_; }
  /// Number of records of a newer firmware, which are preserved but cannot be read.
  std::uint32_t newer_records() const;
  std::optional<std::uint32_t> off_s() const { return off_s_; }  ///< time without power, if known

 private:
  static constexpr std::uint32_t minute_us = 60'000'000;

  void advance_time();
  void store_charge(const estimator::StoredEstimate& now, std::uint32_t moved_ppb,
                    std::optional<std::uint32_t> calendar_s);
  void store_cells(std::span<const CellsRecord::Cell> now);
  void store_health(const HealthRecord& now);
  void store_events();
  void store_events_in_turn();
  void store_settings();

  Log log_;
  ChargeRecord charge_, charge_stored_;
  CellsRecord cells_;
  std::optional<HealthRecord> health_;
  EventsRecord events_;
  SettingsRecord settings_;
  bool charge_known_ = false;  ///< charge_stored_ was read from a record
  bool events_changed_ = false, settings_changed_ = false, stored_in_this_run_ = false;
  std::optional<std::uint32_t> off_s_;
  std::int32_t soc_before_ppb_ = 0;

  bool counting_ = false;
  std::uint64_t time_us_ = 0, charged_uaus_ = 0, discharged_uaus_ = 0;
  std::uint32_t since_us_ = 0, us_ = 0;
  std::uint16_t charge_minutes_ = 0, cells_minutes_ = 0, health_minutes_ = 0, fault_minutes_ = 0;
  std::uint8_t faults_at_once_ = 16;
};

}  // namespace bms::storage
