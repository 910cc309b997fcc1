// The log on a good flash: rounds, moves, layouts, sizes, and its format byte for byte.
#include "storage/log.hpp"

#include <algorithm>
#include <cstdio>

#include <gtest/gtest.h>

#include "storage/crc32.hpp"
#include "tests/firmware/storage/log_bench.hpp"

namespace bms {
namespace {

TEST_F(LogTest, NewFlashIsEmptyAndStoresAfterAnErase) {
  EXPECT_FALSE(content(log, 1, 1));
  EXPECT_TRUE(log.needs_erase());
  EXPECT_EQ(log.store({1, 1}, {}), StoreResult::needs_erase) << "an erase may have been interrupted";
  ASSERT_EQ(store_record(log, {1, 1}, {7, 8, 9}), StoreResult::stored);
  log.open();
  EXPECT_EQ(content(log, 1, 1), (Bytes{7, 8, 9}));
}

TEST_F(LogTest, ARecordHasTheBytesThatTheHeaderDescribes) {
  ASSERT_EQ(store_record(log, {5, 3}, {1, 2, 3}), StoreResult::stored);
  const Bytes expected = record_bytes(1, 5, 3, {1, 2, 3}), sector = flash.bytes(0);
  EXPECT_EQ(Bytes(sector.begin() + 16, sector.begin() + 48), expected);
}

TEST_F(LogTest, StoringNeverErases) {
  while (log.needs_erase()) log.erase_next_sector();
  const auto erases = flash.erases();
  StoreResult done = StoreResult::stored;
  for (int k = 0; k < 1'000 && done == StoreResult::stored; ++k) done = log.store({1, 1}, number(k));
  EXPECT_EQ(done, StoreResult::needs_erase);
  EXPECT_EQ(flash.erases(), erases);
  log.erase_next_sector();
  EXPECT_EQ(log.store({1, 1}, number(1)), StoreResult::stored);
}

TEST_F(LogTest, SectorsWearEqually) {
  fill_rounds(10'000);
  const auto& e = flash.erases();
  std::printf("10000 records of 4 bytes, sectors of 64 lines: erased %llu, %llu, %llu times\n",
              static_cast<unsigned long long>(e[0]), static_cast<unsigned long long>(e[1]),
              static_cast<unsigned long long>(e[2]));
  EXPECT_GT(e[0], 100U);
  EXPECT_LE(*std::max_element(e.begin(), e.end()) - *std::min_element(e.begin(), e.end()), 1U);
  EXPECT_NEAR(log.erase_cycles(), static_cast<double>(e[0]), 1.01);
}

TEST_F(LogTest, ARecordWithANewerLayoutSurvivesAllRoundsAndAnOlderOneIsReplaced) {
  ASSERT_EQ(store_record(log, {1, 9}, {9, 9}), StoreResult::stored);
  ASSERT_EQ(store_record(log, {77, 1}, {7}), StoreResult::stored) << "a type of a newer firmware";
  ASSERT_EQ(store_record(log, {2, 1}, {1}), StoreResult::stored);
  ASSERT_EQ(store_record(log, {2, 2}, {2}), StoreResult::stored);
  fill_rounds(1'000);
  log.open();
  EXPECT_EQ(content(log, 1, 8), number(999));
  EXPECT_TRUE(std::ranges::any_of(log.current_records(), [](const storage::RecordLocation& r) {
    return r.kind == Kind{1, 9} && r.length == 2;
  })) << "for a firmware that can read it";
  EXPECT_EQ(content(log, 77, 255), (Bytes{7}));
  EXPECT_EQ(content(log, 2, 2), (Bytes{2}));
  EXPECT_FALSE(content(log, 2, 1)) << "migrated";
  EXPECT_EQ(log.current_records().size(), 4U);
}

TEST_F(LogTest, AMoveKeepsExactlyTheCurrentRecords) {
  ASSERT_EQ(store_record(log, {2, 1}, {2}), StoreResult::stored);
  for (int k = 0; k < 200; ++k) {
    ASSERT_EQ(store_record(log, {1, 1}, number(k)), StoreResult::stored);
    ASSERT_EQ(log.current_records().size(), 2U) << k;
    ASSERT_FALSE(content(log, 0, 255));
  }
}

TEST_F(LogTest, AnErasedSectorHasTheMarkOfTheFormat) {
  ASSERT_EQ(store_record(log, {1, 1}, {}), StoreResult::stored);
  Bytes mark{'R', 'E', 'S', 'D', 1, 0, 0, 0, 0, 0, 0, 0};
  put(mark, crc32_by_bits(mark));
  for (std::uint32_t s = 0; s < 3; ++s) {
    const Bytes sector = flash.bytes(s);
    EXPECT_EQ(Bytes(sector.begin(), sector.begin() + 16), mark);
  }
}

TEST_F(LogTest, NumbersWrap) {
  Bytes sector(flash.size().sector_bytes, 0xFF);
  const std::uint32_t line_0 = 0U - 64;  // the last round before 2^32
  const Bytes record = record_bytes(line_0 + 1, 1, 1, number(5));
  std::copy(record.begin(), record.end(), sector.begin() + 16);
  flash.fill(1, sector);
  log.open();
  ASSERT_EQ(content(log, 1, 1), number(5));
  for (int k = 0; k < 100; ++k) {
    ASSERT_EQ(store_record(log, {1, 1}, number(k)), StoreResult::stored) << k;
    Log again;
    again.open();
    ASSERT_EQ(content(again, 1, 1), number(k));
  }
  EXPECT_EQ(flash.violations(), 0U);
}

/// All that a log knows of its records and sectors.
std::vector<std::array<std::uint32_t, 6>> view(const Log& log) {
  std::vector<std::array<std::uint32_t, 6>> all;
  for (const storage::RecordLocation& r : log.current_records())
    all.push_back({r.number, r.kind.type, r.kind.layout, r.sector, r.line, r.length});
  std::ranges::sort(all);
  all.push_back({log.sectors(), log.broken(), log.erase_cycles()});
  return all;
}

TEST_F(LogTest, ABootFindsTheSameRecordsWhereverTheNumbersWrap) {
  for (const std::uint32_t round : {0U - 1, 0U - 2, 0U - 3, 0U - 30, 0x8000'0000U / 64 - 1, 0x8000'0000U / 64 - 4,
                                    0x8000'0000U / 64 + 5, 0xC000'0000U / 64}) {
    flash = FlashModel(small, 1);
    Bytes sector(flash.size().sector_bytes, 0xFF);
    Bytes record = record_bytes(64 * round + 1, 1, 1, number(5));
    const Bytes other = record_bytes(64 * round + 3, 2, 7, {2, 7});
    record.insert(record.end(), other.begin(), other.end());
    std::copy(record.begin(), record.end(), sector.begin() + 16);
    flash.fill(1, sector);
    log.open();
    ASSERT_EQ(content(log, 1, 1), number(5));
    for (int k = 0; k < 200; ++k) {
      ASSERT_EQ(store_record(log, {1, 1}, number(k)), StoreResult::stored) << k;
      Log again;
      again.open();
      ASSERT_EQ(view(again), view(log)) << round << ' ' << k;
    }
    EXPECT_EQ(content(log, 2, 7), (Bytes{2, 7}));
    EXPECT_EQ(flash.violations(), 0U);
  }
}

TEST_F(LogTest, ABootCostsOneCopyOfTheLastRecordAndNoSector) {
  fill_rounds(3);
  auto before = log.current_records().front();
  for (int k = 0; k < 6; ++k) {
    log.open();
    const auto steps = flash.steps();
    log.open();
    EXPECT_EQ(flash.steps(), steps) << "open() writes nothing";
    ASSERT_EQ(log.store({1, 1}, number(k)), StoreResult::stored);
    const auto now = log.current_records().front();
    EXPECT_EQ(now.sector, before.sector);
    EXPECT_EQ(now.line, before.line + 4) << "two records of two lines";
    before = now;
    ASSERT_EQ(log.store({1, 1}, number(k)), StoreResult::stored);
    EXPECT_EQ(log.current_records().front().line, before.line + 2);
    before = log.current_records().front();
  }
}

TEST_F(LogTest, PayloadsOfEveryLengthAreRestoredEvenAfterAMove) {
  for (std::size_t n = 0; n <= storage::max_payload_bytes; ++n) {
    Bytes bytes(n);
    for (std::size_t k = 0; k < n; ++k) bytes[k] = static_cast<std::uint8_t>(n + 7 * k);
    ASSERT_EQ(store_record(log, {3, 4}, bytes), StoreResult::stored) << n;
    log.open();
    ASSERT_EQ(content(log, 3, 4), bytes) << n;
    const auto here = log.current_records().front().sector;
    for (int k = 0; k < 100 && log.current_records().front().sector == here; ++k)
      ASSERT_EQ(store_record(log, {1, 1}, {}), StoreResult::stored);
    log.open();
    ASSERT_EQ(content(log, 3, 4), bytes) << n;
  }
  EXPECT_EQ(flash.violations(), 0U);
}

TEST_F(LogTest, LoadsTheNewestKnownLayoutAndReturnsItsNumber) {
  std::array<std::uint8_t, storage::max_payload_bytes> into;
  ASSERT_EQ(store_record(log, {1, 2}, {2}), StoreResult::stored);
  ASSERT_EQ(store_record(log, {1, 1}, {1}), StoreResult::stored);
  ASSERT_EQ(log.current_records().size(), 2U);
  EXPECT_EQ(log.load(1, 2, into)->layout, 1) << "written last, by an older firmware";
  EXPECT_EQ(log.load(1, 1, into)->layout, 1);
  EXPECT_FALSE(log.load(1, 0, into));
  ASSERT_EQ(store_record(log, {1, 2}, {3}), StoreResult::stored);
  EXPECT_EQ(log.load(1, 2, into)->layout, 2);
  EXPECT_EQ(log.current_records().size(), 1U) << "replaces both";
}

TEST_F(LogTest, StoresSixteenKindsAndNoMore) {
  for (std::uint8_t type = 0; type < 16; ++type) ASSERT_EQ(store_record(log, {type, 1}, {}), StoreResult::stored);
  EXPECT_EQ(store_record(log, {16, 1}, {}), StoreResult::rejected);
  for (int k = 0; k < 100; ++k)
    ASSERT_EQ(store_record(log, {3, 1}, {}), StoreResult::stored) << "one of the current kinds";
  log.open();
  EXPECT_EQ(log.current_records().size(), 16U);
  for (std::uint8_t type = 0; type < 16; ++type) EXPECT_EQ(content(log, type, 1), Bytes{});
  EXPECT_FALSE(content(log, 16, 1));
}

TEST_F(LogTest, CountsEraseCyclesAndReportsASectorThatDoesNotErase) {
  EXPECT_EQ(log.erase_cycles(), 0U);
  fill_rounds(1);
  EXPECT_EQ(log.erase_cycles(), 1U);
  for (int k = 0; k < 2'000; ++k) {
    ASSERT_EQ(store_record(log, {1, 1}, number(k)), StoreResult::stored);
    ASSERT_EQ(log.erase_cycles(), flash.erases()[log.current_records().front().sector]);
  }
  while (!log.needs_erase()) ASSERT_EQ(log.store({1, 1}, number(1)), StoreResult::stored);
  const auto here = log.current_records().front().sector;
  for (std::uint32_t s = 0; s < 3; ++s) {
    if (s != here) flash.wear_out(s, FlashModel::Wear::erase_fails);
  }
  EXPECT_FALSE(log.erase_next_sector());
  EXPECT_EQ(log.broken(), 1U);
  EXPECT_TRUE(log.operational());
}

TEST(FlashSizes, UsableByTheLogAreTwoSectorsOrMoreWithAPowerOfTwoOfLines) {
  struct Case {
    hal::FlashSize size;
    std::uint32_t used;
  };
  for (const Case& c : {Case{{1, 1024}, 0}, Case{{2, 1024}, 2}, Case{{8, 1024}, 8}, Case{{9, 1024}, 8},
                        Case{{3, 512}, 0}, Case{{3, 1024 + 16}, 0}, Case{{3, 1024 + 512}, 0}, Case{{2, 512 * 1024}, 2},
                        Case{{2, 1024 * 1024}, 0}, Case{{0, 1024}, 0}, Case{{3, 0}, 0}}) {
    FlashModel flash(c.size, 1);
    plug_in(&flash);
    Log log;
    log.open();
    EXPECT_EQ(log.sectors(), c.used) << c.size.sectors << " of " << c.size.sector_bytes;
    EXPECT_EQ(log.operational(), c.used > 0);
    EXPECT_EQ(log.erase_cycles(), 0U);
    EXPECT_EQ(store_record(log, {1, 1}, {4, 5}), c.used > 0 ? StoreResult::stored : StoreResult::rejected);
    EXPECT_EQ(log.current_records().size(), c.used > 0 ? 1U : 0U);
    for (int k = 0; c.used > 0 && k < 600; ++k)
      ASSERT_EQ(store_record(log, {1, 1}, {static_cast<std::uint8_t>(k)}), StoreResult::stored);
    for (std::uint32_t s = c.used; s < c.size.sectors; ++s) EXPECT_EQ(flash.erases()[s], 0U) << "not used by the log";
  }
}

TEST_F(LogTest, ARecordThatDoesNotFitIsRejectedAndNothingIsLost) {
  ASSERT_EQ(store_record(log, {1, 1}, {1}), StoreResult::stored);
  EXPECT_EQ(log.store({2, 1}, Bytes(storage::max_payload_bytes + 1)), StoreResult::rejected);
  EXPECT_EQ(log.store({128, 1}, Bytes(1)), StoreResult::rejected);
  std::uint8_t type = 2;
  while (store_record(log, {type, 1}, Bytes(100, 0xAB)) == StoreResult::stored) ++type;
  EXPECT_EQ(type, 5) << "half a sector: two lines of 32, and three records of eight";
  fill_rounds(200);
  for (std::uint8_t t = 2; t < type; ++t) EXPECT_EQ(content(log, t, 1), Bytes(100, 0xAB));
}

TEST(NoFlash, StoresNothingAndReportsIt) {
  plug_in(nullptr);
  Log log;
  log.open();
  EXPECT_EQ(log.sectors(), 0U);
  EXPECT_TRUE(log.current_records().empty());
  EXPECT_EQ(log.erase_cycles(), 0U);
  EXPECT_EQ(log.broken(), 0U);
  EXPECT_FALSE(log.operational());
  EXPECT_FALSE(log.needs_erase());
  EXPECT_TRUE(log.erase_next_sector()) << "no sector is broken";
  EXPECT_EQ(log.store({1, 1}, {}), StoreResult::rejected);
  EXPECT_FALSE(content(log, 1, 1));
}

TEST(Crc32, EqualsTheCheckValueOfTheCatalogue) {
  const std::array<std::uint8_t, 9> digits{'1', '2', '3', '4', '5', '6', '7', '8', '9'};
  EXPECT_EQ(storage::crc32(digits), 0xCBF43926U);  // CRC-32/ISO-HDLC
  EXPECT_EQ(crc32_by_bits({digits.begin(), digits.end()}), 0xCBF43926U);
}

}  // namespace
}  // namespace bms
