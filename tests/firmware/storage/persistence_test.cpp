// What is stored over boots, and what a start restores.
#include "storage/persistence.hpp"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "tests/firmware/storage/fed_watchdog.hpp"
#include "tests/firmware/storage/persistence_bench.hpp"
#include "tests/firmware/storage/record_bytes.hpp"

namespace bms {
namespace {

using storage::EventsRecord;

TEST_F(PersistenceTest, NewFlashGivesNoStartingPointAndIsErasedAtBoot) {
  EXPECT_FALSE(boot().starting_point());
  EXPECT_FALSE(p.needs_erase());
  EXPECT_EQ(p.events().starts, 1U);
}

TEST_F(PersistenceTest, TheWatchdogIsFedAfterEveryEraseAtBoot) {
  hal::fed = 0;
  boot();
  EXPECT_EQ(flash.erases(), (std::vector<std::uint64_t>{1, 1, 1}));
  EXPECT_EQ(hal::fed, 3);
  boot();
  EXPECT_EQ(hal::fed, 3) << "no sector to erase";
}

/// An unsteady bit in each byte of the last record, with each period.
TEST_F(PersistenceTest, AnUnsteadyBitDoesNotBlockABoot) {
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
        ADD_FAILURE() << "does not end with an unsteady bit in byte " << at << ", wrong in every read number " << every;
      }
    }
  }
}

TEST_F(PersistenceTest, SocIsRestoredAfterAResetWithASigmaForTheUnwrittenMinute) {
  boot();
  drive(3, -3'000'000, -8'000'000);
  boot(ResetCause::watchdog);
  ASSERT_TRUE(p.starting_point());
  EXPECT_EQ(p.starting_point()->soc_ppb, 576'000'000);
  EXPECT_EQ(p.starting_point()->soc_sigma_ppb, 18'000'000) << "1 % and the movement in the last minute";
  EXPECT_EQ(p.off_s(), 0U);
}

TEST_F(PersistenceTest, AfterAShutdownSocIsRestoredExactly) {
  boot();
  drive(3, -3'000'000, -8'000'000);
  pack.soc_ppb = 571'234'567;
  p.power_failing(now(), std::nullopt);
  boot(ResetCause::watchdog);
  EXPECT_EQ(p.starting_point()->soc_ppb, 571'234'567);
  EXPECT_EQ(p.starting_point()->soc_sigma_ppb, percent_ppb);
}

TEST_F(PersistenceTest, TimeOffWidensSigmaByTheCalendarOrByAMonthWithoutACalendar) {
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
  EXPECT_FALSE(p.off_s()) << "a calendar that went back is not used";
}

TEST_F(PersistenceTest, AnEstimatorThatHasNotStartedDoesNotOverwriteAStoredEstimate) {
  boot();
  drive(2);
  known = false;
  boot(ResetCause::watchdog);
  drive(5);
  p.power_failing(now(), std::nullopt);
  boot(ResetCause::watchdog);
  EXPECT_EQ(p.starting_point()->soc_ppb, 60 * percent_ppb);
}

TEST_F(PersistenceTest, AllRecordsAreRestored) {
  cells.assign(16, {});
  for (int k = 0; k < 16; ++k) cells[static_cast<std::size_t>(k)] = {static_cast<std::int16_t>(500 * k - 4'000), 700};
  health = {930'000, 5'000, 1'200'000, 20'000};
  boot(ResetCause::watchdog);
  drive(120, 6'000'000);
  drive(60, -12'000'000);
  p.fault(102);
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
  EXPECT_EQ(p.events().last(0).code, 102);
  EXPECT_EQ(p.events().last(0).time_s, 180U * 60) << "in operation: no calendar clock";
  EXPECT_EQ(p.events().starts, 2U);
  EXPECT_EQ(p.events().resets[static_cast<std::size_t>(ResetCause::watchdog)], 1U);
  EXPECT_EQ(p.settings().get(40), -5);
}

TEST_F(PersistenceTest, AFaultIsWrittenAtOnceAndAProcessorFaultWithTheNextMinute) {
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

TEST_F(PersistenceTest, OnlyWholeUnitsAreCounted) {
  for (const std::int32_t sign : {1, -1}) {
    boot();
    const auto before = p.charge();
    measurement::Sample s;
    s.current_ua = sign * 59'999;
    s.time_us = 60'001;  // one uA us less than 1 uAh
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

TEST_F(PersistenceTest, TimeAndChargeAreCountedFromTheFirstSampleWhileTheClockAdvances) {
  p = {};
  p.start(ResetCause::power_on, std::nullopt, std::nullopt);
  measurement::Sample s;
  s.current_ua = 6'000'000;
  s.time_us = 36'000'000'000;
  EXPECT_FALSE(p.count(s)) << "the time before the first sample does not count";
  for (int k = 0; k < 1'000'000; ++k) ASSERT_FALSE(p.count(s)) << "stopped clock";
  s.time_us = 5;
  EXPECT_FALSE(p.count(s)) << "clock went back";
  s.time_us += 59'999'999;
  EXPECT_FALSE(p.count(s));
  s.time_us += 1;
  EXPECT_TRUE(p.count(s));
  p.store(now(), std::nullopt);
  EXPECT_EQ(p.charge().operating_s, 60U);
  EXPECT_EQ(p.charge().charged_uah, 100'000U);
  s.time_us += 3'600'000'000;
  EXPECT_TRUE(p.count(s)) << "a gap counts as at most a minute";
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

/// Fractions remain from minute to minute: 7 uA, samples every 0.7 s.
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

TEST_F(PersistenceTest, ResetsAreCountedByCauseAndSaturate) {
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

TEST_F(PersistenceTest, TheTimeOffIsKnownAfterACoreResetOrWithARunningCalendar) {
  boot();
  drive(1);
  p.power_failing(now(), std::nullopt);
  boot(ResetCause::power_on, 1'000'000);
  EXPECT_FALSE(p.off_s()) << "no calendar when the record was stored";
  p.power_failing(now(), 1'000'000);
  for (const ResetCause cause : {ResetCause::software, ResetCause::watchdog, ResetCause::pin})
    EXPECT_EQ(boot(cause, 2'000'000).off_s(), 0U);
  EXPECT_EQ(boot(ResetCause::brown_out, 1'000'000).off_s(), 0U);
  EXPECT_EQ(boot(ResetCause::power_on, 1'000'001).off_s(), 1U);
  for (std::uint32_t s = 0; s < 3; ++s) flash.fill(s, std::vector<std::uint8_t>(chip.sector_bytes, 0));
  EXPECT_FALSE(boot(ResetCause::power_on, 1'000'001).off_s()) << "no stored record";
}

/// A record with layout 1, as the first firmware wrote it.
TEST_F(PersistenceTest, ARecordOfAnOlderFirmwareIsMigrated) {
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
  EXPECT_EQ(p.starting_point()->soc_ppb, 566'666'666) << "the estimator's value, in the current layout";
  EXPECT_EQ(p.log().current_records().size(), 2U) << "charge in the current layout, and events; health is not due";
}

TEST_F(PersistenceTest, ARecordOfANewerFirmwareIsPreservedReportedAndNotRead) {
  boot();
  drive(1);
  const std::vector<std::uint8_t> unknown(50, 0x5A);
  {
    storage::Log log;
    log.open();
    ASSERT_EQ(log.store({1, 3}, unknown), storage::StoreResult::stored);
    ASSERT_EQ(log.store({11, 1}, unknown), storage::StoreResult::stored);
  }
  boot(ResetCause::software);
  EXPECT_EQ(p.newer_records(), 2U);
  EXPECT_FALSE(p.starting_point()) << "the newer firmware replaced the old record";
  for (int k = 0; k < 3'000; ++k) drive(1, -6'000'000, k % 2 == 0 ? -2'000'000 : 2'000'000);
  EXPECT_GE(p.log().erase_cycles(), 2U);
  boot(ResetCause::software);
  EXPECT_EQ(p.newer_records(), 2U);
  EXPECT_EQ(p.starting_point()->soc_ppb, 60 * percent_ppb) << "a record that this firmware wrote since";
  std::array<std::uint8_t, storage::max_payload_bytes> bytes;
  storage::Log log;
  log.open();
  const auto found = log.load(11, 1, bytes);
  ASSERT_TRUE(found);
  EXPECT_TRUE(std::ranges::equal(found->payload, unknown));
}

TEST_F(PersistenceTest, WithoutFlashItRunsAndReportsIt) {
  plug_in(nullptr);
  boot();
  EXPECT_FALSE(p.starting_point());
  drive(2, 1'000'000);
  p.fault(1);
  EXPECT_FALSE(p.set(1, 2)) << "not stored";
  p.power_failing(now(), std::nullopt);
  EXPECT_EQ(p.log().sectors(), 0U);
  EXPECT_FALSE(p.log().operational());
  EXPECT_EQ(p.settings().get(1), 2) << "in this run";
}

TEST_F(PersistenceTest, WithBrokenSectorsItRunsAndReportsThem) {
  for (std::uint32_t s = 0; s < 3; ++s) flash.wear_out(s, FlashModel::Wear::erase_fails);
  boot();
  drive(3, -6'000'000, -2'000'000);
  EXPECT_EQ(p.log().broken(), 3U);
  EXPECT_FALSE(p.log().operational());
  boot();
  EXPECT_FALSE(p.starting_point());
}

}  // namespace
}  // namespace bms
