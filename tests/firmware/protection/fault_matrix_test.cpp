// Every protection on the values of its quantity: just below its threshold, just above it, with noise around it, during
// every other fault; when it is raised and how it ends.
#include <gtest/gtest.h>

#include "plant/random.hpp"
#include "tests/firmware/protection/fault_rig.hpp"

namespace bms::protection {
namespace {

class EveryProtection : public ::testing::TestWithParam<std::size_t> {
 protected:
  const ExpectedRow& row = expected_rows[GetParam()];
  bool there(const FaultRig& rig) const { return has(rig.monitor.active(), GetParam()); }
  /// Time from the first sample beyond the threshold until the fault is active [ms]; -1: not within most_ms.
  int reaction_ms(FaultRig& rig, int most_ms) {
    for (int t = 0; t <= most_ms; t += step_ms) {
      rig.step();
      if (there(rig)) return t;
    }
    return -1;
  }
};
INSTANTIATE_TEST_SUITE_P(Rows, EveryProtection, ::testing::Range<std::size_t>(0, fault_count), signal_name);

class ClearedProtection : public EveryProtection {};
INSTANTIATE_TEST_SUITE_P(Rows, ClearedProtection, ::testing::ValuesIn(rows([](std::size_t k) {
                           return expected_rows[k].recovery == 'c' && expected_rows[k].recover_ms > 0;
                         })),
                         signal_name);

class ServicedProtection : public EveryProtection {};
INSTANTIATE_TEST_SUITE_P(Rows, ServicedProtection,
                         ::testing::ValuesIn(rows([](std::size_t k) { return expected_rows[k].recovery == 's'; })),
                         signal_name);

TEST_P(EveryProtection, StaysSilentAtItsThreshold) {
  FaultRig rig;
  rig.set(row, levels(row).just_below);
  for (int t = 0; t < 5 * row.delay_ms + 10'000; t += step_ms) {
    rig.step();
    ASSERT_FALSE(there(rig)) << t;
  }
}

TEST_P(EveryProtection, IsRaisedOneUnitBeyondTheThresholdAfterItsDelayAndNotBefore) {
  FaultRig rig;
  rig.run(5'000);
  ASSERT_FALSE(there(rig));
  rig.set(row, levels(row).just_above);
  const int ms = reaction_ms(rig, row.delay_ms + 10'000);
  EXPECT_GE(ms, row.delay_ms);
  EXPECT_LE(ms, row.delay_ms + step_ms);
}

TEST_P(EveryProtection, IsNeitherMissedNorFalseInNoise) {
  const Levels l = levels(row);
  if (l.noise == 0) {  // a quantity of 0 and 1, like a loose contact
    plant::Random random(GetParam());
    FaultRig rig;
    for (int k = 0; k < 3'000 && !rig.wrong; ++k) {
      rig.set(row, random.uniform() < 0.3 ? 1 : 0);
      rig.step();
    }
    return;
  }
  const int sign = row.beyond == '>' ? 1 : -1;
  for (const int offset : {-1, 0, 1}) {  // three sigma below the threshold, at it, three sigma above
    plant::Random random(GetParam() * 3 + static_cast<std::size_t>(offset + 1));
    FaultRig rig;
    int fired_ms = -1;
    for (int t = 0; t < 3 * row.delay_ms + 20'000 && !rig.wrong; t += step_ms) {
      const double bounded = std::clamp(random.normal() / 3, -1.0, 1.0);
      rig.set(row, row.threshold + sign * offset * (l.noise + 1) + static_cast<std::int32_t>(l.noise * bounded));
      rig.step();
      if (fired_ms < 0 && there(rig)) fired_ms = t;
    }
    if (offset < 0) {
      EXPECT_EQ(fired_ms, -1);
    }
    if (offset > 0) {
      EXPECT_GE(fired_ms, row.delay_ms);
      EXPECT_LE(fired_ms, row.delay_ms + step_ms);
    }
  }
}

TEST_P(EveryProtection, IsRaisedInTimeDuringAnyOtherFault) {
  for (const ExpectedRow& other : expected_rows) {
    if (&other == &row || FaultRig::of(other) == FaultRig::of(row)) continue;
    FaultRig rig;
    rig.set(other, levels(other).just_above);
    rig.run(other.delay_ms + 2 * step_ms);
    ASSERT_TRUE(has(rig.monitor.active(), static_cast<std::size_t>(&other - expected_rows))) << other.name;
    ASSERT_FALSE(there(rig)) << other.name;
    rig.set(row, levels(row).just_above);
    const int ms = reaction_ms(rig, row.delay_ms + 1'000);
    EXPECT_GE(ms, row.delay_ms) << other.name;
    EXPECT_LE(ms, row.delay_ms + step_ms) << other.name;
    ASSERT_FALSE(rig.wrong);
  }
}

TEST_P(EveryProtection, StaysInsideItsHysteresisAndEndsAsTheTableSays) {
  FaultRig rig;
  const Levels l = levels(row);
  rig.set(row, l.just_above);
  rig.run(row.delay_ms + 2 * step_ms);
  ASSERT_TRUE(there(rig));
  if (row.threshold != row.release) {
    rig.set(row, row.release + (row.beyond == '>' ? 1 : -1));
    rig.run(row.recover_ms + 20'000, Clear::none);
    rig.step(Clear::service);
    ASSERT_TRUE(there(rig)) << "inside the hysteresis";
  }
  rig.set(row, row.release);
  int ms = 0;
  for (; there(rig) && ms <= row.recover_ms + 20'000; ms += step_ms) rig.step();
  if (row.recovery == 'a') {
    EXPECT_FALSE(there(rig));
    EXPECT_GE(ms, row.recover_ms);
    EXPECT_LE(ms, row.recover_ms + 2 * step_ms);
    return;
  }
  ASSERT_TRUE(there(rig)) << "latched";
  rig.step(Clear::user);
  EXPECT_EQ(there(rig), row.recovery == 's');
  rig.step();
  rig.step(Clear::service);
  EXPECT_EQ(there(rig), row.recovery == 's') << "only after a power cycle";
}

TEST_P(ClearedProtection, IsNotClearedBeforeItsTimeNorByAHeldKey) {
  FaultRig rig;
  rig.set(row, levels(row).just_above);
  rig.run(row.delay_ms + 2 * step_ms, Clear::user);
  rig.set(row, row.release);
  rig.run(row.recover_ms - step_ms, Clear::user);
  ASSERT_TRUE(there(rig));
  rig.run(5'000, Clear::user);
  EXPECT_TRUE(there(rig)) << "the key is held";
  rig.step();
  rig.step(Clear::user);
  EXPECT_FALSE(there(rig));
}

TEST_P(ServicedProtection, IsLatchedOverAPowerCycleAndEndedByServiceBeforeAContactorCloses) {
  FaultRig first;
  first.set(row, levels(row).just_above);
  first.run(row.delay_ms + 2 * step_ms);
  ASSERT_EQ(first.monitor.latched(), FaultSet{1} << GetParam());
  for (const bool closed_before : {false, true}) {
    FaultMonitor next(forklift_plan.rules, first.monitor.latched());
    FaultRig good;
    const auto step = [&](Clear clear, bool may_serve) { next.update(good.values, step_us, 0, clear, may_serve); };
    EXPECT_TRUE(has(next.active(), GetParam()));
    if (closed_before) step(Clear::none, false);
    for (int t = 0; t <= row.recover_ms + step_ms; t += step_ms) step(Clear::none, true);
    step(Clear::user, true);
    EXPECT_TRUE(has(next.active(), GetParam())) << "a user command is not service";
    step(Clear::none, true);
    step(Clear::service, true);
    EXPECT_EQ(has(next.active(), GetParam()), closed_before);
  }
}

TEST_P(EveryProtection, CountsToTheMicrosecond) {
  FaultMonitor monitor(forklift_plan.rules, 0);
  FaultRig rig;
  const Rule& rule = forklift_plan.rules[GetParam()];
  const auto step = [&](std::int32_t value, std::uint32_t us, Clear clear = Clear::none) {
    rig.set(row, value);
    monitor.update(rig.values, us, 0, clear, false);
    return has(monitor.active(), GetParam());
  };
  const Levels l = levels(row);
  if (rule.delay_us > 0) {
    for (int k = 0; k < 2; ++k) {
      EXPECT_FALSE(step(l.just_above, 1'000)) << "starts the delay";
      EXPECT_FALSE(step(l.just_above, rule.delay_us - 1));
      EXPECT_FALSE(step(l.just_below, rule.delay_us - 1)) << "as long within the threshold: the delay is reset";
      EXPECT_FALSE(step(l.just_below, 1'000));
    }
    EXPECT_FALSE(step(l.just_above, 1'000));
    EXPECT_FALSE(step(l.just_above, rule.delay_us - 1));
    EXPECT_TRUE(step(l.just_above, 1));
  } else {
    EXPECT_TRUE(step(l.just_above, 0));
  }
  if (rule.recover_us == 0 || rule.recovery == Recovery::service) return;
  for (int k = 0; k < 2; ++k) {
    EXPECT_TRUE(step(row.release, 1'000)) << "starts the recovery time";
    EXPECT_TRUE(step(row.release, rule.recover_us - 1, Clear::user));
    if (k == 0) {
      EXPECT_TRUE(step(row.release + (row.beyond == '>' ? 1 : -1), 1'000)) << "restarts the recovery time";
    }
  }
  EXPECT_EQ(step(row.release, 1), row.recovery == 'c');
  EXPECT_FALSE(step(row.release, 0, Clear::user));
}

TEST_P(EveryProtection, IsNeitherRaisedNorEndedWhileItsQuantityIsUnknown) {
  FaultRig rig;
  rig.set(row, measurement::no_reading);
  rig.run(row.delay_ms + 5'000);
  EXPECT_FALSE(there(rig));
  rig.set(row, levels(row).just_above);
  rig.run(row.delay_ms + 2 * step_ms);
  ASSERT_TRUE(there(rig));
  rig.set(row, measurement::no_reading);
  rig.run(row.recover_ms + 5'000);
  EXPECT_TRUE(there(rig));
}

TEST(ProtectionTable, LatchesOnlyServiceFaultsOverAPowerCycle) {
  const FaultMonitor m(forklift_plan.rules, ~FaultSet{0});
  for (std::size_t k = 0; k < fault_count; ++k)
    EXPECT_EQ(has(m.active(), k), expected_rows[k].recovery == 's') << expected_rows[k].name;
}

}  // namespace
}  // namespace bms::protection
