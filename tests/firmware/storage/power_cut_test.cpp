// The log on a flash that loses its power at every step. The test stores what must not be lost.
#include <cstdio>
#include <map>
#include <random>

#include <gtest/gtest.h>

#include "tests/firmware/storage/log_bench.hpp"

#if defined(BMS_POWER_CUT_SEQUENCES)
constexpr int sequences = BMS_POWER_CUT_SEQUENCES;  // tests/mutants
#elif defined(__SANITIZE_ADDRESS__)
constexpr int sequences = 40;  // with sanitizers: a thousand would take many minutes
#else
constexpr int sequences = 1'000;
#endif

namespace bms {
namespace {

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
    for (auto n = random_() % 150; n > 0; --n) complete(next_step());
    for (int k = 0; k < 10 && !::testing::Test::HasFailure(); ++k) {
      if (random_() % 6 == 0) log_.open();
      const Step step = next_step();
      cut_everywhere_in(step);
      complete(step);
    }
    EXPECT_EQ(flash_.violations(), 0U) << "words were programmed without an erase";
  }
  std::uint64_t cuts() const { return cuts_; }

 private:
  using Stored = std::map<std::pair<int, int>, Bytes>;

  Step next_step() {
    if (log_.needs_erase() && random_() % 3 == 0) return {true, {}, {}};
    const auto type = static_cast<std::uint8_t>(1 + random_() % 4);
    return {false, {type, static_cast<std::uint8_t>(type == 4 ? 9 : 1)}, random_bytes(random_, type == 2 ? 90 : 24)};
  }

  void complete(const Step& step) {
    if (step.erase) {
      EXPECT_TRUE(log_.erase_next_sector());
      return;
    }
    ASSERT_EQ(store_record(log_, step.kind, step.bytes), StoreResult::stored);
    stored_[{step.kind.type, step.kind.layout}] = step.bytes;
  }

  void cut_everywhere_in(const Step& step) {
    const FlashModel before = flash_;
    const Log log_before = log_;
    const Stored stored_before = stored_;
    for (std::uint64_t at = 0;; ++at) {
      flash_ = before;
      log_ = log_before;
      stored_ = stored_before;
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
      check_after(step);
      if (::testing::Test::HasFailure()) {
        std::printf("step %d of type %d at %llu\n", step.erase, step.kind.type, static_cast<unsigned long long>(at));
        break;
      }
    }
    flash_ = before;
    log_ = log_before;
    stored_ = stored_before;
  }

  /// A boot finds all stored records, or the one that was being stored.
  void check_boot(const Step& step) {
    log_.open();
    for (int type = 1; type <= 4; ++type) {
      const int layout = type == 4 ? 9 : 1;
      const auto found = content(log_, static_cast<std::uint8_t>(type), static_cast<std::uint8_t>(layout));
      const auto kept = stored_.find({type, layout});
      const bool in_progress = !step.erase && step.kind.type == type && found == step.bytes;
      if (in_progress) continue;
      if (kept == stored_.end()) {
        EXPECT_FALSE(found) << "of type " << type << " nothing was stored";
      } else {
        EXPECT_TRUE(found == kept->second)
            << "of type " << type << (found ? " another was found" : " nothing was found");
      }
    }
  }

  void check_after(const Step& step) {
    for (int boots = 0; boots < 2; ++boots) check_boot(step);
    // The power fails again while the log is repaired and another record is stored.
    Step other = next_step();
    for (auto cuts = random_() % 3; cuts > 0; --cuts) {
      flash_.cut_in(random_() % 24);
      try {
        if (random_() % 2 == 0 && log_.needs_erase())
          log_.erase_next_sector();
        else if (!other.erase && log_.store(other.kind, other.bytes) == StoreResult::stored)
          stored_[{other.kind.type, other.kind.layout}] = other.bytes;
      } catch (const PowerCut&) {
        ++cuts_;
        flash_.no_cut();
        check_boot_after_either(step, other);
        // Either of the two is valid: until the next record is stored, the torn one may read differently each time.
      }
      flash_.no_cut();
    }
    check_boot_after_either(step, other);
    const Bytes last = random_bytes(random_, 24);
    ASSERT_EQ(store_record(log_, {5, 1}, last), StoreResult::stored);
    Stored now;
    for (int boots = 0; boots < 3; ++boots) {
      log_.open();
      EXPECT_EQ(content(log_, 5, 1), last);
      for (int type = 1; type <= 4; ++type) {
        const auto found = content(log_, static_cast<std::uint8_t>(type), 9);
        if (boots == 0 && found) now[{type, 0}] = *found;
        EXPECT_EQ(found.has_value(), now.count({type, 0}) == 1);
        if (found) {
          EXPECT_EQ(*found, (now[{type, 0}])) << "a later boot reads another record: type " << type;
        }
      }
    }
    EXPECT_EQ(flash_.violations(), 0U);
  }

  void check_boot_after_either(const Step& one, const Step& other) {
    log_.open();
    for (int type = 1; type <= 4; ++type) {
      const int layout = type == 4 ? 9 : 1;
      const auto found = content(log_, static_cast<std::uint8_t>(type), static_cast<std::uint8_t>(layout));
      const bool in_progress = (!one.erase && one.kind.type == type && found == one.bytes) ||
                               (!other.erase && other.kind.type == type && found == other.bytes);
      const auto kept = stored_.find({type, layout});
      if (in_progress) continue;
      if (kept == stored_.end()) {
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
  Stored stored_;
  std::uint64_t cuts_ = 0;
};

/// Each test runs a quarter of the sequences, so that they can run in parallel.
class PowerCut : public ::testing::TestWithParam<int> {};

TEST_P(PowerCut, AtEveryStepOfAThousandRandomSequencesLosesNoStoredRecord) {
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

TEST_F(LogTest, AnInterruptedMoveLeavesTheOldSectorActive) {
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
    if (content(log, 1, 1) == number(k - 1)) continue;  // the interrupted last word reads correctly
    ASSERT_EQ(content(log, 1, 1), number(k - 2));
    for (const storage::RecordLocation& r : log.current_records())
      EXPECT_EQ(r.sector, here) << "copies are not valid before the new record";
    ASSERT_EQ(store_record(log, {1, 1}, number(8)), StoreResult::stored);
    log.open();
    EXPECT_EQ(content(log, 1, 1), number(8));
    EXPECT_EQ(content(log, 2, 1), (Bytes{2}));
    EXPECT_EQ(content(log, 3, 1), Bytes(50, 3));
    EXPECT_EQ(flash.violations(), 0U);
  }
  EXPECT_GT(cuts, 20);
}

}  // namespace
}  // namespace bms
