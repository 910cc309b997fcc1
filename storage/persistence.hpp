// What the battery remembers, and when it writes it down. Wear is bounded whatever happens:
//
//   charge    once a minute at most, when soc has moved by 0.1 % or its sigma by a tenth; after an hour if anything has
//   changed cells     every half hour at most, when one has moved by 0.1 % health    every hour at most, when one value
//   has moved by 0.1 % events    a fault at once: sixteen in a row, then one every ten minutes; starts and resets with
//   the first minute of a run, so that a
//             battery that starts again and again writes nothing
//   settings  when set
//   all that has changed, at once: power_failing()
//
// What could not be written is tried again a minute later. Erasing is the caller's to time: start() does it before
// anything runs, later erase_next_sector() when the core may stand still for half a second (hal/flash.hpp), e.g. with
// open contactors or without current.
//
// Time is the samples' own. Cost of a sample: counting its charge, some thirty instructions; less without flash.
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

/// What the estimator knows at the moment.
struct EstimatorSnapshot {
  std::optional<estimator::StoredEstimate> pack;  ///< nothing: not started
  std::span<const CellsRecord::Cell> cells;
  HealthRecord health;
};

class Persistence {
 public:
  /// At boot: reads what was stored, erases what is to be erased. calendar_s: hal/calendar.hpp.
  void start(hal::ResetCause cause, const std::optional<hal::FaultRecord>& processor_fault,
             std::optional<std::uint32_t> calendar_s);

  /// Where to begin, if that is known: as stored, as unsure as the time off and what was not written any more make it.
  std::optional<measurement::StartingPoint> starting_point() const;

  /// Every sample. True once a minute: keep() is to be called.
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
  void store(const EstimatorSnapshot& now, std::optional<std::uint32_t> calendar_s);

  /// code: not 0; what it means is the caller's.
  void fault(std::uint16_t code);
  /// False: no room for another key.
  bool set(std::uint16_t key, std::int32_t value);
  /// The supply goes, or the battery is switched off. Charge first, 0.2 ms; 2 ms for everything, 12 at most.
  void power_failing(const EstimatorSnapshot& now, std::optional<std::uint32_t> calendar_s);

  /// The supply sinks, and may stop sinking: charge alone, 0.2 ms, 1.2 at most where there is room for it in its
  /// sector, 20 where there is not.
  void supply_failing(const EstimatorSnapshot& now, std::optional<std::uint32_t> calendar_s);

  bool needs_erase() const { return log_.needs_erase(); }
  void erase_next_sector() { log_.erase_next_sector(); }

  const ChargeRecord& charge() const { return charge_; }
  const CellsRecord& cells() const { return cells_; }
  const std::optional<HealthRecord>& health() const { return health_; }
  const EventsRecord& events() const { return events_; }
  const SettingsRecord& settings() const { return settings_; }
  const Log& log() const { return log_; }
  /// Records that a newer firmware has left: they are kept, and cannot be read.
  std::uint32_t newer_records() const;
  std::optional<std::uint32_t> off_s() const { return off_s_; }  ///< how long the power was away, if that is known

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
  bool charge_known_ = false;  ///< charge_stored_ is from a record
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
