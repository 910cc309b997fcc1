// Persistence on a model of flash, with a clock and an estimator that a test sets.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "storage/persistence.hpp"
#include "tests/firmware/storage/flash_model.hpp"

namespace bms {

using hal::ResetCause;
using storage::CellsRecord;
using storage::EstimatorSnapshot;
using storage::Persistence;

inline constexpr hal::FlashSize chip{3, 16 * 1024};  // as in boards/netduinoplus2/memory.ld
inline constexpr std::int32_t percent_ppb = 10'000'000;

class PersistenceTest : public ::testing::Test {
 protected:
  PersistenceTest() { plug_in(&flash); }

  Persistence& boot(ResetCause cause = ResetCause::power_on, std::optional<std::uint32_t> calendar = std::nullopt,
                    bool processor_fault = false) {
    time_us = 0;
    p = {};
    p.start(cause, processor_fault ? std::optional(hal::FaultRecord{.exception = 5}) : std::nullopt, calendar,
            retained);
    p.count(measurement::Sample{});  // time counts from here
    return p;
  }
  /// Passes minutes with one sample per second.
  void drive(int minutes, std::int32_t current_ua = 0, std::int32_t soc_per_minute_ppb = 0) {
    for (int k = 0; k < 60 * minutes; ++k) {
      measurement::Sample s;
      s.time_us = time_us += 1'000'000;
      s.current_ua = current_ua;
      if (!p.count(s)) continue;
      pack.soc_ppb += soc_per_minute_ppb;
      p.store(now(), calendar_s);
      if (erases_allowed) p.erase_next_sector();
    }
  }
  /// Drives until no record finds room; erases_allowed should be false.
  void drive_until_full() {
    for (int k = 0; k < 5'000 && !p.full(); ++k) drive(1, -6'000'000, k % 2 == 0 ? -2'000'000 : 2'000'000);
    ASSERT_TRUE(p.full());
  }
  EstimatorSnapshot now() { return {known ? std::optional(pack) : std::nullopt, cells, health}; }
  /// Number of the newest record of a kind, if any.
  template <class R>
  std::optional<std::uint32_t> number() const {
    for (const storage::RecordLocation& r : p.log().current_records()) {
      if (r.kind == R::kind) return r.number;
    }
    return std::nullopt;
  }
  /// Passes minutes, each after a call of `each`, and returns those in which a record of this kind was written, counted
  /// from 1.
  template <class R, class Each>
  std::vector<int> written(int minutes, const Each& each, std::int32_t current_ua = 0) {
    std::vector<int> all;
    for (int minute = 1; minute <= minutes; ++minute) {
      const auto before = number<R>();
      each(minute);
      drive(1, current_ua);
      if (number<R>() != before) all.push_back(minute);
    }
    return all;
  }
  /// Steps of erasing and programming so far.
  std::uint64_t steps() const { return flash.steps(); }

  FlashModel flash{chip, 1};
  Persistence p;
  std::uint64_t time_us = 0;
  estimator::StoredEstimate pack{60 * percent_ppb, percent_ppb};
  std::vector<CellsRecord::Cell> cells;
  storage::HealthRecord health{1'000'000, 100'000, 1'000'000, 300'000};
  std::optional<std::uint32_t> calendar_s;
  std::vector<std::uint8_t> retained;  ///< RAM that a reset does not change; empty: none
  bool known = true, erases_allowed = true;
};

}  // namespace bms
