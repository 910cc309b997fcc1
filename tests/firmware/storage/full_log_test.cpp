// State of charge after a reset of a battery whose contactors were closed for so long that the log became full: the
// truth is inside two standard deviations, whatever was lost.
#include <cmath>

#include <gtest/gtest.h>

#include "tests/firmware/storage/persistence_bench.hpp"

namespace bms {
namespace {

/// A truck of several shifts: the current never rests, and soc moves between 15 and 90 % by 0.33 % a minute.
class FullLog : public PersistenceTest {
 protected:
  FullLog() {
    erases_allowed = false;
    pack = {50 * percent_ppb, percent_ppb / 2};
  }
  void work(int minutes) {
    for (int k = 0; k < minutes; ++k) {
      drive(1, direction_ * 2'000'000, direction_ * 3'300'000);
      if (pack.soc_ppb < 15 * percent_ppb) direction_ = 1;
      if (pack.soc_ppb > 90 * percent_ppb) direction_ = -1;
    }
  }
  /// How far the start is from the truth, in standard deviations.
  double error_in_sigmas(const measurement::StartingPoint& start) const {
    return std::abs(1.0 * start.soc_ppb - pack.soc_ppb) / start.soc_sigma_ppb;
  }

 private:
  int direction_ = -1;
};

TEST_F(FullLog, AfterAResetOfTheCoreSocIsThatOfTheLastMinute) {
  retained.assign(Persistence::retained_bytes, 0xA5);
  for (const int hours : {19, 100}) {
    flash = FlashModel(chip, 1);
    boot();
    work(60 * hours);
    EXPECT_EQ(p.full(), hours == 100);
    const auto used = p.charge();
    for (const ResetCause cause : {ResetCause::watchdog, ResetCause::software, ResetCause::pin}) {
      boot(cause);
      EXPECT_LT(error_in_sigmas(*p.starting_point()), 2) << hours << " h";
      EXPECT_LT(p.starting_point()->soc_sigma_ppb, percent_ppb) << "and it is known well";
      EXPECT_EQ(p.charge().operating_s, used.operating_s);
      EXPECT_EQ(p.charge().discharged_uah, used.discharged_uah);
    }
  }
}

TEST_F(FullLog, AfterALossOfPowerTheTruthIsInsideTwoSigmaAtEveryTime) {
  boot();
  for (int minutes = 0; minutes < 100 * 60; minutes += 7) {
    work(7);
    const FlashModel before = flash;
    for (const ResetCause cause : {ResetCause::power_on, ResetCause::brown_out, ResetCause::watchdog}) {
      Persistence next;
      next.start(cause, std::nullopt, std::nullopt);
      ASSERT_LT(error_in_sigmas(*next.starting_point()), 2) << minutes << " minutes";
      flash = before;
    }
  }
  EXPECT_TRUE(p.full());
}

/// Nobody erases, nobody opens; then a short circuit and a loss of power.
TEST_F(FullLog, HasRoomForLatchedFaultsAndForTheLastCharge) {
  boot();
  work(100 * 60);
  ASSERT_TRUE(p.full());
  EXPECT_FALSE(p.set(9, 1)) << "no room for other settings";
  EXPECT_FALSE(p.settings_stored()) << "which is reported";
  EXPECT_TRUE(p.set(1, 1'024, storage::Urgency::safety));
  EXPECT_TRUE(p.settings_stored());
  for (int dips = 0; dips < 3; ++dips) {
    work(3);
    p.supply_failing(now(), std::nullopt);
  }
  boot(ResetCause::pin);  // takes no time
  EXPECT_EQ(p.settings().get(1), 1'024);
  EXPECT_EQ(p.starting_point()->soc_ppb, pack.soc_ppb);
}

TEST_F(FullLog, AfterAnEraseSocIsKnownAgain) {
  boot();
  work(100 * 60);
  ASSERT_TRUE(p.full());
  p.erase_next_sector();
  work(1);
  boot(ResetCause::watchdog);
  EXPECT_LT(error_in_sigmas(*p.starting_point()), 2);
  EXPECT_LT(p.starting_point()->soc_sigma_ppb, percent_ppb);
}

TEST_F(FullLog, ItsLastRecordSurvivesALossOfPowerWhileItIsWritten) {
  boot();
  while (!p.full()) work(1);
  // The step in which the log became full, again, with a cut at each word of it.
  flash = FlashModel(chip, 1);
  boot();
  pack = {50 * percent_ppb, percent_ppb / 2};
  FlashModel before = flash;
  Persistence state = p;
  auto soc = pack;
  auto time = time_us;
  for (int k = 0; k < 5'000 && !p.full(); ++k) {
    before = flash;
    state = p;
    soc = pack;
    time = time_us;
    work(1);
  }
  ASSERT_TRUE(p.full());
  int cuts = 0;
  for (std::uint64_t at = 0;; ++at, ++cuts) {
    flash = before;
    p = state;
    pack = soc;
    time_us = time;
    flash.reseed(at);
    flash.cut_in(at);
    bool cut = false;
    try {
      work(1);
    } catch (const PowerCut&) {
      cut = true;
    }
    flash.no_cut();
    std::int32_t first = 0;
    for (int boots = 0; boots < 3; ++boots) {
      Persistence next;
      next.start(ResetCause::power_on, std::nullopt, std::nullopt);
      ASSERT_TRUE(next.starting_point());
      EXPECT_LT(error_in_sigmas(*next.starting_point()), 2);
      if (boots == 0) first = next.starting_point()->soc_ppb;
      EXPECT_EQ(next.starting_point()->soc_ppb, first) << "a later boot reads another record";
    }
    EXPECT_EQ(flash.violations(), 0U);
    if (!cut) break;
  }
  EXPECT_GE(cuts, 12) << "the words of a record of charge";
}

/// The copy in RAM is used only if it is intact, newer, and the power stayed on.
class RetainedCharge : public PersistenceTest {
 protected:
  RetainedCharge() {
    retained.assign(Persistence::retained_bytes, 0);
    boot();
    drive(1);
    stored_ppb = pack.soc_ppb;
    drive(10, -1'000'000, -99'000);  // moves by less than a record needs
    expected_ppb = pack.soc_ppb;
  }
  std::int32_t started_at() { return boot(cause).starting_point()->soc_ppb; }

  std::int32_t stored_ppb = 0, expected_ppb = 0;
  ResetCause cause = ResetCause::watchdog;
};

TEST_F(RetainedCharge, IsUsedAfterAResetOfTheCore) { EXPECT_EQ(started_at(), expected_ppb); }

TEST_F(RetainedCharge, IsNotUsedAfterALossOfPower) {
  cause = ResetCause::power_on;
  EXPECT_LT(started_at(), stored_ppb - 1'000'000) << "less the self-discharge while it was off";
}

TEST_F(RetainedCharge, WithAnyFlippedBitIsNotUsed) {
  const auto intact = retained;
  for (std::size_t bit = 0; bit < 8 * intact.size(); ++bit) {
    retained = intact;
    retained[bit / 8] = static_cast<std::uint8_t>(retained[bit / 8] ^ 1U << bit % 8);
    EXPECT_EQ(started_at(), stored_ppb) << bit;
  }
  retained.assign(retained.size(), 0);
  EXPECT_EQ(started_at(), stored_ppb);
  retained.assign(retained.size(), 0xFF);
  EXPECT_EQ(started_at(), stored_ppb);
}

TEST_F(RetainedCharge, OlderThanTheRecordIsNotUsed) {
  const auto older = retained;
  drive(10, -6'000'000, -5'000'000);
  const auto newest_ppb = pack.soc_ppb;
  retained = older;
  EXPECT_EQ(started_at(), newest_ppb);
}

TEST_F(RetainedCharge, OfAnEmptiedFlashIsNotUsed) {
  flash = FlashModel(chip, 1);
  EXPECT_FALSE(boot(cause).starting_point());
}

TEST_F(RetainedCharge, CountsOn) {
  const auto before = p.charge();
  boot(cause);
  drive(6, -60'000'000);
  EXPECT_EQ(p.charge().operating_s, before.operating_s + 360);
  EXPECT_EQ(p.charge().discharged_uah, before.discharged_uah + 6'000'000);
}

}  // namespace
}  // namespace bms
