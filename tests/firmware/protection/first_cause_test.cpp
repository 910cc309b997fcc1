// The first cause, and flipped bits in the set of faults.
#include <array>
#include <cstring>

#include <gtest/gtest.h>

#include "tests/firmware/protection/fault_rig.hpp"

namespace bms::protection {
namespace {

struct Cause {
  FaultMonitor monitor{forklift_plan.rules, 0};
  FaultRig good;
  std::uint64_t time_us = 0;
  void step(Clear clear = Clear::none, int steps = 1) {
    for (int k = 0; k < steps; ++k) monitor.update(good.values, step_us, time_us += step_us, clear, true);
  }
  Fault first() const { return static_cast<Fault>(monitor.first().fault); }
};

TEST(FirstCause, IsTheFaultRaisedFirstWithItsTimeUntilItIsCleared) {
  Cause c;
  c.step();
  EXPECT_EQ(c.monitor.first().fault, no_fault);
  at(c.good.values, Quantity::opposite_shift_uv) = 400'000;
  c.step(Clear::none, 6);
  ASSERT_EQ(c.first(), Fault::open_wire);
  EXPECT_EQ(c.monitor.first().time_us, 7U * step_us);
  at(c.good.values, Quantity::lowest_cell_uv) = 1'700'000;
  c.step(Clear::none, 100);
  EXPECT_EQ(c.first(), Fault::open_wire);
  EXPECT_EQ(c.monitor.first().time_us, 7U * step_us);
  at(c.good.values, Quantity::opposite_shift_uv) = 0;
  c.step(Clear::none, 101);
  c.step(Clear::user);
  EXPECT_NE(c.first(), Fault::open_wire);
  EXPECT_EQ(c.first(), Fault::cell_undervoltage_severe) << "the most severe fault that the command could not end";
}

TEST(FirstCause, IsTheMostSevereOfOneSampleAndAFaultReplacesAWarning) {
  Cause c;
  at(c.good.values, Quantity::storage_failed) = 1;
  c.step();
  EXPECT_EQ(c.first(), Fault::storage_fault);
  at(c.good.values, Quantity::current_magnitude_ua) = 40'000'000;
  at(c.good.values, Quantity::charge_overload_i2t_us) = 40'000'000;
  c.step();
  EXPECT_EQ(c.first(), Fault::short_circuit);
}

TEST(FirstCause, ThatEndedByItselfIsReplacedByTheNextFault) {
  Cause c;
  at(c.good.values, Quantity::lowest_cdegc) = -100;
  c.step(Clear::none, 60);
  ASSERT_EQ(c.first(), Fault::charge_undertemperature);
  at(c.good.values, Quantity::lowest_cdegc) = 2'500;
  c.step(Clear::none, 620);
  EXPECT_EQ(c.first(), Fault::charge_undertemperature) << "still the last known cause";
  at(c.good.values, Quantity::currents_missing) = 1;
  c.step(Clear::none, 10);
  EXPECT_EQ(c.first(), Fault::current_missing);
}

TEST(FirstCause, KeepsItsTimeWhileActiveAndIsTheFirstInTheTableOfEqualFaults) {
  Cause c;
  at(c.good.values, Quantity::currents_missing) = at(c.good.values, Quantity::voltages_missing) = 1;
  c.step(Clear::none, 6);
  EXPECT_EQ(c.first(), Fault::voltage_missing) << "both open; it is first in the table";
  EXPECT_EQ(c.monitor.first().time_us, 6U * step_us);
  at(c.good.values, Quantity::storage_failed) = 1;
  c.step(Clear::user);
  EXPECT_EQ(c.first(), Fault::voltage_missing) << "a command does not end an active fault";
  EXPECT_EQ(c.monitor.first().time_us, 6U * step_us);
  at(c.good.values, Quantity::voltages_missing) = 0;
  c.step(Clear::none, 51);
  c.step(Clear::user);
  EXPECT_EQ(c.first(), Fault::current_missing) << "the first has ended, the most severe of the others follows";
  EXPECT_EQ(c.monitor.first().time_us, 59U * step_us) << "since it is the first cause";
}

TEST(FirstCause, ThatIsAWarningIsReplacedByAFaultButNotByAnotherWarning) {
  Cause c;
  at(c.good.values, Quantity::storage_failed) = 1;
  c.step();
  at(c.good.values, Quantity::temperatures_missing) = 1;
  c.step(Clear::none, 30);
  ASSERT_EQ(c.monitor.active(), bit(Fault::storage_fault) | bit(Fault::temperature_lost));
  EXPECT_EQ(c.first(), Fault::storage_fault) << "the first of the warnings";
  at(c.good.values, Quantity::charge_overload_i2t_us) = 40'000'000;
  c.step();
  EXPECT_EQ(c.first(), Fault::charge_overcurrent);
}

TEST(FirstCause, ThatEndsWithTheSampleOfAnotherFaultIsReplacedByIt) {
  Cause c;
  at(c.good.values, Quantity::currents_missing) = 1;
  c.step(Clear::none, 6);
  ASSERT_EQ(c.first(), Fault::current_missing);
  at(c.good.values, Quantity::currents_missing) = 0;
  c.step(Clear::none, 50);
  ASSERT_EQ(c.monitor.active(), bit(Fault::current_missing));
  at(c.good.values, Quantity::charge_overload_i2t_us) = 40'000'000;
  c.step();
  ASSERT_EQ(c.monitor.active(), bit(Fault::charge_overcurrent));
  EXPECT_EQ(c.first(), Fault::charge_overcurrent);
  EXPECT_EQ(c.monitor.first().time_us, 57U * step_us);
}

TEST(FirstCause, IsDeletedByAClearThatEndsAllFaults) {
  Cause c;
  at(c.good.values, Quantity::storage_failed) = 1;
  c.step();
  at(c.good.values, Quantity::storage_failed) = 0;
  c.step();
  c.step(Clear::user);
  EXPECT_EQ(c.monitor.active(), 0U);
  EXPECT_EQ(c.monitor.first().fault, no_fault);
}

/// If the copies of a word contradict each other, the faults of all copies are active.
TEST(FaultsWithAFlippedBit, AreDetectedAndNoFaultIsLost) {
  for (std::size_t a = 0; a < 192; ++a) {
    Cause c;
    at(c.good.values, Quantity::current_magnitude_ua) = 40'000'000;
    c.step();
    ASSERT_TRUE(c.monitor.intact());
    const FaultSet was = c.monitor.active();
    std::array<FaultSet, sizeof(FaultMonitor) / 8> words{};
    std::memcpy(words.data(), static_cast<void*>(&c.monitor), sizeof words);
    std::size_t at = 0;
    while (at + 1 < words.size() && !(words[at] == was && words[at + 1] == ~was)) ++at;
    ASSERT_LT(at + 1, words.size());
    words[at + a / 64] ^= FaultSet{1} << (a % 64);
    std::memcpy(static_cast<void*>(&c.monitor), words.data(), sizeof words);
    EXPECT_FALSE(c.monitor.intact());
    c.monitor.fail_safe();
    EXPECT_TRUE(c.monitor.intact());
    const FaultSet flipped = a % 64 < fault_count ? FaultSet{1} << (a % 64) : 0;  // a bit without a fault is dropped
    EXPECT_EQ(c.monitor.active(), was | bit(Fault::internal_fault) | flipped);
  }
}

}  // namespace
}  // namespace bms::protection
