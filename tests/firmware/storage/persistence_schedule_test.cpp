// When each record is written, and how long the flash lasts.
#include "storage/persistence.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "tests/firmware/storage/persistence_bench.hpp"

namespace bms {
namespace {

using storage::ChargeRecord;
using storage::EventsRecord;
using storage::HealthRecord;
using Minutes = std::vector<int>;

TEST_F(PersistenceTest, ChargeIsWrittenAfterSocHasMovedByATenthOfAPercent) {
  for (const int sign : {1, -1}) {
    boot();
    EXPECT_EQ(written<ChargeRecord>(6, [&](int) { pack.soc_ppb += sign * 1'000'000; }), (Minutes{1, 2, 3, 4, 5, 6}));
    EXPECT_EQ(written<ChargeRecord>(6, [&](int) { pack.soc_ppb += sign * 999'999; }), (Minutes{2, 4, 6}));
    EXPECT_EQ(written<ChargeRecord>(6, [&](int) { pack.soc_ppb += sign * 400'000; }), (Minutes{3, 6}))
        << "a drift counts from the stored value";
  }
}

TEST_F(PersistenceTest, ChargeIsWrittenAfterItsSigmaHasMovedByATenth) {
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

TEST_F(PersistenceTest, ChargeIsWrittenAfterAnHourOnlyIfChargeHasFlowed) {
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

TEST_F(PersistenceTest, CellsAreWrittenEveryHalfHourIfOneHasMoved) {
  cells.assign(16, {});
  boot();
  EXPECT_EQ(written<CellsRecord>(100, [&](int minute) { cells[5].soc = static_cast<std::int16_t>(100 * minute); }),
            (Minutes{30, 60, 90}));
  EXPECT_EQ(written<CellsRecord>(100, [](int) {}), (Minutes{20})) << "the last change, and then nothing";
  for (std::size_t k = 0; k < 16; ++k) {
    for (const int by : {100, -100}) {
      cells[k].soc = static_cast<std::int16_t>(cells[k].soc + by - by / 100);
      EXPECT_EQ(written<CellsRecord>(40, [](int) {}), Minutes{}) << k << ": less than 0.1 %";
      cells[k].soc = static_cast<std::int16_t>(cells[k].soc + by / 100);
      EXPECT_EQ(written<CellsRecord>(40, [](int) {}), (Minutes{1})) << k << ": due since the end of the half hour";
      ASSERT_TRUE(std::equal(cells.begin(), cells.end(), p.cells().cell.begin()));
    }
  }
  cells.resize(15);
  EXPECT_EQ(written<CellsRecord>(40, [](int) {}).size(), 1U) << "another number of cells";
  cells.assign(32, {1'000, 0});
  EXPECT_EQ(written<CellsRecord>(40, [](int) {}).size(), 1U);
  cells.assign(33, {2'000, 0});
  EXPECT_EQ(written<CellsRecord>(40, [](int) {}), Minutes{}) << "more cells than a record can store";
}

TEST_F(PersistenceTest, HealthIsWrittenEveryHourIfAValueHasMoved) {
  boot();
  EXPECT_EQ(written<HealthRecord>(190, [&](int minute) { health.capacity_ppm = 1'000'000 - 1'000 * minute; }),
            (Minutes{60, 120, 180}));
  EXPECT_EQ(written<HealthRecord>(300, [](int) {}), (Minutes{50})) << "the last change, and then nothing";
  for (const auto value : {&HealthRecord::capacity_ppm, &HealthRecord::capacity_sigma_ppm,
                           &HealthRecord::resistance_ppm, &HealthRecord::resistance_sigma_ppm}) {
    for (const std::int32_t by : {1'000, -1'000}) {
      health.*value += by / 2;
      EXPECT_EQ(written<HealthRecord>(65, [](int) {}), Minutes{}) << "less than 0.1 %";
      health.*value += by - by / 2;
      EXPECT_EQ(written<HealthRecord>(65, [](int) {}), (Minutes{1})) << "a drift counts from the stored value";
      EXPECT_EQ(p.health(), health);
    }
  }
}

TEST_F(PersistenceTest, SixteenFaultsAreWrittenAtOnceAndThenOneEveryTenMinutes) {
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
  EXPECT_EQ(written<EventsRecord>(40, [](int) {}), (Minutes{5})) << "the remaining faults, once";
  EXPECT_EQ(at_once(40), 3) << "gained in 35 minutes";
  drive(170);  // one record for the remaining faults
  EXPECT_EQ(at_once(40), 16);
  boot(ResetCause::software);
  EXPECT_EQ(p.events().faults, 40U + 35 + 40 + 16);
}

/// All sectors are full and no erase is allowed. Within a minute of an erase, the failed writes succeed.
TEST_F(PersistenceTest, AFailedWriteIsRepeatedEveryMinute) {
  boot();
  cells.assign(16, {});
  drive(61);
  erases_allowed = false;
  drive_until_full();
  drive(20, -6'000'000, -2'000'000);  // the last record of charge
  const auto before = steps();
  cells[3].soc = 500;
  health.capacity_ppm -= 50'000;
  pack.soc_ppb += 5'000'000;
  p.fault(77);
  EXPECT_FALSE(p.set(9, 99)) << "not stored";
  EXPECT_FALSE(p.settings_stored());
  drive(70);
  EXPECT_EQ(steps(), before);
  p.erase_next_sector();
  drive(1);
  EXPECT_TRUE(p.settings_stored());
  boot(ResetCause::software);
  EXPECT_EQ(p.starting_point()->soc_ppb, pack.soc_ppb);
  EXPECT_EQ(p.cells().cell[3].soc, 500);
  EXPECT_EQ(p.health(), health);
  EXPECT_EQ(p.events().last(0).code, 77);
  EXPECT_EQ(p.settings().get(9), 99);
}

TEST_F(PersistenceTest, ASettingIsWrittenAtOnceAndOnlyIfItChanges) {
  boot();
  EXPECT_TRUE(p.set(3, 5));
  const auto before = steps();
  EXPECT_TRUE(p.set(3, 5));
  drive(0);
  EXPECT_EQ(steps(), before);
  EXPECT_TRUE(p.set(3, 6));
  EXPECT_EQ(boot().settings().get(3), 6);
  for (std::uint16_t key = 100; key < 123; ++key) EXPECT_TRUE(p.set(key, 1, storage::Urgency::safety));
  EXPECT_FALSE(p.set(200, 1)) << "no room for another key";
  EXPECT_TRUE(p.set(3, 7));
}

TEST_F(PersistenceTest, SettingsAreLimitedToEightAndThenOneAnHourButThoseThatProtectAreNot) {
  boot();
  for (int k = 0; k < 8; ++k) EXPECT_TRUE(p.set(3, k)) << k;
  const auto before = steps();
  EXPECT_FALSE(p.set(3, 99));
  EXPECT_FALSE(p.may_set());
  EXPECT_EQ(steps(), before) << "nothing is written";
  EXPECT_EQ(p.settings().get(3), 7) << "nor changed";
  EXPECT_TRUE(p.settings_stored());
  for (int k = 0; k < 30; ++k) EXPECT_TRUE(p.set(1, k, storage::Urgency::safety));
  drive(59);
  EXPECT_FALSE(p.set(3, 99));
  drive(1);
  EXPECT_TRUE(p.set(3, 99));
  EXPECT_FALSE(p.set(3, 100));
}

/// The older copy of each setting: the newest record of its type is made unreadable, bit by bit.
TEST_F(PersistenceTest, SettingsSurviveTheLossOfEitherRecord) {
  for (const storage::Kind lost : {storage::SettingsRecord::kind, storage::SettingsRecord::copy}) {
    for (int flip = 0; flip < 40; ++flip) {
      plug_in(nullptr);
      flash = FlashModel(chip, 1);
      plug_in(&flash);
      boot();
      EXPECT_TRUE(p.set(1, 5, storage::Urgency::safety));
      EXPECT_TRUE(p.set(1, 1'024, storage::Urgency::safety));
      const auto records = p.log().current_records();
      const auto place = std::ranges::find_if(records, [&](const auto& r) { return r.kind == lost; });
      ASSERT_NE(place, records.end());
      auto bytes = flash.bytes(place->sector);
      const std::size_t at = place->line * storage::line_bytes +
                             static_cast<std::size_t>(flip * 29) % (storage::line_bytes + place->length);
      bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ 1 << flip % 8);
      flash.fill(place->sector, bytes);
      boot();
      EXPECT_EQ(p.settings().get(1), 1'024) << flip;
      drive(1);
      EXPECT_TRUE(p.settings_stored()) << "both are whole again";
    }
  }
}

TEST_F(PersistenceTest, ActionsAreStoredWithTheNextMinuteAndAtMostSixteenAndThenOneAnHour) {
  boot();
  p.action({1, 4'711, 1, 0}, 1'790'000'000);
  drive(1);
  boot();
  EXPECT_EQ(p.actions().last(0), (storage::ActionsRecord::Action{1, 4'711, 1, 1'790'000'000}));
  const auto minutes = written<storage::ActionsRecord>(300, [&](int minute) {
    p.action({3, 1, static_cast<std::uint32_t>(minute), 0}, std::nullopt);
  });
  EXPECT_GE(minutes.size(), 16U);
  EXPECT_LE(minutes.size(), 16U + 5);
}

TEST_F(PersistenceTest, WhenTheSupplyFallsOnlyChargeIsWritten) {
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
  EXPECT_EQ(p.starting_point()->soc_sigma_ppb, percent_ppb) << "no movement since the record";
  EXPECT_EQ(p.charge().operating_s, 150U);
  EXPECT_EQ(p.charge().discharged_uah, 250'000U);
  EXPECT_EQ(p.charge().calendar_s, 4'711U);
  EXPECT_EQ(p.cells().count, 0);
}

TEST_F(PersistenceTest, AtAShutdownAllChangesAreWrittenBeforeTheyAreDue) {
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
    for (int faults = 0; faults < 20; ++faults) p.fault(static_cast<std::uint16_t>(40 * k + faults));
    p.set(8, k);
    p.power_failing(now(), std::nullopt);
    const auto stored = std::tuple{p.cells(), p.health(), p.events().last(0), p.settings().get(8), pack.soc_ppb};
    EXPECT_EQ(p.cells().cell[7].soc, 200 * k);
    EXPECT_EQ(p.health(), health);
    boot(ResetCause::software);
    EXPECT_EQ(everything(), stored);
    const auto before = steps();
    p.power_failing({std::nullopt, cells, health}, std::nullopt);
    EXPECT_LE(steps() - before, 80U) << "the events of this start, and one copy of the record before";
    const auto nothing_left = steps();
    p.power_failing({std::nullopt, cells, health}, std::nullopt);
    EXPECT_EQ(steps(), nothing_left);
  }
}

/// After a reset, sigma grows by the movement of soc in the minute before, also in the first minute of a run.
TEST_F(PersistenceTest, TheFirstMinuteOfARunCountsFromTheStoredSoc) {
  boot();
  drive(1);
  boot(ResetCause::watchdog);
  drive(1, -3'000'000, -5'000'000);
  boot(ResetCause::watchdog);
  EXPECT_EQ(p.starting_point()->soc_ppb, 595'000'000);
  EXPECT_EQ(p.starting_point()->soc_sigma_ppb, percent_ppb + 5'000'000);
}

TEST_F(PersistenceTest, AfterYearsAtRestMovementIsWritten) {
  cells.assign(16, {});
  boot();
  for (int minute = 0; minute < 0x1'0000 + 62; ++minute)
    p.store(now(), std::nullopt);  // the counters of minutes are saturated
  cells[2].soc = 1'000;
  health.capacity_ppm = 900'000;
  p.store(now(), std::nullopt);
  EXPECT_EQ(p.cells().cell[2].soc, 1'000);
  EXPECT_EQ(p.health(), health);
}

TEST_F(PersistenceTest, ManyFaultsAndManyStartsWriteLittle) {
  boot();
  drive(1);
  const auto before = steps();
  for (int k = 0; k < 10'000; ++k) p.fault(9);
  const auto burst = steps() - before;
  EXPECT_LE(burst, 16 * 70U);
  for (int minute = 0; minute < 24 * 60; ++minute) {
    p.fault(9);
    drive(1);
  }
  // Sixteen records and one every ten minutes, 62 words each (a header of 4, 230 bytes); charge once. Every 63 records,
  // 1,008 lines, move the others of at most 25 lines into the next sector.
  EXPECT_LE(steps() - before, burst + (24 * 6 + 2) * 62U + 3 * 100 + 100) << "a day";
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

TEST_F(PersistenceTest, ABatteryAtRestIsWrittenOnce) {
  boot();
  drive(1);
  const auto before = steps();
  drive(600);
  EXPECT_LE(steps() - before, 8U) << "health, after an hour";
}

TEST_F(PersistenceTest, WithoutErasesNothingStoredIsLost) {
  boot();
  erases_allowed = false;
  const auto erases = flash.erases();
  EXPECT_FALSE(p.full());
  drive_until_full();
  EXPECT_EQ(flash.erases(), erases);
  EXPECT_TRUE(p.needs_erase());
  EXPECT_TRUE(p.log().operational());
  const auto last_soc_ppb = pack.soc_ppb;
  drive(200, -6'000'000, -2'000'000);
  EXPECT_EQ(boot(ResetCause::watchdog).starting_point()->soc_ppb, last_soc_ppb) << "the last written minute";
}

/// Two shifts of sixteen hours, from any filling of the active sector, with everything that a pack stores.
TEST_F(PersistenceTest, WithoutErasesTheReserveLastsAtLeast32Hours) {
  int least = 10'000;
  for (int before = 0; before < 360; before += 40) {
    flash = FlashModel(chip, 1);
    boot();
    cells.assign(16, {});
    const auto minutes = [&](int until, const auto& stop) {
      int k = 0;
      for (; k < until && !stop(); ++k) {
        for (auto& c : cells) c.soc = static_cast<std::int16_t>(k % 3'000 - 1'500);
        health.resistance_ppm = 1'000'000 + k % 300 * 1'000;
        drive(1, -6'000'000, k % 2 == 0 ? -2'000'000 : 2'000'000);
      }
      return k;
    };
    erases_allowed = true;
    minutes(200 + before, [] { return false; });
    erases_allowed = false;
    least = std::min(least, minutes(5'000, [&] { return p.full(); }));
  }
  std::printf("at least %d minutes without an erase\n", least);
  EXPECT_GE(least, 32 * 60);
  EXPECT_LT(least, 5'000);
}

TEST_F(PersistenceTest, AFullLogIsReportedAtOnceAndAsAFaultAfterAnHour) {
  boot();
  erases_allowed = false;
  drive_until_full();
  EXPECT_TRUE(p.full());
  EXPECT_FALSE(p.full_for_long());
  drive(59, -6'000'000, -2'000'000);
  EXPECT_FALSE(p.full_for_long());
  drive(2, -6'000'000, -2'000'000);
  EXPECT_TRUE(p.full_for_long());
  p.erase_next_sector();
  EXPECT_TRUE(p.full()) << "one of two";
  p.erase_next_sector();
  EXPECT_FALSE(p.full());
  EXPECT_FALSE(p.full_for_long());
}

/// A truck that never rests: soc, cells and health move all the time, so the policy alone limits the writes.
TEST_F(PersistenceTest, FlashLastsMoreThan15YearsOfOperationWithoutRest) {
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
