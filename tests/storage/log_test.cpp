// The log on a flash that loses its power at every step, wears out and decays. What must be kept is remembered here,
// beside the log.
#include "storage/log.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <random>

#include "storage/crc32.hpp"
#include "tests/storage/flash_model.hpp"
#include "tests/storage/record_bytes.hpp"

#if defined(BMS_POWER_CUT_SEQUENCES)
constexpr int sequences = BMS_POWER_CUT_SEQUENCES;  // tests/mutants
#elif defined(__SANITIZE_ADDRESS__)
constexpr int sequences = 40;  // with sanitizers: a thousand would take many minutes
#else
constexpr int sequences = 1'000;
#endif

namespace bms {
namespace {

using storage::Kind;
using storage::Log;
using storage::StoreResult;
using Bytes = std::vector<std::uint8_t>;

constexpr hal::FlashSize small{3, 1024}, two{2, 1024};

/// What the log says of a type, up to a layout.
std::optional<Bytes> content(Log& log, std::uint8_t type, std::uint8_t layout) {
  std::array<std::uint8_t, storage::max_payload_bytes> into;
  const auto found = log.load(type, layout, into);
  if (!found) return std::nullopt;
  return Bytes(found->payload.begin(), found->payload.end());
}

Bytes random_bytes(std::mt19937& random, std::size_t most) {
  Bytes bytes(random() % (most + 1));
  const bool ones = random() % 8 == 0;  // erased flash looks like that
  for (auto& b : bytes) b = ones ? 0xFF : static_cast<std::uint8_t>(random());
  return bytes;
}

/// Erases when it must.
StoreResult store_record(Log& log, Kind kind, const Bytes& bytes) {
  StoreResult done = log.store(kind, bytes);
  for (int k = 0; k < 8 && done == StoreResult::needs_erase; ++k) {
    log.erase_next_sector();
    done = log.store(kind, bytes);
  }
  return done;
}

struct Step {
  bool erase = false;
  Kind kind;
  Bytes bytes;
};

class PowerCuts {
 public:
  PowerCuts(hal::FlashSize size, unsigned seed) : random_(seed), flash_(size, seed) {
    plug_in(&flash_);
    log_.open();
  }

  void run() {
    for (auto n = random_() % 150; n > 0; --n) whole(next_step());
    for (int k = 0; k < 10 && !::testing::Test::HasFailure(); ++k) {
      if (random_() % 6 == 0) log_.open();
      const Step step = next_step();
      cut_everywhere_in(step);
      whole(step);
    }
    EXPECT_EQ(flash_.violations(), 0U) << "words were programmed that were not erased";
  }
  std::uint64_t cuts() const { return cuts_; }

 private:
  using Kept = std::map<std::pair<int, int>, Bytes>;

  Step next_step() {
    if (log_.needs_erase() && random_() % 3 == 0) return {true, {}, {}};
    const auto type = static_cast<std::uint8_t>(1 + random_() % 4);
    return {false, {type, static_cast<std::uint8_t>(type == 4 ? 9 : 1)}, random_bytes(random_, type == 2 ? 90 : 24)};
  }

  void whole(const Step& step) {
    if (step.erase) {
      EXPECT_TRUE(log_.erase_next_sector());
      return;
    }
    ASSERT_EQ(store_record(log_, step.kind, step.bytes), StoreResult::stored);
    kept_[{step.kind.type, step.kind.layout}] = step.bytes;
  }

  void cut_everywhere_in(const Step& step) {
    const FlashModel before = flash_;
    const Log log_before = log_;
    const Kept kept_before = kept_;
    for (std::uint64_t at = 0;; ++at) {
      flash_ = before;
      log_ = log_before;
      kept_ = kept_before;
      flash_.reseed(random_());
      flash_.cut_in(at);
      bool cut = false;
      StoreResult done = StoreResult::stored;
      try {
        if (step.erase)
          log_.erase_next_sector();
        else
          done = log_.store(step.kind, step.bytes);
      } catch (const PowerCut&) {
        cut = true;
        ++cuts_;
      }
      flash_.no_cut();
      if (!cut) break;
      static_cast<void>(done);
      again_after(step);
      if (::testing::Test::HasFailure()) {
        std::printf("step %d of type %d at %llu\n", step.erase, step.kind.type, static_cast<unsigned long long>(at));
        break;
      }
    }
    flash_ = before;
    log_ = log_before;
    kept_ = kept_before;
  }

  /// What is found at boot: all that was kept, or what was being stored.
  void look(const Step& step) {
    log_.open();
    for (int type = 1; type <= 4; ++type) {
      const int layout = type == 4 ? 9 : 1;
      const auto found = content(log_, static_cast<std::uint8_t>(type), static_cast<std::uint8_t>(layout));
      const auto kept = kept_.find({type, layout});
      const bool in_progress = !step.erase && step.kind.type == type && found == step.bytes;
      if (in_progress) continue;
      if (kept == kept_.end()) {
        EXPECT_FALSE(found) << "of type " << type << " nothing was stored";
      } else {
        EXPECT_TRUE(found == kept->second)
            << "of type " << type << (found ? " another was found" : " nothing was found");
      }
    }
  }

  void again_after(const Step& step) {
    for (int boots = 0; boots < 2; ++boots) look(step);
    // the power goes again while the log is brought in order and something else is stored
    Step other = next_step();
    for (auto cuts = random_() % 3; cuts > 0; --cuts) {
      flash_.cut_in(random_() % 24);
      try {
        if (random_() % 2 == 0 && log_.needs_erase())
          log_.erase_next_sector();
        else if (!other.erase && log_.store(other.kind, other.bytes) == StoreResult::stored)
          kept_[{other.kind.type, other.kind.layout}] = other.bytes;
      } catch (const PowerCut&) {
        ++cuts_;
        flash_.no_cut();
        look_for_either(step, other);
        // one of the two: what was found now may be found now so and now otherwise until something is stored
      }
      flash_.no_cut();
    }
    look_for_either(step, other);
    const Bytes last = random_bytes(random_, 24);
    ASSERT_EQ(store_record(log_, {5, 1}, last), StoreResult::stored);
    Kept now;
    for (int boots = 0; boots < 3; ++boots) {
      log_.open();
      EXPECT_EQ(content(log_, 5, 1), last);
      for (int type = 1; type <= 4; ++type) {
        const auto found = content(log_, static_cast<std::uint8_t>(type), 9);
        if (boots == 0 && found) now[{type, 0}] = *found;
        EXPECT_EQ(found.has_value(), now.count({type, 0}) == 1);
        if (found) {
          EXPECT_EQ(*found, (now[{type, 0}])) << "found now so and now otherwise: type " << type;
        }
      }
    }
    EXPECT_EQ(flash_.violations(), 0U);
  }

  void look_for_either(const Step& one, const Step& other) {
    log_.open();
    for (int type = 1; type <= 4; ++type) {
      const int layout = type == 4 ? 9 : 1;
      const auto found = content(log_, static_cast<std::uint8_t>(type), static_cast<std::uint8_t>(layout));
      const bool in_progress = (!one.erase && one.kind.type == type && found == one.bytes) ||
                               (!other.erase && other.kind.type == type && found == other.bytes);
      const auto kept = kept_.find({type, layout});
      if (in_progress) continue;
      if (kept == kept_.end()) {
        EXPECT_FALSE(found) << "of type " << type << " nothing was stored";
      } else {
        EXPECT_TRUE(found == kept->second)
            << "of type " << type << (found ? " another was found" : " nothing was found");
      }
    }
  }

  std::mt19937 random_;
  FlashModel flash_;
  Log log_;
  Kept kept_;
  std::uint64_t cuts_ = 0;
};

/// A quarter of the sequences each, so that they run beside each other.
class PowerCut : public ::testing::TestWithParam<int> {};

TEST_P(PowerCut, AtEveryStepOfAThousandRandomSequencesLosesNothingThatWasKept) {
  std::uint64_t cuts = 0;
  for (int k = GetParam(); k < sequences && !HasFailure(); k += 4) {
    PowerCuts sequence(k % 3 == 0 ? two : small, static_cast<unsigned>(k));
    sequence.run();
    cuts += sequence.cuts();
    if (HasFailure()) std::printf("sequence %d\n", k);
  }
  std::printf("%d sequences, %llu cuts of the power\n", sequences / 4, static_cast<unsigned long long>(cuts));
  EXPECT_GT(cuts, static_cast<std::uint64_t>(60 * sequences / 4));
}
INSTANTIATE_TEST_SUITE_P(Quarter, PowerCut, ::testing::Range(0, 4));

class LogTest : public ::testing::Test {
 protected:
  explicit LogTest(hal::FlashSize size = small) : flash(size, 1) {
    plug_in(&flash);
    log.open();
  }
  void fill_rounds(int records) {
    for (int k = 0; k < records; ++k) ASSERT_EQ(store_record(log, {1, 1}, number(k)), StoreResult::stored) << k;
  }
  static Bytes number(int k) {
    Bytes bytes;
    put(bytes, static_cast<std::uint32_t>(k));
    return bytes;
  }
  FlashModel flash;
  Log log;
};

TEST_F(LogTest, NewFlashHoldsNothingAndKeepsWhatIsStoredOnceItWasErased) {
  EXPECT_FALSE(content(log, 1, 1));
  EXPECT_TRUE(log.needs_erase());
  EXPECT_EQ(log.store({1, 1}, {}), StoreResult::needs_erase) << "nobody knows whether it was erased to the end";
  ASSERT_EQ(store_record(log, {1, 1}, {7, 8, 9}), StoreResult::stored);
  log.open();
  EXPECT_EQ(content(log, 1, 1), (Bytes{7, 8, 9}));
}

TEST_F(LogTest, ARecordIsBytesAsTheHeaderSays) {
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

TEST_F(LogTest, SectorsWearAlike) {
  fill_rounds(10'000);
  const auto& e = flash.erases();
  std::printf("10000 records of 4 bytes, sectors of 64 lines: erased %llu, %llu, %llu times\n",
              static_cast<unsigned long long>(e[0]), static_cast<unsigned long long>(e[1]),
              static_cast<unsigned long long>(e[2]));
  EXPECT_GT(e[0], 100U);
  EXPECT_LE(*std::max_element(e.begin(), e.end()) - *std::min_element(e.begin(), e.end()), 1U);
  EXPECT_NEAR(log.erase_cycles(), static_cast<double>(e[0]), 1.01);
}

TEST_F(LogTest, ARecordOfANewerLayoutStaysThroughAllRoundsAndAnOlderOneIsReplaced) {
  ASSERT_EQ(store_record(log, {1, 9}, {9, 9}), StoreResult::stored);
  ASSERT_EQ(store_record(log, {77, 1}, {7}), StoreResult::stored) << "a type of a later firmware";
  ASSERT_EQ(store_record(log, {2, 1}, {1}), StoreResult::stored);
  ASSERT_EQ(store_record(log, {2, 2}, {2}), StoreResult::stored);
  fill_rounds(1'000);
  log.open();
  EXPECT_EQ(content(log, 1, 8), number(999));
  EXPECT_TRUE(std::ranges::any_of(log.current_records(), [](const storage::RecordLocation& r) {
    return r.kind == Kind{1, 9} && r.length == 2;
  })) << "for a firmware that knows it";
  EXPECT_EQ(content(log, 77, 255), (Bytes{7}));
  EXPECT_EQ(content(log, 2, 2), (Bytes{2}));
  EXPECT_FALSE(content(log, 2, 1)) << "migrated";
  EXPECT_EQ(log.current_records().size(), 4U);
}

TEST_F(LogTest, AfterAMoveHoldsWhatWasThereAndNothingElse) {
  ASSERT_EQ(store_record(log, {2, 1}, {2}), StoreResult::stored);
  for (int k = 0; k < 200; ++k) {
    ASSERT_EQ(store_record(log, {1, 1}, number(k)), StoreResult::stored);
    ASSERT_EQ(log.current_records().size(), 2U) << k;
    ASSERT_FALSE(content(log, 0, 255));
  }
}

TEST_F(LogTest, APlaceThatDoesNotTakeItsBitsIsPassedOverAndTheSectorGoesOn) {
  ASSERT_EQ(store_record(log, {1, 1}, number(1)), StoreResult::stored);
  const auto here = log.current_records().front();
  flash.flip(here.sector, (here.line + 3U) * storage::line_bytes, 0x10);  // of the next payload
  ASSERT_EQ(log.store({1, 1}, Bytes(8, 0xFF)), StoreResult::stored);
  EXPECT_EQ(log.current_records().front().sector, here.sector);
  EXPECT_EQ(log.broken(), 0U);
  log.open();
  EXPECT_EQ(content(log, 1, 1), Bytes(8, 0xFF)) << "kept is kept";
}

/// Three tries in a sector, then it is one of the broken.
TEST_F(LogTest, TwoBadPlacesInARowArePassedOverAndThreeEndTheSector) {
  for (const std::uint32_t bad : {2U, 3U}) {
    flash = FlashModel(small, 1);
    log.open();
    ASSERT_EQ(store_record(log, {1, 1}, number(1)), StoreResult::stored);
    while (log.needs_erase()) log.erase_next_sector();
    const auto here = log.current_records().front();
    for (std::uint32_t k = 0; k < bad; ++k)
      flash.flip(here.sector, (here.line + 3U + 2 * k) * storage::line_bytes, 0x10);  // of the next payloads
    ASSERT_EQ(log.store({1, 1}, Bytes(8, 0xFF)), StoreResult::stored);
    EXPECT_EQ(log.current_records().front().sector == here.sector, bad == 2);
    EXPECT_EQ(log.broken(), bad == 2 ? 0U : 1U);
    log.open();
    EXPECT_EQ(content(log, 1, 1), Bytes(8, 0xFF));
  }
}

TEST_F(LogTest, AMoveOverABadPlaceGoesOnInTheNextSectorWithAllThatThereIs) {
  for (std::uint32_t bad_line = 1; bad_line < 9; ++bad_line) {
    flash = FlashModel(small, 1);
    log.open();
    while (log.needs_erase()) log.erase_next_sector();
    ASSERT_EQ(store_record(log, {2, 1}, Bytes(20, 0x77)), StoreResult::stored);
    ASSERT_EQ(store_record(log, {3, 1}, Bytes(4, 0x77)), StoreResult::stored);
    flash.flip(1, bad_line * storage::line_bytes + 2, 0x01);  // takes no one any more
    int k = 0;
    do ASSERT_EQ(log.store({1, 1}, Bytes(4, static_cast<std::uint8_t>(0x81 + 2 * ++k))), StoreResult::stored);
    while (log.current_records().back().sector == 0);
    // the copies' payloads are in lines 2, 3 and 5, the new one's in 7; in a header that bit is 0 anyway
    const bool in_the_way = bad_line == 2 || bad_line == 3 || bad_line == 5 || bad_line == 7;
    EXPECT_EQ(log.current_records().back().sector, in_the_way ? 2 : 1) << bad_line;
    EXPECT_EQ(log.broken(), in_the_way ? 1U : 0U) << bad_line;
    for (int boots = 0; boots < 2; ++boots) {
      EXPECT_EQ(content(log, 1, 1), Bytes(4, static_cast<std::uint8_t>(0x81 + 2 * k))) << bad_line;
      EXPECT_EQ(content(log, 2, 1), Bytes(20, 0x77)) << bad_line;
      EXPECT_EQ(content(log, 3, 1), Bytes(4, 0x77)) << bad_line;
      log.open();
    }
  }
}

TEST_F(LogTest, WhatDecaysWhileItRunsIsLeftOutOfAMoveAndCostsNothingElse) {
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

/// The sector in charge is worn, and what it holds decays while an erase is asked for: the other, which was to be
/// erased, is the one that is left.
TEST_F(LogTest, AnEraseEndsAlsoWhenTheSectorItWasMeantForComesInCharge) {
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
      << "the sector is broken, the other is to be erased";
  flash.flip(copy.sector, (copy.line + 1U) * storage::line_bytes, 1);
  EXPECT_EQ(content(log, 2, 1), (Bytes{2})) << "from where it was copied";
  flash.flip(last.sector, (last.line + 1U) * storage::line_bytes, 1);
  ASSERT_TRUE(log.needs_erase());
  const auto erases = flash.erases();
  EXPECT_TRUE(log.erase_next_sector());
  EXPECT_EQ(flash.erases(), erases);
  EXPECT_EQ(content(log, 2, 1), (Bytes{2}));
  EXPECT_EQ(content(log, 1, 1), number(k - 1));
  EXPECT_EQ(log.broken(), 1U);
}

/// A move that failed at its last word, which reads well again at the next boot: what was kept in between must not be
/// older than that.
TEST_F(LogTest, AfterAMoveThatFailedNothingIsKeptThatTheNextBootWouldNotFind) {
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
    flash.flip(1, 3 * storage::line_bytes + 8,
               static_cast<std::uint8_t>(1 << bit));  // the checksum of what comes behind one copy
    if (log.store({2, 1}, Bytes(100, 2)) == StoreResult::stored) continue;  // that bit is 0 in it
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

TEST_F(LogTest, OfMoreKindsThanItHoldsSixteenAreInForceAndNothingIsHarmed) {
  Bytes sector(16, 0xFF);
  for (std::uint8_t type = 0; type < 40; ++type) {
    const Bytes record = record_bytes(1U + type, type, 1, {});
    sector.insert(sector.end(), record.begin(), record.end());
  }
  flash.fill(0, sector);
  log.open();
  EXPECT_EQ(log.current_records().size(), 16U);
  EXPECT_EQ(store_record(log, {50, 1}, {1}), StoreResult::rejected);
  EXPECT_EQ(store_record(log, {3, 1}, {1}), StoreResult::stored) << "another of those";
  EXPECT_EQ(log.current_records().size(), 16U);
}

/// Of three sectors, each holds a later one of type 2; those in the sector in charge decay.
TEST_F(LogTest, WhatDecaysGivesWayToTheNewestThatIsLeftAndStaysSo) {
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

TEST_F(LogTest, ASectorThatWasErasedIsMarkedAsTheFormatSays) {
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

/// All that a log knows of what is there.
std::vector<std::array<std::uint32_t, 6>> view(const Log& log) {
  std::vector<std::array<std::uint32_t, 6>> all;
  for (const storage::RecordLocation& r : log.current_records())
    all.push_back({r.number, r.kind.type, r.kind.layout, r.sector, r.line, r.length});
  std::ranges::sort(all);
  all.push_back({log.sectors(), log.broken(), log.erase_cycles()});
  return all;
}

TEST_F(LogTest, ABootFindsWhatWasKnownBeforeItWhereverTheNumbersWrap) {
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

TEST_F(LogTest, ABootCostsTheLastRecordOnceMoreAndNoSector) {
  fill_rounds(3);
  auto before = log.current_records().front();
  for (int k = 0; k < 6; ++k) {
    log.open();
    const auto steps = flash.steps();
    log.open();
    EXPECT_EQ(flash.steps(), steps) << "to look costs nothing";
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

TEST_F(LogTest, AMoveThatIsCutShortLeavesTheSectorInChargeThatWas) {
  ASSERT_EQ(store_record(log, {2, 1}, {2}), StoreResult::stored);
  ASSERT_EQ(store_record(log, {3, 1}, Bytes(50, 3)), StoreResult::stored);
  fill_rounds(1);
  FlashModel before = flash;
  Log log_before = log;
  const auto here = log.current_records().front().sector;
  int k = 1;
  for (; log.current_records().back().sector == here; ++k) {
    before = flash;
    log_before = log;
    ASSERT_EQ(log.store({1, 1}, number(k)), StoreResult::stored);
  }
  int cuts = 0;
  for (std::uint64_t at = 0;; ++at, ++cuts) {
    flash = before;
    log = log_before;
    flash.cut_in(at);
    try {
      log.store({1, 1}, number(k - 1));
      break;
    } catch (const bms::PowerCut&) {
    }
    log.open();
    if (content(log, 1, 1) == number(k - 1)) continue;  // its last word was as good as written
    ASSERT_EQ(content(log, 1, 1), number(k - 2));
    for (const storage::RecordLocation& r : log.current_records())
      EXPECT_EQ(r.sector, here) << "copies are none until the new record is behind them";
    ASSERT_EQ(store_record(log, {1, 1}, number(8)), StoreResult::stored);
    log.open();
    EXPECT_EQ(content(log, 1, 1), number(8));
    EXPECT_EQ(content(log, 2, 1), (Bytes{2}));
    EXPECT_EQ(content(log, 3, 1), Bytes(50, 3));
    EXPECT_EQ(flash.violations(), 0U);
  }
  EXPECT_GT(cuts, 20);
}

TEST_F(LogTest, WhatCouldNotBeReadAtABootNeverComesBackOverWhatWasStoredSince) {
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
      flash.flip(s, 16 + 17, 0x20);  // it is still there, and good again
    log.open();
    EXPECT_EQ(content(log, 1, 1), number(6)) << s;
  }
}

/// The time of open(), store(), load() and erase_next_sector() is bounded, whatever a cell does.
TEST_F(LogTest, ACellThatReadsOtherwiseNowAndThenHoldsNothingUp) {
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
        ADD_FAILURE() << "no end, with a bit of byte " << at << " otherwise every " << every;
      }
    }
  }
}

TEST_F(LogTest, PayloadsOfEveryLengthComeBackAlsoAfterAMove) {
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

TEST_F(LogTest, LoadsTheNewestOfTheLayoutsItKnowsAndSaysWhich) {
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

TEST_F(LogTest, SixteenKindsAreKeptAndNoMore) {
  for (std::uint8_t type = 0; type < 16; ++type) ASSERT_EQ(store_record(log, {type, 1}, {}), StoreResult::stored);
  EXPECT_EQ(store_record(log, {16, 1}, {}), StoreResult::rejected);
  for (int k = 0; k < 100; ++k)
    ASSERT_EQ(store_record(log, {3, 1}, {}), StoreResult::stored) << "another of those that are there";
  log.open();
  EXPECT_EQ(log.current_records().size(), 16U);
  for (std::uint8_t type = 0; type < 16; ++type) EXPECT_EQ(content(log, type, 1), Bytes{});
  EXPECT_FALSE(content(log, 16, 1));
}

TEST_F(LogTest, CountsItsRoundsAndTellsASectorThatDoesNotErase) {
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

TEST(FlashSizes, ThatTheLogGoesByAreOfTwoSectorsAndAPowerOfTwoOfLines) {
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
    for (std::uint32_t s = c.used; s < c.size.sectors; ++s) EXPECT_EQ(flash.erases()[s], 0U) << "not the log's";
  }
}

TEST_F(LogTest, WhatTheLogCannotHoldIsRefusedAndNothingIsLost) {
  ASSERT_EQ(store_record(log, {1, 1}, {1}), StoreResult::stored);
  EXPECT_EQ(log.store({2, 1}, Bytes(storage::max_payload_bytes + 1)), StoreResult::rejected);
  EXPECT_EQ(log.store({128, 1}, Bytes(1)), StoreResult::rejected);
  std::uint8_t type = 2;
  while (store_record(log, {type, 1}, Bytes(100, 0xAB)) == StoreResult::stored) ++type;
  EXPECT_EQ(type, 5) << "half a sector: two lines of 32, and three times eight";
  fill_rounds(200);
  for (std::uint8_t t = 2; t < type; ++t) EXPECT_EQ(content(log, t, 1), Bytes(100, 0xAB));
}

class Worn : public ::testing::TestWithParam<FlashModel::Wear> {};

TEST_P(Worn, OneSectorOfThreeIsSurvivedAndReportedAndTwoEndIt) {
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
  const auto told = [&] { return content(log, 1, 1)->at(0) | content(log, 1, 1)->at(1) << 8; };

  const auto next = [&](std::uint32_t steps) { return (log.current_records().front().sector + steps) % 3; };
  const std::uint32_t first = next(1);
  flash.wear_out(first, GetParam());
  for (; last < 300; ++last) ASSERT_EQ(stored(last), StoreResult::stored) << last;
  EXPECT_EQ(log.broken(), 1U);
  EXPECT_TRUE(log.operational());
  log.open();
  EXPECT_EQ(told(), last - 1);

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
  EXPECT_EQ(told(), kept) << "what was kept can still be read";
  log.open();
  EXPECT_EQ(told(), kept);

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

TEST(NoFlash, KeepsNothingAndSaysSo) {
  plug_in(nullptr);
  Log log;
  log.open();
  EXPECT_EQ(log.sectors(), 0U);
  EXPECT_TRUE(log.current_records().empty());
  EXPECT_EQ(log.erase_cycles(), 0U);
  EXPECT_EQ(log.broken(), 0U);
  EXPECT_FALSE(log.operational());
  EXPECT_FALSE(log.needs_erase());
  EXPECT_TRUE(log.erase_next_sector()) << "nothing is broken";
  EXPECT_EQ(log.store({1, 1}, {}), StoreResult::rejected);
  EXPECT_FALSE(content(log, 1, 1));
}

/// What is found may be anything that is there; what is stored then is found again.
void survives(FlashModel& flash) {
  plug_in(&flash);
  Log log;
  log.open();
  for (int type = 0; type < 256; ++type) static_cast<void>(content(log, static_cast<std::uint8_t>(type), 255));
  const Bytes mine{1, 2, 3};
  const StoreResult done = store_record(log, {1, 255}, mine);
  if (done != StoreResult::stored) {
    // hostile records may take all the room there is
    EXPECT_FALSE(log.current_records().empty());
    return;
  }
  log.open();
  EXPECT_EQ(content(log, 1, 255), mine);
}

TEST(CorruptFlash, OfAnyKindIsReadWithoutHarmAndUsedAgain) {
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
          // well-formed records in any order, of any length, number and round, some beyond the sector's end
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

TEST_F(LogTest, AnyBitThatDecaysCostsAtMostTheRecordItIsIn) {
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

TEST(Crc32, IsTheCataloguesCheckValue) {
  const std::array<std::uint8_t, 9> digits{'1', '2', '3', '4', '5', '6', '7', '8', '9'};
  EXPECT_EQ(storage::crc32(digits), 0xCBF43926U);  // CRC-32/ISO-HDLC
  EXPECT_EQ(crc32_by_bits({digits.begin(), digits.end()}), 0xCBF43926U);
}

/// No run of a log writes that; flash that decays or that somebody else has written may hold it.
TEST(TwoSectorsOfOneRound, TakeNothingFromWhatIsKeptAfterwards) {
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
    ASSERT_EQ(content(next, 5, 1), (Bytes{k, 7})) << "as the next boot sees it";
  }
  plug_in(nullptr);
}

}  // namespace
}  // namespace bms
