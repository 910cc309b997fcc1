// Every protection against the cases: just below its threshold, just above, noise around it, during every other fault;
// how fast, how it ends. Once on the values of the quantities, for all rows; once on samples of a pack in a truck, for
// the rows that samples tell.
#include <cstring>
#include <functional>
#include <set>

#include <gtest/gtest.h>

#include "plant/random.hpp"
#include "protection/protection.hpp"
#include "tests/protection/oracle.hpp"
#include "tests/protection/simulated_truck.hpp"

namespace bms::protection {
namespace {

constexpr ProtectionPlan pack = protection_plan(forklift);

/// A monitor with nothing wrong: every quantity that a row looks at has a good value.
class Rig {
 public:
  Rig() {
    for (const ExpectedRow& e : expected_rows) set(e, levels(e).good);
    // rows that share a quantity: the value that is good for all
    at(values, Quantity::highest_cell_uv) = 3'300'000;
    at(values, Quantity::lowest_cell_uv) = 3'300'000;
    at(values, Quantity::pack_uv) = 52'800'000;
    at(values, Quantity::highest_cdegc) = at(values, Quantity::lowest_cdegc) = 2'500;
  }
  static Quantity of(const ExpectedRow& e) { return pack.rules[static_cast<std::size_t>(&e - expected_rows)].quantity; }
  void set(const ExpectedRow& e, std::int32_t value) { at(values, of(e)) = value; }

  /// One sample; what is there must be what every row's oracle says.
  std::uint32_t step(Clear clear = Clear::none, bool may_serve = false) {
    time_us += step_us;
    const bool pressed = clear != Clear::none && before_ == Clear::none;
    before_ = clear;
    monitor.update(values, step_us, time_us, clear, may_serve);
    for (std::size_t k = 0; k < fault_count; ++k) {
      const std::int32_t value = at(values, of(expected_rows[k]));
      const bool ends =
          pressed && (expected_rows[k].recovery == 'c' ||
                      (expected_rows[k].recovery == 's' && clear == Clear::service && has(latched, k) && may_serve));
      const bool there = oracle_[k].check(value == measurement::no_reading ? Value() : Value(value), step_ms, ends);
      if (there != has(monitor.active(), k)) {
        ADD_FAILURE() << expected_rows[k].name << (there ? " missed" : " false") << " at " << time_us << " us with "
                      << value;
        wrong = true;
      }
    }
    return monitor.active();
  }
  void run(int ms, Clear clear = Clear::none) {
    for (int t = 0; t < ms && !wrong; t += step_ms) step(clear);
  }

  Quantities values = unknown_quantities();
  std::uint32_t latched = 0;
  FaultMonitor monitor{pack.rules, 0};
  std::uint64_t time_us = 0;
  bool wrong = false;

 private:
  std::vector<RowOracle> oracle_{std::begin(expected_rows), std::end(expected_rows)};
  Clear before_ = Clear::none;
};

class EveryProtection : public ::testing::TestWithParam<std::size_t> {
 protected:
  const ExpectedRow& row = expected_rows[GetParam()];
  bool there(const Rig& rig) const { return has(rig.monitor.active(), GetParam()); }
  /// Milliseconds from the first sample beyond until the fault is there; -1: not within `most`.
  int reaction_ms(Rig& rig, int most_ms) {
    for (int t = 0; t <= most_ms; t += step_ms) {
      rig.step();
      if (there(rig)) return t;
    }
    return -1;
  }
};
/// Rows for which this holds.
template <class Is>
std::vector<std::size_t> rows(const Is& is) {
  std::vector<std::size_t> all;
  for (std::size_t k = 0; k < fault_count; ++k) {
    if (is(k)) all.push_back(k);
  }
  return all;
}
const auto signal_name = [](const auto& row) { return std::string(expected_rows[row.param].signal); };
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
  Rig rig;
  rig.set(row, levels(row).just_below);
  for (int t = 0; t < 5 * row.delay_ms + 10'000; t += step_ms) {
    rig.step();
    ASSERT_FALSE(there(rig)) << t;
  }
}

TEST_P(EveryProtection, ComesAfterItsDelayOneUnitBeyondAndNoSooner) {
  Rig rig;
  rig.run(5'000);
  ASSERT_FALSE(there(rig));
  rig.set(row, levels(row).just_above);
  const int ms = reaction_ms(rig, row.delay_ms + 10'000);
  EXPECT_GE(ms, row.delay_ms);
  EXPECT_LE(ms, row.delay_ms + step_ms);
}

TEST_P(EveryProtection, IsNeitherMissedNorFalseInNoise) {
  const Levels l = levels(row);
  if (l.noise == 0) {  // a quantity of 0 and 1: a contact that is loose
    plant::Random random(GetParam());
    Rig rig;
    for (int k = 0; k < 3'000 && !rig.wrong; ++k) {
      rig.set(row, random.uniform() < 0.3 ? 1 : 0);
      rig.step();
    }
    return;
  }
  const int sign = row.beyond == '>' ? 1 : -1;
  for (const int offset : {-1, 0, 1}) {  // three sigma below, on, three sigma above
    plant::Random random(GetParam() * 3 + static_cast<std::size_t>(offset + 1));
    Rig rig;
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

TEST_P(EveryProtection, ComesInTimeDuringAnyOtherFault) {
  for (const ExpectedRow& other : expected_rows) {
    if (&other == &row || Rig::of(other) == Rig::of(row)) continue;
    Rig rig;
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
  Rig rig;
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
  while (there(rig) && ms <= row.recover_ms + 20'000) rig.step(), ms += step_ms;
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

TEST_P(ClearedProtection, IsNotClearedBeforeItsTimeNorByAKeyThatIsHeld) {
  Rig rig;
  rig.set(row, levels(row).just_above);
  rig.run(row.delay_ms + 2 * step_ms, Clear::user);
  rig.set(row, row.release);
  rig.run(row.recover_ms - step_ms, Clear::user);
  ASSERT_TRUE(there(rig));
  rig.run(5'000, Clear::user);
  EXPECT_TRUE(there(rig)) << "held all the time";
  rig.step();
  rig.step(Clear::user);
  EXPECT_FALSE(there(rig));
}

TEST_P(ServicedProtection, IsKeptOverAPowerCycleAndEndedByServiceBeforeAnythingCloses) {
  Rig first;
  first.set(row, levels(row).just_above);
  first.run(row.delay_ms + 2 * step_ms);
  ASSERT_EQ(first.monitor.latched(), 1U << GetParam());
  for (const bool closed_before : {false, true}) {
    FaultMonitor next(pack.rules, first.monitor.latched());
    Rig good;
    const auto step = [&](Clear clear, bool may_serve) { next.update(good.values, step_us, 0, clear, may_serve); };
    EXPECT_TRUE(has(next.active(), GetParam()));
    if (closed_before) step(Clear::none, false);
    for (int t = 0; t <= row.recover_ms + step_ms; t += step_ms) step(Clear::none, true);
    step(Clear::user, true);
    EXPECT_TRUE(has(next.active(), GetParam())) << "a driver's key is not a workshop";
    step(Clear::none, true);
    step(Clear::service, true);
    EXPECT_EQ(has(next.active(), GetParam()), closed_before);
  }
}

TEST_P(EveryProtection, CountsToTheMicrosecond) {
  FaultMonitor monitor(pack.rules, 0);
  Rig rig;
  const Rule& rule = pack.rules[GetParam()];
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
      EXPECT_FALSE(step(l.just_below, rule.delay_us - 1)) << "as long not beyond: it is forgotten";
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
    EXPECT_TRUE(step(row.release, 1'000)) << "starts the time for it to go";
    EXPECT_TRUE(step(row.release, rule.recover_us - 1, Clear::user));
    if (k == 0) {
      EXPECT_TRUE(step(row.release + (row.beyond == '>' ? 1 : -1), 1'000)) << "and anew";
    }
  }
  EXPECT_EQ(step(row.release, 1), row.recovery == 'c');
  EXPECT_FALSE(step(row.release, 0, Clear::user));
}

TEST_P(EveryProtection, NeitherComesNorGoesWhileItsQuantityIsNotKnown) {
  Rig rig;
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

TEST(ProtectionTable, KeepsOnlyFaultsOfServiceOverAPowerCycle) {
  const FaultMonitor m(pack.rules, 0xFFFF'FFFF);
  for (std::size_t k = 0; k < fault_count; ++k)
    EXPECT_EQ(has(m.active(), k), expected_rows[k].recovery == 's') << expected_rows[k].name;
}

// ---- first cause

struct Cause {
  FaultMonitor monitor{pack.rules, 0};
  Rig good;
  std::uint64_t time_us = 0;
  void step(Clear clear = Clear::none, int steps = 1) {
    for (int k = 0; k < steps; ++k) monitor.update(good.values, step_us, time_us += step_us, clear, true);
  }
  Fault first() const { return static_cast<Fault>(monitor.first().fault); }
};

TEST(FirstCause, IsTheFaultThatCameFirstWithItsTimeUntilItIsCleared) {
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
  EXPECT_EQ(c.first(), Fault::cell_undervoltage_severe) << "the gravest of what the command could not end";
}

TEST(FirstCause, IsTheGravestOfOneSampleAndAWarningGivesWayToAFault) {
  Cause c;
  at(c.good.values, Quantity::storage_failed) = 1;
  c.step();
  EXPECT_EQ(c.first(), Fault::storage_fault);
  at(c.good.values, Quantity::current_magnitude_ua) = 40'000'000;
  at(c.good.values, Quantity::charge_overload_i2t_us) = 40'000'000;
  c.step();
  EXPECT_EQ(c.first(), Fault::short_circuit);
}

TEST(FirstCause, ThatWentByItselfGivesWayToTheNextThatComes) {
  Cause c;
  at(c.good.values, Quantity::lowest_cdegc) = -100;
  c.step(Clear::none, 60);
  ASSERT_EQ(c.first(), Fault::charge_undertemperature);
  at(c.good.values, Quantity::lowest_cdegc) = 2'500;
  c.step(Clear::none, 620);
  EXPECT_EQ(c.first(), Fault::charge_undertemperature) << "still the last that is known";
  at(c.good.values, Quantity::currents_missing) = 1;
  c.step(Clear::none, 10);
  EXPECT_EQ(c.first(), Fault::current_missing);
}

TEST(FirstCause, KeepsItsTimeWhileItIsThereAndOfEqualsTheFirstInTheTable) {
  Cause c;
  at(c.good.values, Quantity::currents_missing) = at(c.good.values, Quantity::voltages_missing) = 1;
  c.step(Clear::none, 6);
  EXPECT_EQ(c.first(), Fault::voltage_missing) << "both open; it stands before the other";
  EXPECT_EQ(c.monitor.first().time_us, 6U * step_us);
  at(c.good.values, Quantity::storage_failed) = 1;
  c.step(Clear::user);
  EXPECT_EQ(c.first(), Fault::voltage_missing) << "a command does not end what is there";
  EXPECT_EQ(c.monitor.first().time_us, 6U * step_us);
  at(c.good.values, Quantity::voltages_missing) = 0;
  c.step(Clear::none, 51);
  c.step(Clear::user);
  EXPECT_EQ(c.first(), Fault::current_missing) << "the first has gone, the graver of the others is told";
  EXPECT_EQ(c.monitor.first().time_us, 59U * step_us) << "since it is the first";
}

TEST(FirstCause, OfAWarningThatDeratesGivesWayButNotToAnotherWarning) {
  Cause c;
  at(c.good.values, Quantity::storage_failed) = 1;
  c.step();
  at(c.good.values, Quantity::temperatures_missing) = 1;
  c.step(Clear::none, 30);
  ASSERT_EQ(c.monitor.active(), bit(Fault::storage_fault) | bit(Fault::temperature_lost));
  EXPECT_EQ(c.first(), Fault::storage_fault) << "the first of the mild";
  at(c.good.values, Quantity::charge_overload_i2t_us) = 40'000'000;
  c.step();
  EXPECT_EQ(c.first(), Fault::charge_overcurrent);
}

TEST(FirstCause, ThatGoesWithTheSampleThatBringsAnotherGivesWayToIt) {
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

TEST(FirstCause, IsForgottenByAClearThatLeavesNothing) {
  Cause c;
  at(c.good.values, Quantity::storage_failed) = 1;
  c.step();
  at(c.good.values, Quantity::storage_failed) = 0;
  c.step();
  c.step(Clear::user);
  EXPECT_EQ(c.monitor.active(), 0U);
  EXPECT_EQ(c.monitor.first().fault, no_fault);
}

/// A word whose copies contradict each other: what any of them says is there.
TEST(FaultsWithAFlippedBit, AreDistrustedAndNoneIsForgotten) {
  for (std::size_t a = 0; a < 96; ++a) {
    Cause c;
    at(c.good.values, Quantity::current_magnitude_ua) = 40'000'000;
    c.step();
    ASSERT_TRUE(c.monitor.intact());
    const std::uint32_t was = c.monitor.active();
    std::array<std::uint32_t, sizeof(FaultMonitor) / 4> words{};
    std::memcpy(words.data(), static_cast<void*>(&c.monitor), sizeof words);
    std::size_t at = 0;
    while (at + 1 < words.size() && !(words[at] == was && words[at + 1] == ~was)) ++at;
    ASSERT_LT(at + 1, words.size());
    words[at + a / 32] ^= 1U << (a % 32);
    std::memcpy(static_cast<void*>(&c.monitor), words.data(), sizeof words);
    EXPECT_FALSE(c.monitor.intact());
    c.monitor.fail_safe();
    EXPECT_TRUE(c.monitor.intact());
    EXPECT_EQ(c.monitor.active(), was | bit(Fault::internal_fault) | 1U << (a % 32));
  }
}

// ---- quantities of any sample

/// Readings as no pack gives them: every cell and every sensor is once the highest, the lowest, missing, stuck, shifted
/// against its neighbour.
TEST(Quantities, OfAnySampleAreThoseOfTheirDefinitions) {
  plant::Random random(23);
  const auto whole = [&](int from, int to) { return from + static_cast<int>(random.uniform() * (to - from + 1)); };
  int shifted = 0, stuck_cells = 0, stuck_sensors = 0;
  for (int run = 0; run < 60; ++run) {
    PackQuantities<16> quantities(pack.limits);
    QuantityOracle oracle;
    measurement::PackSample<16> s;
    const double missing = run % 3 == 0 ? 0 : 0.05, same = run % 2 == 0 ? 0.2 : 0.9;
    for (int step = 0; step < 100; ++step) {
      const int level_uv = 3'300'000 + whole(-60, 60) * 1'000, level_cdegc = 2'000 + whole(-800, 800);
      for (auto& uv : s.cell_uv) {
        if (random.uniform() < same && uv != measurement::no_reading) continue;
        uv = random.uniform() < missing ? measurement::no_reading
             : random.uniform() < 0.1   ? whole(-500'000, 5'000'000)
                                        : level_uv + whole(-20'000, 20'000);
      }
      if (random.uniform() < 0.3) {  // a broken wire, wherever; or a reading that cannot be, beside one that can
        const auto k = static_cast<std::size_t>(whole(0, 14));
        const int by = random.uniform() < 0.2 ? whole(-4'500'000, 4'500'000) : whole(-400'000, 400'000);
        s.cell_uv[k] = level_uv + by;
        s.cell_uv[k + 1] = level_uv - by + whole(-100'000, 100'000);
      }
      for (auto& t : s.temperature_cdegc) {
        if (random.uniform() < same && t != measurement::no_temperature) continue;
        t = random.uniform() < 2 * missing ? measurement::no_temperature
                                           : static_cast<std::int16_t>(level_cdegc + whole(-3'000, 3'000));
      }
      s.current_ua = random.uniform() < missing ? measurement::no_reading : whole(-40'000'000, 40'000'000);
      s.pack_uv = random.uniform() < missing ? measurement::no_reading : 16 * level_uv + whole(-1'000'000, 1'000'000);
      Quantities q = unknown_quantities();
      quantities.update(s, step_us, q);
      const auto expected = oracle.check(s, false);
      for (std::size_t k = 0; k < 26; ++k) {
        if (!told_by_samples(k) || k == 18) continue;  // heat: below; disbelief is the estimator's
        ASSERT_EQ(at(q, pack.rules[k].quantity), expected[k].value_or(measurement::no_reading))
            << expected_rows[k].name << ", run " << run << ", sample " << step;
      }
      shifted += expected[16].value_or(0) > 0 ? 1 : 0;
      stuck_cells += expected[21].value_or(0) > 0 ? 1 : 0;
      stuck_sensors += expected[24].value_or(0) > 0 ? 1 : 0;
      std::int64_t sum = 0;
      for (const std::int32_t uv : s.cell_uv)
        sum = uv < -500'000 || uv > 6'000'000 || sum == measurement::no_reading ? measurement::no_reading : sum + uv;
      ASSERT_EQ(quantities.sum_uv(), sum);
    }
  }
  EXPECT_GT(shifted, 500);
  EXPECT_GT(stuck_cells, 500);
  EXPECT_GT(stuck_sensors, 100);
}

TEST(Quantities, OfReadingsThatCannotBeAreMissing) {
  struct Case {
    std::int32_t cell_uv;
    std::int16_t cdegc;
    bool there;
  };
  for (const Case& c : {Case{-500'000, -6'000, true}, Case{6'000'000, 15'000, true}, Case{-500'001, -6'001, false},
                        Case{6'000'001, 15'001, false}}) {
    PackQuantities<16> quantities(pack.limits);
    measurement::PackSample<16> s;
    s.cell_uv.fill(3'300'000);
    s.temperature_cdegc.fill(2'500);
    s.pack_uv = 0;  // shorted is a reading
    s.cell_uv[15] = c.cell_uv;
    s.temperature_cdegc[3] = c.cdegc;
    Quantities q = unknown_quantities();
    quantities.update(s, step_us, q);
    EXPECT_EQ(at(q, Quantity::voltages_missing), c.there ? 0 : 1) << c.cell_uv;
    EXPECT_EQ(at(q, Quantity::temperatures_missing), c.there ? 0 : 1) << c.cdegc;
    EXPECT_EQ(at(q, Quantity::pack_uv), 0);
  }
}

/// Where there are too few others to tell what they did, the pack's own reading tells it.
template <std::size_t Cells>
std::int32_t stuck_in_a_small_pack(std::int32_t others_move_uv, bool pack_known, bool one_missing = false) {
  PackQuantities<Cells> quantities(pack.limits);
  measurement::PackSample<Cells> s;
  Quantities q = unknown_quantities();
  for (int k = 0; k < 7; ++k) {
    const std::int32_t moved_uv = k < 6 ? 0 : others_move_uv;
    for (std::size_t c = 0; c < Cells; ++c)
      s.cell_uv[c] = 3'300'000 + static_cast<std::int32_t>(c) * 100 + (c == 0 ? 0 : moved_uv + k % 2);
    if (one_missing) s.cell_uv[Cells - 1] = measurement::no_reading;
    s.pack_uv = pack_known ? static_cast<std::int32_t>(Cells) * (3'300'000 + moved_uv) : measurement::no_reading;
    quantities.update(s, step_us, q);
  }
  return at(q, Quantity::voltages_stuck);
}

TEST(Quantities, OfLessThanFourCellsGoByThePacksOwnReading) {
  EXPECT_EQ(stuck_in_a_small_pack<1>(20'000, true), 0);
  EXPECT_EQ(stuck_in_a_small_pack<1>(20'001, true), 1);
  EXPECT_EQ(stuck_in_a_small_pack<2>(-20'001, true), 1);
  EXPECT_EQ(stuck_in_a_small_pack<3>(-20'001, true), 1);
  EXPECT_EQ(stuck_in_a_small_pack<3>(-20'001, false), measurement::no_reading);
  EXPECT_EQ(stuck_in_a_small_pack<4>(20'100, false), 1) << "four know it by themselves";
  EXPECT_EQ(stuck_in_a_small_pack<4>(20'100, false, true), measurement::no_reading) << "three of four do not";
  EXPECT_EQ(stuck_in_a_small_pack<4>(20'001, true, true), 1);
}

TEST(Quantities, OfOneReadableCellAreItsOwnAndOfNoneAreNotKnown) {
  PackQuantities<16> quantities(pack.limits);
  measurement::PackSample<16> s;
  Quantities q = unknown_quantities();
  s.cell_uv[6] = 3'300'000;
  quantities.update(s, step_us, q);
  EXPECT_EQ(at(q, Quantity::highest_cell_uv), 3'300'000);
  EXPECT_EQ(at(q, Quantity::lowest_cell_uv), 3'300'000);
  EXPECT_EQ(at(q, Quantity::spread_uv), 0);
  EXPECT_EQ(at(q, Quantity::opposite_shift_uv), 0);
  EXPECT_EQ(at(q, Quantity::voltages_missing), 16) << "fifteen cells and the pack";
  s.cell_uv[6] = measurement::no_reading;
  s.pack_uv = 52'800'000;
  quantities.update(s, step_us, q);
  for (const Quantity of : {Quantity::highest_cell_uv, Quantity::lowest_cell_uv, Quantity::spread_uv,
                            Quantity::opposite_shift_uv, Quantity::voltages_stuck, Quantity::sum_error_uv})
    EXPECT_EQ(at(q, of), measurement::no_reading);
  EXPECT_EQ(at(q, Quantity::voltages_missing), 16);
  EXPECT_EQ(at(q, Quantity::pack_uv), 52'800'000);
}

TEST(Quantities, OfACellThatMustNotBeChargedHeatByAnyCurrent) {
  PackDesign d = forklift;
  d.limits.charge_current_max_a = 0;
  PackQuantities<16> quantities(pack_limits(d));
  measurement::PackSample<16> s;
  s.current_ua = 2'560;
  Quantities q = unknown_quantities();
  quantities.update(s, 1'000'000, q);
  EXPECT_EQ(at(q, Quantity::charge_overload_i2t_us), 99'000'000) << "ten times the limit, the most that counts";
}

TEST(Quantities, OfASensorThatIsNotFittedAreNotMissed) {
  PackDesign d = forklift;
  d.temperatures = 2;
  PackQuantities<16> quantities(pack_limits(d));
  measurement::PackSample<16> s;
  s.temperature_cdegc = {2'500, measurement::no_temperature, 9'000, -5'000};
  Quantities q = unknown_quantities();
  quantities.update(s, step_us, q);
  EXPECT_EQ(at(q, Quantity::temperatures_missing), 1);
  EXPECT_EQ(at(q, Quantity::highest_cdegc), 2'500);
  EXPECT_EQ(at(q, Quantity::lowest_cdegc), 2'500);
  EXPECT_EQ(at(q, Quantity::temperatures_stuck), measurement::no_reading) << "one alone tells nothing";
  d.temperatures = 9;
  EXPECT_EQ(pack_limits(d).temperatures, 4) << "as many as a sample has";
}

// ---- samples of a pack in a truck

/// Protection on that truck; what is there must be what the oracle says, with every sample.
class Truck : public TruckPack {
 public:
  explicit Truck(std::uint64_t seed) : TruckPack(seed) {
    while (protection.decision().state != ContactorState::drive && steps() < 100) step();
  }

  std::uint32_t step(const Change& change = {}) {
    measure(protection.decision().outputs, change);
    const std::uint32_t faults = protection.update(sample, estimate, inputs).faults,
                        expected = oracle_.check(sample, estimate.voltage_rejected);
    for (std::size_t k = 0; k < 26; ++k) {
      if (!told_by_samples(k) || has(expected, k) == has(faults, k)) continue;  // heat: ProtectionAgainstHeat
      ADD_FAILURE() << expected_rows[k].name << (has(expected, k) ? " missed" : " false") << " at " << steps() * 100
                    << " ms, value " << oracle_.values[k].value_or(measurement::no_reading);
      wrong = true;
    }
    return faults;
  }

  Protection<16> protection{pack};
  bool wrong = false;

 private:
  TruckOracle oracle_;
};

class EverySampledProtection : public ::testing::TestWithParam<std::size_t> {
 protected:
  const ExpectedRow& row = expected_rows[GetParam()];
};
INSTANTIATE_TEST_SUITE_P(Rows, EverySampledProtection, ::testing::ValuesIn(rows(told_by_samples)), signal_name);

class EveryMeasuredProtection : public EverySampledProtection {};
INSTANTIATE_TEST_SUITE_P(Rows, EveryMeasuredProtection, ::testing::ValuesIn(rows([](std::size_t k) {
                           return told_by_samples(k) && levels(expected_rows[k]).noise > 0;
                         })),
                         signal_name);

TEST_P(EverySampledProtection, ComesOfSamplesBeyondItAndOfNoOthers) {
  const std::size_t k = GetParam();
  const Levels l = levels(row);
  for (const bool beyond : {false, true}) {
    Truck truck(k + 1);
    ASSERT_EQ(truck.protection.decision().state, ContactorState::drive);
    int fired_ms = -1, since_ms = -1;
    // what stands still is found when the others have moved, within half of their 40 s
    const int patience_ms = row.delay_ms + (waits_for_others(k) ? 60'000 : 3'000);
    for (int t = 0; t < patience_ms && !truck.wrong; t += step_ms) {
      const std::uint32_t faults =
          truck.step([&](auto& s, auto& e, auto&) { inject(k, beyond ? l.just_above : l.just_below, truck, s, e); });
      if (since_ms < 0) since_ms = t;
      if (fired_ms < 0 && has(faults, k)) fired_ms = t;
    }
    ASSERT_FALSE(truck.wrong);
    if (!beyond) {
      EXPECT_EQ(fired_ms, -1);
    } else if (!waits_for_others(k)) {
      EXPECT_GE(fired_ms, row.delay_ms);
      EXPECT_LE(fired_ms, row.delay_ms + step_ms);
    } else {
      EXPECT_GE(fired_ms, row.delay_ms);
    }
  }
}

TEST_P(EveryMeasuredProtection, IsNeitherMissedNorFalseInNoiseAroundItsThreshold) {
  const std::size_t k = GetParam();
  const std::int32_t noise = measured_noise(k);
  const int sign = row.beyond == '>' ? 1 : -1;
  for (const int offset : {-1, 0, 1}) {
    Truck truck(100 + k * 3 + static_cast<std::size_t>(offset + 1));
    int fired_ms = -1;
    for (int t = 0; t < row.delay_ms + 20'000 && !truck.wrong; t += step_ms) {
      const auto value =
          row.threshold + sign * offset * (noise + 2) + static_cast<std::int32_t>(noise * truck.chance());
      const std::uint32_t faults = truck.step([&](auto& s, auto& e, auto&) { inject(k, value, truck, s, e); });
      if (fired_ms < 0 && has(faults, k)) fired_ms = t;
    }
    ASSERT_FALSE(truck.wrong);
    if (offset < 0) {
      EXPECT_EQ(fired_ms, -1);
    }
    if (offset > 0) {
      EXPECT_GE(fired_ms, row.delay_ms);
      EXPECT_LE(fired_ms, row.delay_ms + step_ms);
    }
  }
}

TEST_P(EverySampledProtection, ComesDuringEveryOtherThatSamplesTell) {
  const std::size_t k = GetParam();
  for (std::size_t other = 0; other < 26; ++other) {
    if (other == k || !told_by_samples(other) || pack.rules[other].quantity == pack.rules[k].quantity) continue;
    Truck truck(1'000 + 32 * k + other);
    const int before_ms = std::min(expected_rows[other].delay_ms, 12'000) + 500;
    const int long_ms = before_ms + std::min(row.delay_ms, 12'000) + 1'500;
    for (int t = 0; t < long_ms && !truck.wrong; t += step_ms) {
      truck.step([&](auto& s, auto& e, auto&) {
        inject(other, levels(expected_rows[other]).just_above, truck, s, e);
        if (t >= before_ms) inject(k, levels(row).just_above, truck, s, e);
      });
    }
    ASSERT_FALSE(truck.wrong) << "during " << expected_rows[other].name;
  }
}

TEST(ProtectionOfATruck, IsSilentForTenMinutesWithNothingWrong) {
  Truck truck(7);
  for (int t = 0; t < 600'000; t += step_ms) ASSERT_EQ(truck.step(), 0U) << t;
}

// ---- heat

class ProtectionAgainstHeat : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Loads, ProtectionAgainstHeat, ::testing::Values(-4.0, -2.0, -1.5, -1.2, 1.2, 1.5, 2.0, 4.0),
                         [](const auto& load) {
                           return std::string(load.param < 0 ? "Discharge" : "Charge") +
                                  std::to_string(static_cast<int>(std::abs(load.param) * 10)) + "Tenths";
                         });

/// Trip time of an ideal integral: 30 s over (i^2 - 1), i = I / (1.05 x 6 A). The integer one is 0.8 % off at most (a
/// 256th in i).
TEST_P(ProtectionAgainstHeat, TripsWhenTheIntegralOfTheSquareIsFull) {
  const double i = GetParam() * 6 / 6.3, expected_s = 30 / (i * i - 1);
  Truck truck(3);
  double fired_s = -1;
  const Fault fault = GetParam() < 0 ? Fault::discharge_overcurrent : Fault::charge_overcurrent;
  for (int t = 0; t < 1'000 * expected_s * 1.1 + 2'000 && fired_s < 0; t += step_ms) {
    const std::uint32_t faults =
        truck.step([&](auto& s, auto&, auto&) { s.current_ua = static_cast<std::int32_t>(6e6 * GetParam()); });
    if ((faults & bit(fault)) != 0) fired_s = (t + step_ms) / 1e3;
  }
  EXPECT_NEAR(fired_s, expected_s, 0.1 + expected_s * 2 * i * i / (i * i - 1) / (256 * std::abs(i)) * 1.05);
}

/// (I / limit)^2 - 1 over the time, of 1.05 times the continuous limit; not below 0, beyond ten times as if it were
/// ten.
TEST(ProtectionAgainstHeatOf, ACurrentIsTheSquareOfItOverItsLimit) {
  for (const double limit_a : {6.0, 300.0}) {
    PackDesign d = forklift;
    d.limits.charge_current_max_a = limit_a;
    d.limits.discharge_current_max_a = 2 * limit_a;
    for (const int sign : {1, -1}) {
      const double from_a = 1.05 * (sign > 0 ? limit_a : 2 * limit_a);
      const Quantity mine = sign > 0 ? Quantity::charge_overload_i2t_us : Quantity::discharge_overload_i2t_us,
                     other = sign > 0 ? Quantity::discharge_overload_i2t_us : Quantity::charge_overload_i2t_us;
      PackQuantities<16> quantities(pack_limits(d));
      measurement::PackSample<16> s;
      Quantities q = unknown_quantities();
      const auto heat_s = [&](double times, std::uint32_t us) {
        s.current_ua = sign * static_cast<std::int32_t>(1e6 * times * from_a);
        quantities.update(s, us, q);
        return at(q, mine) / 1e6;
      };
      EXPECT_NEAR(heat_s(2, 1'000'000), 3, 0.05);
      EXPECT_NEAR(heat_s(0, 1'000'000), 2, 0.05) << "at rest it cools by its time";
      EXPECT_NEAR(heat_s(0.5, 1'000'000), 1.25, 0.06);
      EXPECT_EQ(at(q, other), 0);
      EXPECT_NEAR(heat_s(-2, 1'000'000), 0.25, 0.06) << "the other way is rest, too";
      EXPECT_EQ(heat_s(0, 10'000'000), 0) << "never below";
      if (from_a > 200) continue;  // more than a reading can say
      EXPECT_NEAR(heat_s(10, 100'000), 9.9, 0.1);
      EXPECT_NEAR(heat_s(0, 9'900'000), 0, 0.1);
      EXPECT_NEAR(heat_s(14, 100'000), 9.9, 0.1) << "a short circuit, anyway";
      s.current_ua = measurement::no_reading;
      quantities.update(s, 100'000, q);
      EXPECT_EQ(at(q, mine), measurement::no_reading);
      EXPECT_NEAR(heat_s(1, 100'000), 9.9, 0.1) << "neither heats nor cools while it is not known";
      for (int k = 0; k < 100; ++k) heat_s(10, 60'000'000);
      EXPECT_EQ(at(q, mine), 2'000'000'000) << "stops there";
    }
  }
}

TEST(ProtectionAgainstHeatOf, ARestIsCooledByItsTimeExactly) {
  PackQuantities<16> quantities(pack.limits);
  measurement::PackSample<16> s;
  Quantities q = unknown_quantities();
  s.current_ua = 12'000'000;
  quantities.update(s, 1'000'000, q);
  const std::int32_t before = at(q, Quantity::charge_overload_i2t_us);
  s.current_ua = 0;
  for (int k = 0; k < 10; ++k) quantities.update(s, 100'000, q);
  EXPECT_EQ(at(q, Quantity::charge_overload_i2t_us), before - 1'000'000);
}

TEST(ProtectionAgainstHeatOf, TheContinuousCurrentAndShortBurstsNeverTrips) {
  Truck truck(4);
  for (int t = 0; t < 600'000; t += step_ms) {
    const bool burst = t / 1'000 % 40 < 8;  // twice the limit for 8 of 40 s
    const std::uint32_t faults = truck.step([&](auto& s, auto&, auto&) {
      s.current_ua = t < 300'000 ? -6'300'000 + 30'000 : burst ? -12'000'000 : -1'000'000;
    });
    ASSERT_EQ(faults, 0U) << t;
  }
}

}  // namespace
}  // namespace bms::protection
