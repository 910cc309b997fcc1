// Trial, confirmation and return; what is damaged later; the monotonic counter.
#include "tests/firmware/boot/bench.hpp"

namespace bms::boot {
namespace {

class SlotsTest : public ::testing::Test {
 protected:
  void SetUp() override { bench_.produce({.version = 0x000200, .security_version = 5, .seed = 7}); }
  void install(std::uint8_t slot = 1, std::uint32_t security_version = 6) {
    ASSERT_EQ(
        bench_.transfer(image({.slot = slot, .version = 0x000300, .security_version = security_version, .seed = 8}),
                        static_cast<std::uint8_t>(1 - slot)),
        Refusal::none);
  }
  Bench bench_;
};

TEST_F(SlotsTest, AnImageThatResetsOnTrialIsRejectedAtOnce) {
  install();
  ASSERT_TRUE(bench_.reset().trial);
  const Start back = bench_.reset(false);
  EXPECT_TRUE(back.found && back.returned && !back.trial);
  EXPECT_EQ(back.slot, 0);
  EXPECT_EQ(back.refusal, Refusal::trial_failed);
  const Start later = bench_.reset(true);
  EXPECT_EQ(later.slot, 0) << "a rejected image does not return by itself";
  EXPECT_FALSE(later.returned) << "the return is reported once";
  EXPECT_EQ(later.refusal, Refusal::trial_failed);
}

TEST_F(SlotsTest, AnImageOnTrialReceivesNothingBecauseTheOtherSlotHoldsTheOldOne) {
  install();
  ASSERT_EQ(bench_.reset().slot, 1);
  EXPECT_EQ(bench_.transfer(image({.slot = 0, .security_version = 6}), 1), Refusal::not_confirmed);
  EXPECT_EQ(bench_.reset().slot, 0);
}

TEST_F(SlotsTest, ThreeLossesOfPowerEndATrial) {
  install();
  for (int k = 0; k < 3; ++k) {
    const Start start = bench_.reset(true);
    EXPECT_TRUE(start.trial);
    EXPECT_EQ(start.slot, 1);
  }
  EXPECT_EQ(bench_.reset(true).slot, 0);
}

/// The words of the trials cannot be programmed any more.
class WornTrialMarks final : public ModelSlots {
 public:
  using ModelSlots::ModelSlots;
  bool program(std::uint8_t slot, std::uint32_t at, std::uint32_t word) override {
    const std::uint32_t from_end = slot_bytes() - at;
    return (from_end < 48 && from_end >= 36) ? false : ModelSlots::program(slot, at, word);
  }
};

TEST_F(SlotsTest, ATrialThatCannotBeCountedDoesNotBegin) {
  install();
  WornTrialMarks worn(bench_.flash());
  const Start start = choose(worn, bench_.battery(), true);
  EXPECT_TRUE(start.found && !start.trial);
  EXPECT_EQ(start.slot, 0);
  EXPECT_EQ(start.refusal, Refusal::flash_failed);
}

TEST_F(SlotsTest, AConfirmedImageStaysAndRaisesTheCounter) {
  install();
  ASSERT_TRUE(bench_.reset().trial);
  EXPECT_EQ(security_counter(bench_.slots()), 5U) << "only a confirmed image raises it";
  ASSERT_TRUE(confirm(bench_.slots(), 1, 6));
  EXPECT_EQ(security_counter(bench_.slots()), 6U);
  for (const bool power_on : {false, true, false}) {
    const Start start = bench_.reset(power_on);
    EXPECT_EQ(start.slot, 1);
    EXPECT_FALSE(start.trial);
  }
}

TEST_F(SlotsTest, ALossOfPowerBetweenConfirmationAndCounterIsMadeGood) {
  install(1, 9);
  ASSERT_TRUE(bench_.reset().trial);
  bench_.flash().cut_in(1);
  EXPECT_THROW(confirm(bench_.slots(), 1, 9), PowerCut);
  bench_.reset(true);
  EXPECT_EQ(security_counter(bench_.slots()), 9U);
  EXPECT_EQ(bench_.reset(true).slot, 1);
}

TEST_F(SlotsTest, DamagedContentIsNotStartedAndTheOldImageReturns) {
  install(1, 5);
  bench_.flash().flip(1, header_bytes + 5'000, 1);
  const Start start = bench_.reset(true);
  EXPECT_TRUE(start.found);
  EXPECT_EQ(start.slot, 0);
  EXPECT_EQ(start.refusal, Refusal::block_damaged);
}

TEST_F(SlotsTest, AnOlderImageDoesNotReturnOnceTheCounterForbidsIt) {
  install(1, 6);
  ASSERT_TRUE(bench_.reset().trial);
  ASSERT_TRUE(confirm(bench_.slots(), 1, 6));
  bench_.flash().flip(1, header_bytes + 5'000, 1);
  const Start start = bench_.reset(true);
  EXPECT_FALSE(start.found) << "the loader waits for a transfer";
  EXPECT_EQ(bench_.transfer(image({.slot = 0, .version = 0x000400, .security_version = 6}), 2), Refusal::none);
  EXPECT_TRUE(bench_.reset(true).trial);
}

TEST_F(SlotsTest, UpdatesAlternateBetweenTheSlots) {
  for (std::uint32_t k = 0; k < 6; ++k) {
    const auto slot = static_cast<std::uint8_t>((k + 1) % 2);
    ASSERT_EQ(bench_.transfer(image({.slot = slot, .version = 0x000300 + k, .security_version = 5, .seed = 20 + k}),
                              static_cast<std::uint8_t>(1 - slot)),
              Refusal::none);
    const Start start = bench_.reset(true);
    ASSERT_EQ(start.slot, slot);
    ASSERT_EQ(start.header.version, 0x000300 + k);
    ASSERT_TRUE(confirm(bench_.slots(), slot, 5));
  }
}

TEST_F(SlotsTest, TheCounterOnlyRises) {
  for (const std::uint32_t to : {5U, 31U, 32U, 33U, 20U, 64U, 224U, 1U}) {
    const std::uint32_t before = security_counter(bench_.slots());
    EXPECT_TRUE(raise_security_counter(bench_.slots(), to));
    EXPECT_EQ(security_counter(bench_.slots()), std::max(before, to));
  }
}

TEST_F(SlotsTest, AnImageAboveTheLargestCounterRevokesNoKey) {
  EXPECT_TRUE(raise_security_counter(bench_.slots(), 240));
  EXPECT_EQ(security_counter(bench_.slots()), 224U);
  EXPECT_EQ(bench_.slots().one_time(revocation_word), ~0U);
}

TEST_F(SlotsTest, ARevokedKeyIsABitOfTheLastWord) {
  EXPECT_FALSE(key_revoked(bench_.slots(), 0));
  bench_.slots().program_one_time(revocation_word, ~2U);
  EXPECT_FALSE(key_revoked(bench_.slots(), 0));
  EXPECT_TRUE(key_revoked(bench_.slots(), 1));
}

TEST_F(SlotsTest, AnEmptyChipStartsNothing) {
  Bench empty;
  EXPECT_FALSE(empty.reset(true).found);
}

}  // namespace
}  // namespace bms::boot
