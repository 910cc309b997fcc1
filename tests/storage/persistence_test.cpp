// What is remembered over boots, when it is written, and how long flash lasts with it.
#include "storage/persistence.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <tuple>
#include <vector>

#include "hal/watchdog.hpp"
#include "tests/storage/flash_model.hpp"
#include "tests/storage/record_bytes.hpp"

namespace bms {

namespace hal {
int fed = 0;
void watchdog_feed() { ++fed; }
}  // namespace hal

namespace {

using hal::ResetCause;
using storage::CellsRecord;
using storage::EstimatorSnapshot;
using storage::Persistence;

constexpr hal::FlashSize chip{3, 16 * 1024};  // as boards/netduinoplus2/memory.ld has it
constexpr std::int32_t percent_ppb = 10'000'000;

class PersistenceTest : public ::testing::Test {
 protected:
  PersistenceTest() { plug_in(&flash); }

  Persistence& boot(ResetCause cause = ResetCause::power_on, std::optional<std::uint32_t> calendar = std::nullopt,
                    bool processor_fault = false) {
    time_us = 0;
    p = {};
    p.start(cause, processor_fault ? std::optional(hal::FaultRecord{.exception = 5}) : std::nullopt, calendar);
    p.count(measurement::Sample{});  // from here on time counts
    return p;
  }
  /// Minutes of a sample a second.
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
  EstimatorSnapshot now() { return {known ? std::optional(pack) : std::nullopt, cells, health}; }
  /// Number of the newest record of a kind; nothing: there is none.
  template <class R>
  std::optional<std::uint32_t> number() const {
    for (const storage::RecordLocation& r : p.log().current_records()) {
      if (r.kind == R::kind) return r.number;
    }
    return std::nullopt;
  }
  /// The minutes from now on, counted from 1, with which a record of that kind was written; before each, something is
  /// done.
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
  /// Steps of programming so far: nothing more is worn by what leaves it as it is.
  std::uint64_t steps() const { return flash.steps(); }

  FlashModel flash{chip, 1};
  Persistence p;
  std::uint64_t time_us = 0;
  estimator::StoredEstimate pack{60 * percent_ppb, percent_ppb};
  std::vector<CellsRecord::Cell> cells;
  storage::HealthRecord health{1'000'000, 100'000, 1'000'000, 300'000};
  std::optional<std::uint32_t> calendar_s;
  bool known = true, erases_allowed = true;
};

TEST_F(PersistenceTest, NewFlashGivesNoStartAndIsErasedAtBoot) {
  EXPECT_FALSE(boot().starting_point());
  EXPECT_FALSE(p.needs_erase());
  EXPECT_EQ(p.events().starts, 1U);
}

TEST_F(PersistenceTest, TheWatchdogIsFedAfterEveryEraseOfABoot) {
  hal::fed = 0;
  boot();
  EXPECT_EQ(flash.erases(), (std::vector<std::uint64_t>{1, 1, 1}));
  EXPECT_EQ(hal::fed, 3);
  boot();
  EXPECT_EQ(hal::fed, 3) << "nothing is to be erased";
}

/// Whichever byte of the last record it is in, and whatever a reading makes of it.
TEST_F(PersistenceTest, ACellThatReadsOtherwiseNowAndThenDoesNotHoldUpABoot) {
  boot();
  drive(5, -6'000'000, -2'000'000);
  while (!p.needs_erase()) {
    erases_allowed = false;
    drive(1, -6'000'000, -2'000'000);
    pack.soc_ppb = 60 * percent_ppb;
  }
  const auto records = p.log().current_records();
  const auto last = *std::max_element(records.begin(), records.end(),
                                      [](const auto& a, const auto& b) { return a.number < b.number; });
  const FlashModel before = flash;
  for (std::uint32_t at = last.line * 16U; at < last.line * 16U + 24; at += 5) {
    for (std::uint32_t every = 1; every < 9; ++every) {
      flash = before;
      flash.make_unsteady(last.sector, at, 0x08, every);
      flash.limit_reads(5'000'000);  // of 12,288 words
      try {
        boot(ResetCause::watchdog);
      } catch (const TooManyReads&) {
        ADD_FAILURE() << "no end, with a bit of byte " << at << " otherwise every " << every;
      }
    }
  }
}

TEST_F(PersistenceTest, SocIsResumedAfterAResetWithSigmaForTheMinuteThatWasNotWritten) {
  boot();
  drive(3, -3'000'000, -8'000'000);
  boot(ResetCause::watchdog);
  ASSERT_TRUE(p.starting_point());
  EXPECT_EQ(p.starting_point()->soc_ppb, 576'000'000);
  EXPECT_EQ(p.starting_point()->soc_sigma_ppb, 18'000'000) << "1 % and what moved in the last minute";
  EXPECT_EQ(p.off_s(), 0U);
}

TEST_F(PersistenceTest, AfterAShutdownNothingIsMissing) {
  boot();
  drive(3, -3'000'000, -8'000'000);
  pack.soc_ppb = 571'234'567;
  p.power_failing(now(), std::nullopt);
  boot(ResetCause::watchdog);
  EXPECT_EQ(p.starting_point()->soc_ppb, 571'234'567);
  EXPECT_EQ(p.starting_point()->soc_sigma_ppb, percent_ppb);
}

TEST_F(PersistenceTest, TimeOffWidensSigmaByTheCalendarOrByAMonthWithoutOne) {
  boot();
  calendar_s = 1'000'000;
  drive(1);
  p.power_failing(now(), 1'000'000);
  boot(ResetCause::power_on, 1'000'000 + 10 * 86'400);
  EXPECT_EQ(p.off_s(), 864'000U);
  EXPECT_EQ(p.starting_point()->soc_ppb, 58 * percent_ppb) << "0.2 % a day";
  EXPECT_EQ(p.starting_point()->soc_sigma_ppb, 3 * percent_ppb);
  boot(ResetCause::power_on, std::nullopt);
  EXPECT_FALSE(p.off_s());
  EXPECT_EQ(p.starting_point()->soc_ppb, 60 * percent_ppb - 14 * percent_ppb / 10) << "a week";
  EXPECT_EQ(p.starting_point()->soc_sigma_ppb, 7 * percent_ppb) << "a month";
  boot(ResetCause::power_on, 999'999);
  EXPECT_FALSE(p.off_s()) << "a clock that went back tells nothing";
}

TEST_F(PersistenceTest, AnEstimateThatHasNotBegunIsNotStoredOverOneThatWas) {
  boot();
  drive(2);
  known = false;
  boot(ResetCause::watchdog);
  drive(5);
  p.power_failing(now(), std::nullopt);
  boot(ResetCause::watchdog);
  EXPECT_EQ(p.starting_point()->soc_ppb, 60 * percent_ppb);
}

TEST_F(PersistenceTest, EverythingComesBack) {
  cells.assign(16, {});
  for (int k = 0; k < 16; ++k) cells[static_cast<std::size_t>(k)] = {static_cast<std::int16_t>(500 * k - 4'000), 700};
  health = {930'000, 5'000, 1'200'000, 20'000};
  boot(ResetCause::watchdog);
  drive(120, 6'000'000);
  drive(60, -12'000'000);
  p.fault(0x0102);
  EXPECT_TRUE(p.set(40, -5));
  p.power_failing(now(), std::nullopt);
  boot(ResetCause::power_on);
  EXPECT_EQ(p.charge().charged_uah, 12'000'000U) << "6 A for two hours";
  EXPECT_EQ(p.charge().discharged_uah, 12'000'000U);
  EXPECT_EQ(p.charge().operating_s, 180U * 60);
  EXPECT_EQ(storage::cycles_milli(p.charge(), 6'000'000), 2'000U);
  ASSERT_EQ(p.cells().count, 16);
  EXPECT_TRUE(std::equal(cells.begin(), cells.end(), p.cells().cell.begin()));
  EXPECT_EQ(p.health(), health);
  EXPECT_EQ(p.events().last(0).code, 0x0102);
  EXPECT_EQ(p.events().last(0).operating_s, 180U * 60);
  EXPECT_EQ(p.events().starts, 2U);
  EXPECT_EQ(p.events().resets[static_cast<std::size_t>(ResetCause::watchdog)], 1U);
  EXPECT_EQ(p.settings().get(40), -5);
}

TEST_F(PersistenceTest, AFaultIsWrittenAtOnceAndAProcessorsFaultWithTheNextMinute) {
  boot();
  drive(1);
  p.fault(7);
  boot();
  EXPECT_EQ(p.events().last(0).code, 7);
  boot(ResetCause::software, std::nullopt, true);
  EXPECT_EQ(p.events().last(0).code, 0xFF05);
  drive(1);
  boot();
  EXPECT_EQ(p.events().last(0).code, 0xFF05);
  EXPECT_EQ(p.events().last(1).code, 7);
}

using storage::ChargeRecord;
using storage::EventsRecord;
using storage::HealthRecord;
using storage::SettingsRecord;
using Minutes = std::vector<int>;

TEST_F(PersistenceTest, ChargeIsWrittenWhenItHasMovedByATenthOfAPercentSinceItWasWritten) {
  for (const int sign : {1, -1}) {
    boot();
    EXPECT_EQ(written<ChargeRecord>(6, [&](int) { pack.soc_ppb += sign * 1'000'000; }), (Minutes{1, 2, 3, 4, 5, 6}));
    EXPECT_EQ(written<ChargeRecord>(6, [&](int) { pack.soc_ppb += sign * 999'999; }), (Minutes{2, 4, 6}));
    EXPECT_EQ(written<ChargeRecord>(6, [&](int) { pack.soc_ppb += sign * 400'000; }), (Minutes{3, 6}))
        << "a drift counts from what is stored";
  }
}

TEST_F(PersistenceTest, ChargeIsWrittenWhenItsSigmaHasMovedByATenthOfItself) {
  for (const auto& [sigma_ppb, by_ppb] : {std::pair{10'000'000, 1'000'000}, std::pair{10'000'000, -1'000'000},
                                          std::pair{500'000, 100'000}, std::pair{500'000, -100'000}}) {
    pack.soc_sigma_ppb = sigma_ppb;
    boot();
    drive(1);
    EXPECT_EQ(written<ChargeRecord>(3,
                                    [&, from = sigma_ppb, by = by_ppb](int minute) {
                                      pack.soc_sigma_ppb = from + (minute < 3 ? by - by / std::abs(by) : by);
                                    }),
              (Minutes{3}))
        << sigma_ppb << ' ' << by_ppb;
  }
}

TEST_F(PersistenceTest, ChargeIsWrittenAnHourLaterIfAnyHasFlowedAndElseNotAtAll) {
  boot();
  EXPECT_EQ(written<ChargeRecord>(150, [](int) {}), (Minutes{1}));
  for (const std::int32_t current_ua : {6'000'000, -6'000'000}) {
    boot();
    EXPECT_EQ(written<ChargeRecord>(
                  130, [](int) {}, current_ua),
              (Minutes{1, 61, 121}))
        << current_ua;
  }
}

TEST_F(PersistenceTest, CellsAreWrittenEveryHalfHourWhenAnyOneHasMoved) {
  cells.assign(16, {});
  boot();
  EXPECT_EQ(written<CellsRecord>(100, [&](int minute) { cells[5].soc = static_cast<std::int16_t>(100 * minute); }),
            (Minutes{30, 60, 90}));
  EXPECT_EQ(written<CellsRecord>(100, [](int) {}), (Minutes{20})) << "the last of it, and then nothing";
  for (std::size_t k = 0; k < 16; ++k) {
    for (const int by : {100, -100}) {
      cells[k].soc = static_cast<std::int16_t>(cells[k].soc + by - by / 100);
      EXPECT_EQ(written<CellsRecord>(40, [](int) {}), Minutes{}) << k << ": less than 0.1 %";
      cells[k].soc = static_cast<std::int16_t>(cells[k].soc + by / 100);
      EXPECT_EQ(written<CellsRecord>(40, [](int) {}), (Minutes{1})) << k << ": due since the half hour was over";
      ASSERT_TRUE(std::equal(cells.begin(), cells.end(), p.cells().cell.begin()));
    }
  }
  cells.resize(15);
  EXPECT_EQ(written<CellsRecord>(40, [](int) {}).size(), 1U) << "another number of cells";
  cells.assign(17, {1'000, 0});
  EXPECT_EQ(written<CellsRecord>(40, [](int) {}), Minutes{}) << "more than a record holds";
}

TEST_F(PersistenceTest, HealthIsWrittenEveryHourWhenAnyValueHasMoved) {
  boot();
  EXPECT_EQ(written<HealthRecord>(190, [&](int minute) { health.capacity_ppm = 1'000'000 - 1'000 * minute; }),
            (Minutes{60, 120, 180}));
  EXPECT_EQ(written<HealthRecord>(300, [](int) {}), (Minutes{50})) << "the last of it, and then nothing";
  for (const auto value : {&HealthRecord::capacity_ppm, &HealthRecord::capacity_sigma_ppm,
                           &HealthRecord::resistance_ppm, &HealthRecord::resistance_sigma_ppm}) {
    for (const std::int32_t by : {1'000, -1'000}) {
      health.*value += by / 2;
      EXPECT_EQ(written<HealthRecord>(65, [](int) {}), Minutes{}) << "less than 0.1 %";
      health.*value += by - by / 2;
      EXPECT_EQ(written<HealthRecord>(65, [](int) {}), (Minutes{1})) << "a drift counts from what is stored";
      EXPECT_EQ(p.health(), health);
    }
  }
}

TEST_F(PersistenceTest, FaultsAreWrittenSixteenAtOnceAndThenOneEveryTenMinutes) {
  boot();
  const auto at_once = [&](int faults) {
    int count = 0;
    for (int k = 0; k < faults; ++k) {
      const auto before = number<EventsRecord>();
      p.fault(static_cast<std::uint16_t>(1 + k));
      count += number<EventsRecord>() != before ? 1 : 0;
    }
    return count;
  };
  EXPECT_EQ(at_once(40), 16);
  EXPECT_EQ(written<EventsRecord>(35, [&](int) { p.fault(7); }), (Minutes{10, 20, 30}));
  EXPECT_EQ(written<EventsRecord>(40, [](int) {}), (Minutes{5})) << "what is left, once";
  EXPECT_EQ(at_once(40), 3) << "of 35 minutes";
  drive(170);  // one for the rest of these
  EXPECT_EQ(at_once(40), 16);
  boot(ResetCause::software);
  EXPECT_EQ(p.events().faults, 40U + 35 + 40 + 16);
}

/// All of its sectors are full and none may be erased: what could not be written is, within a minute of an erase.
TEST_F(PersistenceTest, WhatCouldNotBeWrittenIsTriedAgainEveryMinute) {
  boot();
  cells.assign(16, {});
  drive(61);
  erases_allowed = false;
  int minutes = 0;
  for (std::uint64_t before = ~0ULL; before != steps() && minutes < 5'000; ++minutes) {
    before = steps();
    drive(1, -6'000'000, minutes % 2 == 0 ? -2'000'000 : 2'000'000);
  }
  const auto before = steps();
  cells[3].soc = 500;
  health.capacity_ppm -= 50'000;
  pack.soc_ppb += 5'000'000;
  p.fault(77);
  EXPECT_TRUE(p.set(9, 99));
  drive(70);
  EXPECT_EQ(steps(), before);
  p.erase_next_sector();
  drive(1);
  boot(ResetCause::software);
  EXPECT_EQ(p.starting_point()->soc_ppb, pack.soc_ppb);
  EXPECT_EQ(p.cells().cell[3].soc, 500);
  EXPECT_EQ(p.health(), health);
  EXPECT_EQ(p.events().last(0).code, 77);
  EXPECT_EQ(p.settings().get(9), 99);
}

TEST_F(PersistenceTest, ASettingIsWrittenAtOnceAndOnlyWhenItIsAnother) {
  boot();
  EXPECT_TRUE(p.set(3, 5));
  const auto before = steps();
  EXPECT_TRUE(p.set(3, 5));
  drive(0);
  EXPECT_EQ(steps(), before);
  EXPECT_TRUE(p.set(3, 6));
  EXPECT_EQ(boot().settings().get(3), 6);
  for (std::uint16_t key = 100; key < 123; ++key) EXPECT_TRUE(p.set(key, 1));
  EXPECT_FALSE(p.set(200, 1)) << "there is no room";
  EXPECT_TRUE(p.set(3, 7));
}

TEST_F(PersistenceTest, WhenTheSupplySinksChargeIsWrittenAndNothingElse) {
  boot();
  drive(2, -6'000'000, -4'000'000);
  cells.assign(16, {500, 1});
  pack.soc_ppb = 555'555'555;
  for (int k = 0; k < 30; ++k) {
    measurement::Sample s;
    s.time_us = time_us += 1'000'000;
    s.current_ua = -6'000'000;
    p.count(s);
  }
  p.supply_failing(now(), 4'711);
  boot(ResetCause::software);
  EXPECT_EQ(p.starting_point()->soc_ppb, 555'555'555);
  EXPECT_EQ(p.starting_point()->soc_sigma_ppb, percent_ppb) << "nothing has moved since";
  EXPECT_EQ(p.charge().operating_s, 150U);
  EXPECT_EQ(p.charge().discharged_uah, 250'000U);
  EXPECT_EQ(p.charge().calendar_s, 4'711U);
  EXPECT_EQ(p.cells().count, 0);
}

TEST_F(PersistenceTest, AtAShutdownWhatHasChangedIsWrittenWhetherItIsDueOrNot) {
  boot();
  cells.assign(16, {});
  drive(61);
  const auto everything = [&] {
    return std::tuple{p.cells(), p.health(), p.events().last(0), p.settings().get(8), p.starting_point()->soc_ppb};
  };
  for (const int k : {1, 2}) {
    cells[7].soc = static_cast<std::int16_t>(200 * k);
    health.resistance_ppm += 10'000;
    pack.soc_ppb -= 1;
    for (int faults = 0; faults < 20; ++faults) p.fault(static_cast<std::uint16_t>(0x100 * k + faults));
    p.set(8, k);
    p.power_failing(now(), std::nullopt);
    const auto stored = std::tuple{p.cells(), p.health(), p.events().last(0), p.settings().get(8), pack.soc_ppb};
    EXPECT_EQ(p.cells().cell[7].soc, 200 * k);
    EXPECT_EQ(p.health(), health);
    boot(ResetCause::software);
    EXPECT_EQ(everything(), stored);
    const auto before = steps();
    p.power_failing({std::nullopt, cells, health}, std::nullopt);
    EXPECT_LE(steps() - before, 80U) << "the events of this start, and the record before them once more";
    const auto nothing_left = steps();
    p.power_failing({std::nullopt, cells, health}, std::nullopt);
    EXPECT_EQ(steps(), nothing_left);
  }
}

/// Sigma after a reset: by what soc moved in the minute before, also in the first minute of a run.
TEST_F(PersistenceTest, TheFirstMinuteOfARunCountsFromWhatWasStored) {
  boot();
  drive(1);
  boot(ResetCause::watchdog);
  drive(1, -3'000'000, -5'000'000);
  boot(ResetCause::watchdog);
  EXPECT_EQ(p.starting_point()->soc_ppb, 595'000'000);
  EXPECT_EQ(p.starting_point()->soc_sigma_ppb, percent_ppb + 5'000'000);
}

TEST_F(PersistenceTest, AUnitIsCountedWhenItIsWhole) {
  for (const std::int32_t sign : {1, -1}) {
    boot();
    const auto before = p.charge();
    measurement::Sample s;
    s.current_ua = sign * 59'999;
    s.time_us = 60'001;  // one uA us less than a uAh
    p.count(s);
    p.supply_failing({}, std::nullopt);
    EXPECT_EQ(p.charge().charged_uah + p.charge().discharged_uah, before.charged_uah + before.discharged_uah);
    s.current_ua = sign;
    s.time_us += 1;
    p.count(s);
    s.current_ua = 0;
    s.time_us += 1'000'000 - 60'003;
    p.count(s);
    p.supply_failing({}, std::nullopt);
    EXPECT_EQ(p.charge().charged_uah - before.charged_uah, sign > 0 ? 1U : 0U);
    EXPECT_EQ(p.charge().discharged_uah - before.discharged_uah, sign < 0 ? 1U : 0U);
    EXPECT_EQ(p.charge().operating_s, before.operating_s) << "a microsecond is missing";
    s.time_us += 1;
    p.count(s);
    p.supply_failing({}, std::nullopt);
    EXPECT_EQ(p.charge().operating_s, before.operating_s + 1);
    p.power_failing(now(), std::nullopt);
  }
}

TEST_F(PersistenceTest, AfterYearsOfStandingStillWhatMovesIsWritten) {
  cells.assign(16, {});
  boot();
  for (int minute = 0; minute < 0x1'0000 + 62; ++minute)
    p.store(now(), std::nullopt);  // the counters of minutes have stopped at their end
  cells[2].soc = 1'000;
  health.capacity_ppm = 900'000;
  p.store(now(), std::nullopt);
  EXPECT_EQ(p.cells().cell[2].soc, 1'000);
  EXPECT_EQ(p.health(), health);
}

TEST_F(PersistenceTest, TimeAndChargeAreCountedFromTheFirstSampleByAClockThatGoesOn) {
  p = {};
  p.start(ResetCause::power_on, std::nullopt, std::nullopt);
  measurement::Sample s;
  s.current_ua = 6'000'000;
  s.time_us = 36'000'000'000;
  EXPECT_FALSE(p.count(s)) << "ten hours since the core started are not of operation";
  for (int k = 0; k < 1'000'000; ++k) ASSERT_FALSE(p.count(s)) << "stands";
  s.time_us = 5;
  EXPECT_FALSE(p.count(s)) << "went back";
  s.time_us += 59'999'999;
  EXPECT_FALSE(p.count(s));
  s.time_us += 1;
  EXPECT_TRUE(p.count(s));
  p.store(now(), std::nullopt);
  EXPECT_EQ(p.charge().operating_s, 60U);
  EXPECT_EQ(p.charge().charged_uah, 100'000U);
  s.time_us += 3'600'000'000;
  EXPECT_TRUE(p.count(s)) << "a gap is a minute at most";
  p.store(now(), std::nullopt);
  EXPECT_EQ(p.charge().operating_s, 120U);
  EXPECT_EQ(p.charge().charged_uah, 200'000U);
  s.current_ua = measurement::no_reading;
  s.time_us += 60'000'000;
  EXPECT_TRUE(p.count(s));
  p.store(now(), std::nullopt);
  EXPECT_EQ(p.charge().operating_s, 180U);
  EXPECT_EQ(p.charge().charged_uah, 200'000U);
  EXPECT_EQ(p.charge().discharged_uah, 0U);
}

/// A rest of each minute stays: 7 uA, samples every 0.7 s.
TEST_F(PersistenceTest, NothingIsLostToRoundingInAThousandMinutes) {
  for (const std::int32_t current_ua : {7, -7}) {
    boot();
    const auto charge_before = p.charge();
    measurement::Sample s;
    s.current_ua = current_ua;
    for (int k = 0; k < 86'000; ++k) {
      s.time_us += 700'000;
      if (p.count(s)) p.store(now(), std::nullopt);
    }
    const double hours = 86'000 * 0.7 / 3'600;
    EXPECT_EQ(p.charge().operating_s - charge_before.operating_s, static_cast<std::uint32_t>(3'600 * hours));
    EXPECT_EQ(p.charge().charged_uah - charge_before.charged_uah,
              current_ua > 0 ? static_cast<std::uint64_t>(7 * hours) : 0);
    EXPECT_EQ(p.charge().discharged_uah - charge_before.discharged_uah,
              current_ua < 0 ? static_cast<std::uint64_t>(7 * hours) : 0);
  }
}

TEST_F(PersistenceTest, ResetsAreCountedByTheirCauseUpToWhatTheirCountersHold) {
  EventsRecord e;
  e.resets[static_cast<std::size_t>(ResetCause::watchdog)] = 0xFFFE;
  {
    storage::Log log;
    log.open();
    while (log.needs_erase()) log.erase_next_sector();
    std::array<std::uint8_t, storage::max_payload_bytes> bytes;
    ASSERT_EQ(log.store(EventsRecord::kind, encode(e, bytes)), storage::StoreResult::stored);
  }
  for (int k = 0; k < 3; ++k) {
    boot(ResetCause::watchdog);
    drive(1);
  }
  boot(ResetCause::pin);
  EXPECT_EQ(p.events().resets[static_cast<std::size_t>(ResetCause::watchdog)], 0xFFFF);
  EXPECT_EQ(p.events().resets[static_cast<std::size_t>(ResetCause::pin)], 1);
  EXPECT_EQ(p.events().starts, 4U);
}

TEST_F(PersistenceTest, TheTimeOffIsKnownOfAResetOfTheCoreAndByAClockThatRanBeforeAndAfter) {
  boot();
  drive(1);
  p.power_failing(now(), std::nullopt);
  boot(ResetCause::power_on, 1'000'000);
  EXPECT_FALSE(p.off_s()) << "no clock ran when it was stored";
  p.power_failing(now(), 1'000'000);
  for (const ResetCause cause : {ResetCause::software, ResetCause::watchdog, ResetCause::pin})
    EXPECT_EQ(boot(cause, 2'000'000).off_s(), 0U);
  EXPECT_EQ(boot(ResetCause::brown_out, 1'000'000).off_s(), 0U);
  EXPECT_EQ(boot(ResetCause::power_on, 1'000'001).off_s(), 1U);
  for (std::uint32_t s = 0; s < 3; ++s) flash.fill(s, std::vector<std::uint8_t>(chip.sector_bytes, 0));
  EXPECT_FALSE(boot(ResetCause::power_on, 1'000'001).off_s()) << "nothing is known";
}

TEST_F(PersistenceTest, AStormOfFaultsAndAChainOfStartsWriteLittle) {
  boot();
  drive(1);
  const auto before = steps();
  for (int k = 0; k < 10'000; ++k) p.fault(9);
  const auto burst = steps() - before;
  EXPECT_LE(burst, 16 * 40U);
  for (int minute = 0; minute < 24 * 60; ++minute) {
    p.fault(9);
    drive(1);
  }
  // sixteen and one every ten minutes, 34 words each; and charge once
  EXPECT_LE(steps() - before, burst + (24 * 6 + 2) * 34U + 100) << "a day";
  boot();
  drive(1);
  const auto started = steps();
  for (int k = 0; k < 100; ++k) {
    boot(ResetCause::brown_out);
    time_us = 0;
    for (int s = 0; s < 59; ++s) {
      measurement::Sample sample;
      sample.time_us = time_us += 1'000'000;
      EXPECT_FALSE(p.count(sample));
    }
  }
  EXPECT_EQ(steps(), started);
}

TEST_F(PersistenceTest, AStillBatteryIsWrittenDownOnce) {
  boot();
  drive(1);
  const auto before = steps();
  drive(600);
  EXPECT_LE(steps() - before, 8U) << "health, after an hour";
}

TEST_F(PersistenceTest, WithoutLeaveToEraseTheReserveLastsForElevenHoursOfMovingAndThenNothingIsLost) {
  boot();
  erases_allowed = false;
  const auto erases = flash.erases();
  int minutes = 0;
  for (std::uint64_t before = ~0ULL; before != steps() && minutes < 5'000; ++minutes) {
    before = steps();
    drive(1, -6'000'000, minutes % 2 == 0 ? -2'000'000 : 2'000'000);
  }
  std::printf("%d minutes without an erase\n", minutes);
  EXPECT_GT(minutes, 11 * 60);
  EXPECT_LT(minutes, 5'000);
  EXPECT_EQ(flash.erases(), erases);
  EXPECT_TRUE(p.needs_erase());
  EXPECT_TRUE(p.log().operational());
  EXPECT_EQ(boot(ResetCause::watchdog).starting_point()->soc_ppb / 1'000'000, minutes % 2 == 0 ? 598 : 600)
      << "of the last minute that was written";
}

/// Layout 1 as the first firmware that stored anything wrote it, in flash that nobody else has touched.
TEST_F(PersistenceTest, AnOlderFirmwaresRecordIsMigrated) {
  std::vector<std::uint8_t> sector(16, 0), payload;
  put(payload, 432'100'000);
  put(payload, 15'000'000);
  const auto record = record_bytes(1, 1, 1, payload);
  sector.insert(sector.end(), record.begin(), record.end());
  flash.fill(0, sector);
  boot(ResetCause::software);
  ASSERT_TRUE(p.starting_point());
  EXPECT_EQ(p.starting_point()->soc_ppb, 432'100'000);
  EXPECT_EQ(p.starting_point()->soc_sigma_ppb, 15'000'000 + 16'666'667);
  EXPECT_EQ(p.newer_records(), 0U);
  drive(2, -6'000'000, -16'666'667);
  boot(ResetCause::software);
  EXPECT_EQ(p.starting_point()->soc_ppb, 566'666'666) << "as the estimator said, in the layout of today";
  EXPECT_EQ(p.log().current_records().size(), 2U) << "charge in the layout of today, events; health is not due";
}

TEST_F(PersistenceTest, ANewerFirmwaresRecordIsKeptReportedAndNotRead) {
  boot();
  drive(1);
  const std::vector<std::uint8_t> unknown(50, 0x5A);
  {
    storage::Log log;
    log.open();
    ASSERT_EQ(log.store({1, 3}, unknown), storage::StoreResult::stored);
    ASSERT_EQ(log.store({9, 1}, unknown), storage::StoreResult::stored);
  }
  boot(ResetCause::software);
  EXPECT_EQ(p.newer_records(), 2U);
  EXPECT_FALSE(p.starting_point()) << "the newer firmware has replaced what this one wrote";
  for (int k = 0; k < 3'000; ++k) drive(1, -6'000'000, k % 2 == 0 ? -2'000'000 : 2'000'000);
  EXPECT_GE(p.log().erase_cycles(), 2U);
  boot(ResetCause::software);
  EXPECT_EQ(p.newer_records(), 2U);
  EXPECT_EQ(p.starting_point()->soc_ppb, 60 * percent_ppb) << "what this firmware has written since";
  std::array<std::uint8_t, storage::max_payload_bytes> bytes;
  storage::Log log;
  log.open();
  const auto found = log.load(9, 1, bytes);
  ASSERT_TRUE(found);
  EXPECT_TRUE(std::ranges::equal(found->payload, unknown));
}

TEST_F(PersistenceTest, WithoutFlashItRunsAndSaysSo) {
  plug_in(nullptr);
  boot();
  EXPECT_FALSE(p.starting_point());
  drive(2, 1'000'000);
  p.fault(1);
  EXPECT_TRUE(p.set(1, 2));
  p.power_failing(now(), std::nullopt);
  EXPECT_EQ(p.log().sectors(), 0U);
  EXPECT_FALSE(p.log().operational());
  EXPECT_EQ(p.settings().get(1), 2) << "in this run";
}

TEST_F(PersistenceTest, WithBrokenSectorsItRunsAndSaysSo) {
  for (std::uint32_t s = 0; s < 3; ++s) flash.wear_out(s, FlashModel::Wear::erase_fails);
  boot();
  drive(3, -6'000'000, -2'000'000);
  EXPECT_EQ(p.log().broken(), 3U);
  EXPECT_FALSE(p.log().operational());
  boot();
  EXPECT_FALSE(p.starting_point());
}

/// A month of a truck that never rests: soc, cells and health move all the time. Written is what the policy lets
/// through.
TEST_F(PersistenceTest, FlashLastsSeventeenYearsOfMovingWithoutRest) {
  constexpr double endurance = 10'000,
                   minutes_a_year = 365.25 * 24 * 60;  // STM32F405 datasheet DS8626, flash endurance
  boot();
  cells.assign(16, {});
  constexpr int days = 60;
  const auto before = flash.erases();
  for (int minute = 0; minute < days * 24 * 60; ++minute) {
    for (auto& c : cells) c.soc = static_cast<std::int16_t>(minute % 3'000 - 1'500);
    health.resistance_ppm = 1'000'000 + minute % 2 * 5'000 + minute % 300 * 1'000;
    drive(1, -6'000'000, minute % 2 == 0 ? -2'000'000 : 2'000'000);
  }
  double most = 0, least = 1e9;
  for (std::size_t s = 0; s < 3; ++s) {
    const auto n = static_cast<double>(flash.erases()[s] - before[s]);
    most = std::max(most, n);
    least = std::min(least, n);
  }
  const double years = endurance / (most / days) / 365.25;
  std::printf("%d days, a record of charge a minute: erased %.0f to %.0f times a sector, %.1f years\n", days, least,
              most, years);
  EXPECT_LE(most - least, 1);
  EXPECT_GT(years, 15);
  EXPECT_LT(years, endurance * 3 * 341 / minutes_a_year) << "more than three lines a minute are written";
  EXPECT_EQ(flash.violations(), 0U);
}

}  // namespace
}  // namespace bms
