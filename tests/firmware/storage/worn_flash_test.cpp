// The log on a flash that wears out, decays, reads unsteadily, or contains anything.
#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "tests/firmware/storage/log_bench.hpp"

namespace bms {
namespace {

TEST_F(LogTest, ABadPlaceIsSkippedAndTheSectorStaysInUse) {
  ASSERT_EQ(store_record(log, {1, 1}, number(1)), StoreResult::stored);
  const auto here = log.current_records().front();
  flash.flip(here.sector, (here.line + 3U) * storage::line_bytes, 0x10);  // in the next payload
  ASSERT_EQ(log.store({1, 1}, Bytes(8, 0xFF)), StoreResult::stored);
  EXPECT_EQ(log.current_records().front().sector, here.sector);
  EXPECT_EQ(log.broken(), 0U);
  log.open();
  EXPECT_EQ(content(log, 1, 1), Bytes(8, 0xFF)) << "the record is stored";
}

/// After three failed attempts the sector counts as broken.
TEST_F(LogTest, TwoBadPlacesInARowAreSkippedAndThreeEndTheSector) {
  for (const std::uint32_t bad : {2U, 3U}) {
    flash = FlashModel(small, 1);
    log.open();
    ASSERT_EQ(store_record(log, {1, 1}, number(1)), StoreResult::stored);
    while (log.needs_erase()) log.erase_next_sector();
    const auto here = log.current_records().front();
    for (std::uint32_t k = 0; k < bad; ++k)
      flash.flip(here.sector, (here.line + 3U + 2 * k) * storage::line_bytes, 0x10);  // in the next payloads
    ASSERT_EQ(log.store({1, 1}, Bytes(8, 0xFF)), StoreResult::stored);
    EXPECT_EQ(log.current_records().front().sector == here.sector, bad == 2);
    EXPECT_EQ(log.broken(), bad == 2 ? 0U : 1U);
    log.open();
    EXPECT_EQ(content(log, 1, 1), Bytes(8, 0xFF));
  }
}

TEST_F(LogTest, AMoveOverABadPlaceContinuesInTheNextSectorWithAllRecords) {
  for (std::uint32_t bad_line = 1; bad_line < 9; ++bad_line) {
    flash = FlashModel(small, 1);
    log.open();
    while (log.needs_erase()) log.erase_next_sector();
    ASSERT_EQ(store_record(log, {2, 1}, Bytes(20, 0x77)), StoreResult::stored);
    ASSERT_EQ(store_record(log, {3, 1}, Bytes(4, 0x77)), StoreResult::stored);
    flash.flip(1, bad_line * storage::line_bytes + 2, 0x01);  // this bit can no longer store 1
    int k = 0;
    do ASSERT_EQ(log.store({1, 1}, Bytes(4, static_cast<std::uint8_t>(0x81 + 2 * ++k))), StoreResult::stored);
    while (log.current_records().back().sector == 0);
    // The payloads of the copies are in lines 2, 3 and 5, that of the new record in line 7. In a header this bit is 0.
    const bool affected = bad_line == 2 || bad_line == 3 || bad_line == 5 || bad_line == 7;
    EXPECT_EQ(log.current_records().back().sector, affected ? 2 : 1) << bad_line;
    EXPECT_EQ(log.broken(), affected ? 1U : 0U) << bad_line;
    for (int boots = 0; boots < 2; ++boots) {
      EXPECT_EQ(content(log, 1, 1), Bytes(4, static_cast<std::uint8_t>(0x81 + 2 * k))) << bad_line;
      EXPECT_EQ(content(log, 2, 1), Bytes(20, 0x77)) << bad_line;
      EXPECT_EQ(content(log, 3, 1), Bytes(4, 0x77)) << bad_line;
      log.open();
    }
  }
}

TEST_F(LogTest, ARecordThatDecaysAtRunTimeIsOmittedFromAMoveAndNoOther) {
  ASSERT_EQ(store_record(log, {2, 1}, Bytes(20, 0x55)), StoreResult::stored);
  ASSERT_EQ(store_record(log, {3, 1}, {3}), StoreResult::stored);
  const auto record = log.current_records().front();
  flash.flip(record.sector, (record.line + 2U) * storage::line_bytes, 0x04);
  fill_rounds(40);
  EXPECT_NE(log.current_records().back().sector, record.sector);
  EXPECT_EQ(log.current_records().size(), 2U);
  log.open();
  EXPECT_FALSE(content(log, 2, 1));
  EXPECT_EQ(content(log, 3, 1), (Bytes{3}));
  EXPECT_EQ(content(log, 1, 1), number(39));
}

/// The active sector is worn and its records decay before an erase: the other sector, which was to be erased, is the
/// only one that remains.
TEST_F(LogTest, AnEraseEndsEvenIfItsSectorBecomesActive) {
  flash = FlashModel(two, 1);
  log.open();
  ASSERT_EQ(store_record(log, {2, 1}, {2}), StoreResult::stored);
  const auto first = log.current_records().front().sector;
  int k = 0;
  while (log.current_records().back().sector == first)
    ASSERT_EQ(store_record(log, {1, 1}, number(++k)), StoreResult::stored);
  const auto records = log.current_records();
  const storage::RecordLocation copy = records.front(), last = records.back();
  ASSERT_EQ(copy.kind.type, 2);
  for (std::uint32_t place = 0; place < 3; ++place)
    flash.flip(last.sector, (last.line + 3U + 2 * place) * storage::line_bytes, 0x10);
  ASSERT_EQ(log.store({1, 1}, Bytes(8, 0xFF)), StoreResult::needs_erase)
      << "the sector is broken, the other one is dirty";
  flash.flip(copy.sector, (copy.line + 1U) * storage::line_bytes, 1);
  EXPECT_EQ(content(log, 2, 1), (Bytes{2})) << "the original of the copy";
  flash.flip(last.sector, (last.line + 1U) * storage::line_bytes, 1);
  ASSERT_TRUE(log.needs_erase());
  const auto erases = flash.erases();
  EXPECT_TRUE(log.erase_next_sector());
  EXPECT_EQ(flash.erases(), erases);
  EXPECT_EQ(content(log, 2, 1), (Bytes{2}));
  EXPECT_EQ(content(log, 1, 1), number(k - 1));
  EXPECT_EQ(log.broken(), 1U);
}

/// A move failed at its last word, which reads correctly at the next boot: records stored in between must not be older
/// than that move.
TEST_F(LogTest, AfterAFailedMoveOnlyRecordsThatTheNextBootFindsAreStored) {
  int failed = 0;
  for (int bit = 0; bit < 8; ++bit) {
    flash = FlashModel(two, 1);
    log.open();
    while (log.needs_erase()) log.erase_next_sector();
    std::uint32_t line = 0;
    for (int k = 0; line < 40; ++k) {
      ASSERT_EQ(log.store({1, 1}, number(k)), StoreResult::stored);
      line = log.current_records().front().line;
    }
    // The checksum of the record after one copy.
    flash.flip(1, 3 * storage::line_bytes + 8, static_cast<std::uint8_t>(1 << bit));
    if (log.store({2, 1}, Bytes(100, 2)) == StoreResult::stored) continue;  // its checksum has 0 at this bit
    ++failed;
    const bool kept = log.store({1, 1}, number(1'000)) == StoreResult::stored;
    flash.flip(1, 3 * storage::line_bytes + 8, static_cast<std::uint8_t>(1 << bit));
    log.open();
    EXPECT_TRUE(content(log, 1, 1));
    if (kept) {
      EXPECT_EQ(content(log, 1, 1), number(1'000)) << bit;
    }
  }
  EXPECT_GT(failed, 0);
}

TEST_F(LogTest, OfMoreKindsThanItCanStoreSixteenAreCurrent) {
  Bytes sector(16, 0xFF);
  for (std::uint8_t type = 0; type < 40; ++type) {
    const Bytes record = record_bytes(1U + type, type, 1, {});
    sector.insert(sector.end(), record.begin(), record.end());
  }
  flash.fill(0, sector);
  log.open();
  EXPECT_EQ(log.current_records().size(), 16U);
  EXPECT_EQ(store_record(log, {50, 1}, {1}), StoreResult::rejected);
  EXPECT_EQ(store_record(log, {3, 1}, {1}), StoreResult::stored) << "one of the current kinds";
  EXPECT_EQ(log.current_records().size(), 16U);
}

/// Each of three sectors contains a later record of type 2; those in the active sector decay.
TEST_F(LogTest, ADecayedRecordIsReplacedByTheNewestRemainingOnePermanently) {
  for (int turns = 2; turns < 8; ++turns) {
    flash = FlashModel(small, 1);
    log.open();
    while (log.needs_erase()) log.erase_next_sector();
    int version = 0;
    std::uint8_t sector = 0;
    for (; version < turns; ++version) {
      ASSERT_EQ(store_record(log, {2, 1}, {2, static_cast<std::uint8_t>(version)}), StoreResult::stored);
      if (version == turns - 1) break;
      sector = log.current_records().front().sector;
      for (int k = 0; k < 100 && log.current_records().back().sector == sector; ++k)
        ASSERT_EQ(store_record(log, {1, 1}, number(k)), StoreResult::stored);
    }
    sector = log.current_records().back().sector;
    const Bytes bytes = flash.bytes(sector);
    for (std::uint32_t at = 16; at + 32 <= 1024; at += 16) {
      if (bytes[at + 4] % 0x80 == 2 && bytes[at + 5] == 1 && bytes[at + 6] == 2)
        flash.flip(sector, at + 16, 1);  // a payload of type 2
    }
    log.open();
    EXPECT_EQ(content(log, 2, 1), (Bytes{2, static_cast<std::uint8_t>(turns - 2)})) << turns;
    EXPECT_EQ(log.current_records().size(), 2U);
    fill_rounds(100);
    EXPECT_EQ(content(log, 2, 1), (Bytes{2, static_cast<std::uint8_t>(turns - 2)})) << turns;
    log.open();
    EXPECT_EQ(content(log, 2, 1), (Bytes{2, static_cast<std::uint8_t>(turns - 2)})) << turns;
  }
}

TEST_F(LogTest, ARecordUnreadableAtABootNeverReplacesALaterOne) {
  for (std::uint32_t s = 0; s < 3; ++s) {
    flash = FlashModel(small, s);
    Bytes sector(16, 0xFF);
    const Bytes record = record_bytes(64 * (30 + s) + 1, 1, 1, number(5));
    sector.insert(sector.end(), record.begin(), record.end());
    flash.fill(s, sector);
    flash.flip(s, 16 + 17, 0x20);  // in the payload
    log.open();
    ASSERT_FALSE(content(log, 1, 1));
    ASSERT_EQ(store_record(log, {1, 1}, number(6)), StoreResult::stored);
    const Bytes now = flash.bytes(s);
    if (std::equal(record.begin(), record.begin() + 4, now.begin() + 16))
      flash.flip(s, 16 + 17, 0x20);  // the record is readable again
    log.open();
    EXPECT_EQ(content(log, 1, 1), number(6)) << s;
  }
}

/// The time of open(), store(), load() and erase_next_sector() is bounded for any behaviour of a bit.
TEST_F(LogTest, AnUnsteadyBitDoesNotBlock) {
  fill_rounds(20);
  const auto here = log.current_records().front();
  const FlashModel before = flash;
  for (std::uint32_t at = here.line * 16U; at < here.line * 16U + 20; ++at) {
    for (std::uint32_t every = 1; every < 9; ++every) {
      flash = before;
      flash.make_unsteady(here.sector, at, 0x08, every);
      flash.limit_reads(200'000);  // of 768 words
      try {
        log.open();
        static_cast<void>(content(log, 1, 1));
        const StoreResult done = store_record(log, {2, 1}, {1});
        log.erase_next_sector();
        if (done == StoreResult::stored) {
          EXPECT_EQ(content(log, 2, 1), (Bytes{1}));
        }
      } catch (const TooManyReads&) {
        ADD_FAILURE() << "does not end with an unsteady bit in byte " << at << ", wrong in every read number " << every;
      }
    }
  }
}

class Worn : public ::testing::TestWithParam<FlashModel::Wear> {};

TEST_P(Worn, OneBadSectorOfThreeIsToleratedAndReportedAndTwoStopTheLog) {
  FlashModel flash(small, 3);
  plug_in(&flash);
  Log log;
  log.open();
  const auto stored = [&](int k) {
    return store_record(log, {1, 1},
                        Bytes{static_cast<std::uint8_t>(k), static_cast<std::uint8_t>(k >> 8), 0x55, 0xAA});
  };
  int last = 0;
  for (; last < 100; ++last) ASSERT_EQ(stored(last), StoreResult::stored);
  EXPECT_TRUE(log.operational());
  EXPECT_EQ(log.broken(), 0U);
  const auto newest = [&] { return content(log, 1, 1)->at(0) | content(log, 1, 1)->at(1) << 8; };

  const auto next = [&](std::uint32_t steps) { return (log.current_records().front().sector + steps) % 3; };
  const std::uint32_t first = next(1);
  flash.wear_out(first, GetParam());
  for (; last < 300; ++last) ASSERT_EQ(stored(last), StoreResult::stored) << last;
  EXPECT_EQ(log.broken(), 1U);
  EXPECT_TRUE(log.operational());
  log.open();
  EXPECT_EQ(newest(), last - 1);

  flash.wear_out(next(1) == first ? next(2) : next(1), GetParam());
  StoreResult done = StoreResult::stored;
  int kept = last - 1;
  for (; last < 600; ++last) {
    done = stored(last);
    if (done == StoreResult::stored) kept = last;
  }
  EXPECT_EQ(done, StoreResult::rejected);
  EXPECT_EQ(log.broken(), 2U);
  EXPECT_FALSE(log.operational());
  EXPECT_EQ(newest(), kept) << "stored records can still be read";
  log.open();
  EXPECT_EQ(newest(), kept);

  for (std::uint32_t s = 0; s < 3; ++s) flash.wear_out(s, GetParam());
  for (std::uint32_t s = 0; s < 3; ++s) flash.fill(s, Bytes(1024, 0));
  log.open();
  EXPECT_EQ(stored(1), StoreResult::rejected);
  EXPECT_EQ(log.broken(), 3U);
  EXPECT_FALSE(content(log, 1, 1));
}
INSTANTIATE_TEST_SUITE_P(Kinds, Worn,
                         ::testing::Values(FlashModel::Wear::erase_fails, FlashModel::Wear::erase_leaves_zeros,
                                           FlashModel::Wear::bits_stuck_at_one, FlashModel::Wear::bits_stuck_at_zero));

/// The log may find any record; a record that is stored then must be found again.
void survives(FlashModel& flash) {
  plug_in(&flash);
  Log log;
  log.open();
  for (int type = 0; type < 256; ++type) static_cast<void>(content(log, static_cast<std::uint8_t>(type), 255));
  const Bytes mine{1, 2, 3};
  const StoreResult done = store_record(log, {1, 255}, mine);
  if (done != StoreResult::stored) {
    // Hostile records may use all the room.
    EXPECT_FALSE(log.current_records().empty());
    return;
  }
  log.open();
  EXPECT_EQ(content(log, 1, 255), mine);
}

TEST(CorruptFlash, WithAnyContentIsReadSafelyAndUsedAgain) {
  std::mt19937 random(5);
  const auto noise = [&] {
    Bytes bytes(1024);
    for (auto& b : bytes) b = static_cast<std::uint8_t>(random());
    return bytes;
  };
  for (int k = 0; k < 300; ++k) {
    FlashModel flash(small, 1);
    for (std::uint32_t s = 0; s < 3; ++s) {
      switch (random() % 4) {
        case 0:
          flash.fill(s, noise());
          break;
        case 1:
          flash.fill(s, Bytes(1024, 0));
          break;
        case 2:
          flash.fill(s, Bytes(1024, 0xFF));
          break;
        default: {
          // Well-formed records in any order, with any length, number and round, some beyond the end of the sector.
          Bytes sector(16, 0xFF);
          std::uint32_t base = random() % 3 == 0
                                   ? 0U - 64 * static_cast<std::uint32_t>(random() % 3)
                                   : 64 * static_cast<std::uint32_t>(random() % 5 == 0 ? random() : random() % 8);
          while (sector.size() < 1024) {
            const auto line = static_cast<std::uint32_t>(sector.size() / 16);
            if (random() % 12 == 0)
              base += 64 * static_cast<std::uint32_t>(random() % 7) - 64 * 3;  // two rounds in one sector
            const Bytes record = record_bytes(base + line + (random() % 9 == 0 ? 1 : 0),
                                              static_cast<std::uint8_t>(random() % 6 == 0 ? random() : random() % 4),
                                              static_cast<std::uint8_t>(random() % 4),
                                              random_bytes(random, random() % 5 == 0 ? 255 : 20));
            sector.insert(sector.end(), record.begin(), record.end());
          }
          sector.resize(1024);
          flash.fill(s, sector);
        }
      }
    }
    for (auto flips = random() % 20; flips > 0; --flips)
      flash.flip(static_cast<std::uint32_t>(random() % 3), static_cast<std::uint32_t>(random() % 1024),
                 static_cast<std::uint8_t>(1U << random() % 8));
    survives(flash);
    if (::testing::Test::HasFailure()) break;
  }
}

TEST_F(LogTest, ADecayedBitLosesAtMostItsRecord) {
  fill_rounds(130);
  ASSERT_EQ(store_record(log, {2, 1}, {2, 2}), StoreResult::stored);
  ASSERT_EQ(store_record(log, {1, 1}, number(130)), StoreResult::stored);
  const FlashModel before = flash;
  for (std::uint32_t s = 0; s < 3; ++s) {
    for (std::uint32_t at = 0; at < 1024; ++at) {
      flash = before;
      flash.flip(s, at, static_cast<std::uint8_t>(1U << at % 8));
      log.open();
      const auto one = content(log, 1, 1), other = content(log, 2, 1);
      ASSERT_TRUE(one == number(130) || one == number(129)) << s << " " << at;
      ASSERT_TRUE(one == number(130) || other == (Bytes{2, 2})) << s << " " << at;
      ASSERT_TRUE(!other || other == (Bytes{2, 2})) << s << " " << at;
    }
  }
}

/// The log never writes two sectors of one round, but decayed or foreign flash may contain them.
TEST(TwoSectorsOfOneRound, DoNotAffectLaterRecords) {
  FlashModel flash(small, 1);
  plug_in(&flash);
  const auto sector = [&](std::uint32_t s, std::uint8_t type, std::size_t records) {
    Bytes bytes(16, 0x42);
    for (std::uint32_t line = 1; line <= records; ++line) {
      const Bytes record = record_bytes(192 + line, static_cast<std::uint8_t>(type + line), 1, {});
      bytes.insert(bytes.end(), record.begin(), record.end());
    }
    flash.fill(s, bytes);
  };
  sector(1, 10, 3);
  sector(2, 20, 9);
  Log log;
  log.open();
  for (std::uint8_t k = 0; k < 20; ++k) {
    ASSERT_EQ(store_record(log, {5, 1}, {k, 7}), StoreResult::stored);
    ASSERT_EQ(content(log, 5, 1), (Bytes{k, 7}));
    Log next;
    next.open();
    ASSERT_EQ(content(next, 5, 1), (Bytes{k, 7})) << "as found by the next boot";
  }
  plug_in(nullptr);
}

}  // namespace
}  // namespace bms
