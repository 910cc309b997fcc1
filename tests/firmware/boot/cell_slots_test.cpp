// Cell constants in slots of their own: trial, confirmation and return, what is refused, losses of power.
#include "tests/firmware/boot/cell_bench.hpp"

namespace bms::boot {
namespace {

#if defined(BMS_UPDATE_POWER_CUTS)
constexpr int wanted_cuts = BMS_UPDATE_POWER_CUTS / 4;  // tests/mutants
#elif defined(__SANITIZE_ADDRESS__)
constexpr int wanted_cuts = 150;
#else
constexpr int wanted_cuts = 500;  // UpdatePowerCuts has 2,000 of the same code
#endif

TEST(CellSlots, WithoutConstantsThoseOfTheBuildAct) {
  CellBench bench;
  const Start start = bench.reset_cell(true);
  EXPECT_FALSE(start.found || start.trial || start.returned);
  EXPECT_EQ(start.refusal, Refusal::none);
  const CellHandover h = cell_handover_of(start, bench.cell_battery());
  EXPECT_EQ(h.cell_hash, hash_of_build);
  EXPECT_FALSE(start_of(h)->found);
}

TEST(CellSlots, ConfirmedOnesStayAndRaiseTheirOwnCounterOnly) {
  CellBench bench;
  bench.produce({.version = 0x000200, .security_version = 5});
  ASSERT_EQ(bench.transfer_cell(cell({.security_version = 7})), Refusal::none);
  ASSERT_TRUE(bench.reset_cell().trial);
  EXPECT_EQ(security_counter(bench.cells()), 0U) << "only when they are confirmed";
  ASSERT_TRUE(confirm(bench.cells(), 0, 7));
  for (const bool power_on : {false, true, false}) {
    const Start start = bench.reset_cell(power_on);
    EXPECT_TRUE(start.found && !start.trial);
    EXPECT_EQ(start.header.cell_hash, 0x2222'2222U);
  }
  EXPECT_EQ(security_counter(bench.cells()), 7U);
  EXPECT_EQ(security_counter(bench.slots()), 5U);
  EXPECT_TRUE(bench.reset(true).found) << "an application below their counter runs on";
}

TEST(CellSlots, ATrialThatAResetEndsIsRejected) {
  CellBench bench;
  ASSERT_EQ(bench.transfer_cell(cell({})), Refusal::none);
  ASSERT_TRUE(bench.reset_cell().trial);
  const Start back = bench.reset_cell(false);
  EXPECT_TRUE(back.returned && !back.found);
  EXPECT_EQ(back.refusal, Refusal::trial_failed);
  const Start later = bench.reset_cell(true);
  EXPECT_FALSE(later.returned || later.found) << "reported once, and they do not return by themselves";
}

TEST(CellSlots, ThePreviousOnesReturn) {
  CellBench bench;
  bench.install({.cell_hash = 0xAAAA});
  ASSERT_EQ(bench.transfer_cell(cell({.slot = 1, .cell_hash = 0xBBBB, .seed = 2}), 0), Refusal::none);
  ASSERT_EQ(bench.reset_cell(true).header.cell_hash, 0xBBBBU);
  const Start back = bench.reset_cell(false);
  EXPECT_TRUE(back.returned && back.found && !back.trial);
  EXPECT_EQ(back.header.cell_hash, 0xAAAAU);
}

TEST(CellSlots, ThreeLossesOfPowerEndATrial) {
  CellBench bench;
  ASSERT_EQ(bench.transfer_cell(cell({})), Refusal::none);
  for (int k = 0; k < 3; ++k) EXPECT_TRUE(bench.reset_cell(true).trial);
  EXPECT_FALSE(bench.reset_cell(true).found);
}

TEST(CellSlots, NoTrialBeginsOrEndsWhileTheApplicationIsOnTrial) {
  CellBench bench;
  bench.install({.cell_hash = 0xAAAA});
  ASSERT_EQ(bench.transfer_cell(cell({.slot = 1, .cell_hash = 0xBBBB, .seed = 2}), 0), Refusal::none);
  for (const bool power_on : {true, false, false}) {
    const Start start = bench.reset_cell(power_on, true);
    EXPECT_EQ(start.header.cell_hash, 0xAAAAU) << "confirmed constants act";
    EXPECT_FALSE(start.trial || start.returned);
  }
  EXPECT_TRUE(bench.reset_cell().trial) << "after the application has confirmed itself it is their turn";
}

TEST(CellSlots, OfAnotherApplicationDoNotActAndAreThereWhenItReturns) {
  CellBench bench;
  bench.install();
  const Start start = bench.reset_cell(true, false, 0x3333'3333);
  EXPECT_FALSE(start.found);
  EXPECT_EQ(start.refusal, Refusal::other_cell_file);
  EXPECT_TRUE(bench.reset_cell(true).found);
}

TEST(CellSlots, AnEraseThatWasAskedForSparesWhatActs) {
  CellBench bench;
  bench.install();
  ASSERT_TRUE(ask_for_erase(bench.cells(), 1));
  EXPECT_TRUE(bench.reset_cell(true).found);
  EXPECT_TRUE(read_marks(bench.cells(), 1).erased);
  EXPECT_FALSE(read_marks(bench.cells(), 0).erased);
}

TEST(CellSlots, EachRefusalHasItsReasonAndChangesNothing) {
  CellBench bench;
  bench.install({.security_version = 3});
  std::string damaged = cell({.slot = 1, .security_version = 3});
  damaged[header_bytes + 100] ^= 1;
  std::string forged = cell({.slot = 1, .security_version = 3});
  forged[16] = 9;  // the security version
  const std::pair<std::string, Refusal> all[] = {
      {cell({.slot = 1, .security_version = 3, .built_for = 0x3333'3333}), Refusal::other_cell_file},
      {cell({.slot = 1, .security_version = 3, .begin = "X"}), Refusal::other_limits},
      {cell({.slot = 1, .security_version = 3, .bytes = block_bytes + 1}), Refusal::too_large},
      {cell({.slot = 1, .security_version = 2}), Refusal::older_security},
      {cell({.slot = 0, .security_version = 3}), Refusal::other_slot},
      {cell({.slot = 1, .security_version = 3, .board = "other"}), Refusal::other_board},
      {cell({.slot = 1, .security_version = 3, .key = "stranger"}), Refusal::unknown_key},
      {cell({.slot = 1, .security_version = 3, .key = "revoked"}), Refusal::revoked_key},
      {cell({.slot = 1, .security_version = 3, .oldest_loader = 0x000200}), Refusal::newer_loader_needed},
      {image({.slot = 1, .security_version = 3}), Refusal::other_kind},
      {cell({.security_version = 3}).replace(7, 1, "\1"), Refusal::bad_signature},
      {forged, Refusal::bad_signature},
      {damaged, Refusal::block_damaged},
  };
  for (const auto& [container, refusal] : all) {
    ASSERT_TRUE(prepare(bench.cells(), 1));
    EXPECT_EQ(bench.transfer_cell(container, 0), refusal) << words_for(refusal);
    const auto written = bench.cell_flash().bytes(1);
    EXPECT_TRUE(std::all_of(written.begin(), written.end() - trailer_bytes, [](std::uint8_t b) { return b == 0xFF; }))
        << words_for(refusal);
    const Start start = bench.reset_cell(true);
    EXPECT_TRUE(start.found && start.slot == 0) << words_for(refusal);
  }
  EXPECT_EQ(bench.transfer(cell({.slot = 0}), 2), Refusal::other_kind) << "and not in the slot of an application";
}

TEST(CellSlots, ThatAreDamagedLaterDoNotActAndAreGivenUpOnce) {
  CellBench bench;
  bench.install();
  EXPECT_FALSE(give_up_damaged(bench.cells(), bench.reset_cell(true))) << "they act";
  bench.cell_flash().flip(0, header_bytes + 500, 0x10);
  const Start start = bench.reset_cell(true);
  EXPECT_FALSE(start.found);
  EXPECT_EQ(start.refusal, Refusal::block_damaged);
  EXPECT_TRUE(says_damaged(start.refusal));
  ASSERT_TRUE(give_up_damaged(bench.cells(), start));
  const Start next = bench.reset_cell(true);
  EXPECT_FALSE(next.found);
  EXPECT_EQ(next.refusal, Refusal::none);
  EXPECT_TRUE(read_marks(bench.cells(), 0).erased);
  EXPECT_FALSE(give_up_damaged(bench.cells(), next)) << "nothing is complete";
}

TEST(CellSlots, TheOlderOnesActInPlaceOfDamagedOnesAndStay) {
  for (const bool in_header : {false, true}) {
    CellBench bench;
    bench.install({.cell_hash = 0xAAAA});
    ASSERT_EQ(bench.transfer_cell(cell({.slot = 1, .cell_hash = 0xBBBB, .seed = 2}), 0), Refusal::none);
    ASSERT_TRUE(bench.reset_cell(true).trial);
    ASSERT_TRUE(confirm(bench.cells(), 1, 1));
    bench.cell_flash().flip(1, in_header ? 12 : header_bytes + 1, 1);  // 12: the version
    const Start start = bench.reset_cell(true);
    EXPECT_EQ(start.header.cell_hash, 0xAAAAU);
    EXPECT_EQ(start.refusal, in_header ? Refusal::bad_signature : Refusal::block_damaged);
    EXPECT_TRUE(says_damaged(start.refusal));
    EXPECT_TRUE(give_up_damaged(bench.cells(), start));
    const Start next = bench.reset_cell(true);
    EXPECT_TRUE(next.found && !next.trial && next.slot == 0);
    EXPECT_EQ(next.refusal, Refusal::none);
    EXPECT_FALSE(give_up_damaged(bench.cells(), next));
  }
}

TEST(CellSlots, WhatAnotherApplicationKeyOrCounterForbidsIsNotDamaged) {
  for (const Refusal r : {Refusal::none, Refusal::other_cell_file, Refusal::unknown_key, Refusal::revoked_key,
                          Refusal::older_security, Refusal::development_image, Refusal::trial_failed})
    EXPECT_FALSE(says_damaged(r)) << words_for(r);
}

// ---- losses of power ----

/// Parts of an update and their steps of the flash: a cut hits each part equally often.
struct Part {
  const char* name;
  unsigned steps;
};
constexpr Part parts[] = {
    {"erase", 5}, {"transfer", 1 + (header_bytes + 900) / 4}, {"complete", 2}, {"start", 2}, {"confirm", 2}};

/// Both slots are filled in turn; the test knows what it has sent and what was confirmed.
class InterruptedCells {
 public:
  explicit InterruptedCells(unsigned seed) : random_(seed), bench_(seed) {}

  void run(int& cuts, std::map<std::string, int>& by_phase) {
    for (std::uint32_t hash = 1; hash < 5 && !::testing::Test::HasFailure(); ++hash) {
      for (int attempts = 0; attempts < 60 && !(acting_ == hash && !on_trial_); ++attempts) {
        planned_ = parts[random_() % (std::size(parts) + 1) % std::size(parts)].name;
        try {
          if (acting_ != hash) send(hash);
          start();
        } catch (const PowerCut&) {
          ++cuts;
          ++by_phase[phase_];
        }
        bench_.cell_flash().no_cut();
        planned_ = "";
        start();
      }
      EXPECT_EQ(acting_, hash) << "never succeeded";
    }
  }

 private:
  const std::string& constants(std::uint8_t slot, std::uint32_t hash) {
    static std::map<std::pair<std::uint8_t, std::uint32_t>, std::string> all;
    auto& container = all[{slot, hash}];
    if (container.empty()) container = cell({.slot = slot, .security_version = hash, .cell_hash = hash, .seed = hash});
    return container;
  }
  void enter(const char* phase) {
    phase_ = phase;
    for (const Part& p : parts) {
      if (planned_ == phase && phase_ == p.name) bench_.cell_flash().cut_in(random_() % p.steps);
    }
  }
  void send(std::uint32_t hash) {
    const std::uint8_t target = running_ == 0 ? 1 : 0;
    Receiver receiver(bench_.cells(), bench_.cell_battery(), running_);
    enter("erase");
    if (receiver.prepare() != Refusal::none) return;
    enter("transfer");
    const std::string& container = constants(target, hash);
    ASSERT_EQ(receiver.begin(static_cast<std::uint32_t>(container.size())), Refusal::none);
    in_slot_[target] = container;
    ASSERT_EQ(receiver.take(bytes_of(container)), Refusal::none);
    enter("complete");
    ASSERT_EQ(receiver.finish(), Refusal::none);
  }
  void start() {
    enter("start");
    const Start start = bench_.reset_cell(true);
    if (start.found) {
      std::vector<std::uint8_t> bytes(in_slot_[start.slot].size());
      ASSERT_FALSE(bytes.empty());
      bench_.cells().read(start.slot, 0, bytes);
      ASSERT_TRUE(std::ranges::equal(bytes, bytes_of(in_slot_[start.slot])));
    }
    acting_ = start.found ? start.header.cell_hash : 0;
    running_ = start.found ? start.slot : 2;
    ASSERT_GE(acting_, confirmed_) << "older than what was confirmed";
    on_trial_ = start.trial;
    if (!start.trial) return;
    enter("confirm");
    if (!confirm(bench_.cells(), start.slot, start.header.security_version)) return;
    confirmed_ = acting_;
    on_trial_ = false;
  }

  std::mt19937 random_;
  CellBench bench_;
  std::string in_slot_[2], phase_, planned_;
  std::uint8_t running_ = 2;
  std::uint32_t acting_ = 0, confirmed_ = 0;
  bool on_trial_ = false;
};

TEST(CellPowerCuts, WhatActsIsCompleteAndNeverOlderThanWhatWasConfirmed) {
  int cuts = 0;
  std::map<std::string, int> by_phase;
  for (unsigned seed = 1; cuts < wanted_cuts && !HasFailure(); ++seed) InterruptedCells(seed).run(cuts, by_phase);
  EXPECT_GE(cuts, wanted_cuts);
  EXPECT_EQ(by_phase.size(), std::size(parts));
  for (const auto& [phase, n] : by_phase) std::printf("%6d cuts: %s\n", n, phase.c_str());
}

}  // namespace
}  // namespace bms::boot
