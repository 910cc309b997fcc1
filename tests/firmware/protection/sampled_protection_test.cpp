// Every protection that samples show, on samples of a pack in a truck; and overload currents.
#include <gtest/gtest.h>

#include "tests/firmware/protection/fault_rig.hpp"

namespace bms::protection {
namespace {

/// Protection on a truck. Compares the active faults with the oracle for every sample.
class Truck : public TruckPack {
 public:
  explicit Truck(std::uint64_t seed) : TruckPack(seed) {
    while (protection.decision().state != ContactorState::drive && steps() < 100) step();
  }

  FaultSet step(const Change& change = {}) {
    measure(protection.decision().outputs, change);
    const FaultSet faults = protection.update(sample, estimate, inputs).faults,
                   expected = oracle_.check(sample, estimate.voltage_rejected);
    for (std::size_t k = 0; k < fault_count; ++k) {
      if (!visible_in_samples(k) || has(expected, k) == has(faults, k)) continue;  // overload: OverloadProtection
      ADD_FAILURE() << expected_rows[k].name << (has(expected, k) ? " missed" : " false") << " at " << steps() * 100
                    << " ms, value " << oracle_.values[k].value_or(measurement::no_reading);
      wrong = true;
    }
    return faults;
  }

  Protection<16> protection{forklift_plan};
  bool wrong = false;

 private:
  TruckOracle oracle_;
};

class EverySampledProtection : public ::testing::TestWithParam<std::size_t> {
 protected:
  const ExpectedRow& row = expected_rows[GetParam()];
};
INSTANTIATE_TEST_SUITE_P(Rows, EverySampledProtection, ::testing::ValuesIn(rows(visible_in_samples)), signal_name);

class EveryMeasuredProtection : public EverySampledProtection {};
INSTANTIATE_TEST_SUITE_P(Rows, EveryMeasuredProtection, ::testing::ValuesIn(rows([](std::size_t k) {
                           return visible_in_samples(k) && levels(expected_rows[k]).noise > 0;
                         })),
                         signal_name);

TEST_P(EverySampledProtection, IsRaisedBySamplesBeyondItsThresholdAndByNoOthers) {
  const std::size_t k = GetParam();
  const Levels l = levels(row);
  for (const bool beyond : {false, true}) {
    Truck truck(k + 1);
    ASSERT_EQ(truck.protection.decision().state, ContactorState::drive);
    int fired_ms = -1, since_ms = -1;
    // A stuck reading is detected after the others have moved, within half of their period of 40 s.
    const int limit_ms = row.delay_ms + (waits_for_others(k) ? 60'000 : 3'000);
    for (int t = 0; t < limit_ms && !truck.wrong; t += step_ms) {
      const FaultSet faults =
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
      const FaultSet faults = truck.step([&](auto& s, auto& e, auto&) { inject(k, value, truck, s, e); });
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

TEST_P(EverySampledProtection, IsRaisedDuringEveryOtherFaultVisibleInSamples) {
  const std::size_t k = GetParam();
  for (std::size_t other = 0; other < fault_count; ++other) {
    if (other == k || !visible_in_samples(other) ||
        forklift_plan.rules[other].quantity == forklift_plan.rules[k].quantity)
      continue;
    Truck truck(1'000 + 64 * k + other);
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

TEST(ProtectionOfATruck, RaisesNoFaultInTenMinutesOfNormalOperation) {
  Truck truck(7);
  for (int t = 0; t < 600'000; t += step_ms) ASSERT_EQ(truck.step(), 0U) << t;
}

class OverloadProtection : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Loads, OverloadProtection, ::testing::Values(-4.0, -2.0, -1.5, -1.2, 1.2, 1.5, 2.0, 4.0),
                         [](const auto& load) {
                           return std::string(load.param < 0 ? "Discharge" : "Charge") +
                                  std::to_string(static_cast<int>(std::abs(load.param) * 10)) + "Tenths";
                         });

/// Trip time of an ideal integral: 30 s / (i^2 - 1), i = I / (1.05 x 6 A). The integer one differs by at most 0.8 %
/// (1/256 in i).
TEST_P(OverloadProtection, TripsWhenTheOverloadIntegralReachesItsThreshold) {
  const double i = GetParam() * 6 / 6.3, expected_s = 30 / (i * i - 1);
  Truck truck(3);
  double fired_s = -1;
  const Fault fault = GetParam() < 0 ? Fault::discharge_overcurrent : Fault::charge_overcurrent;
  for (int t = 0; t < 1'000 * expected_s * 1.1 + 2'000 && fired_s < 0; t += step_ms) {
    const FaultSet faults =
        truck.step([&](auto& s, auto&, auto&) { s.current_ua = static_cast<std::int32_t>(6e6 * GetParam()); });
    if ((faults & bit(fault)) != 0) fired_s = (t + step_ms) / 1e3;
  }
  EXPECT_NEAR(fired_s, expected_s, 0.1 + expected_s * 2 * i * i / (i * i - 1) / (256 * std::abs(i)) * 1.05);
}

TEST(OverloadIntegral, TheContinuousCurrentAndShortBurstsNeverTrip) {
  Truck truck(4);
  for (int t = 0; t < 600'000; t += step_ms) {
    const bool burst = t / 1'000 % 40 < 8;  // twice the limit for 8 of 40 s
    const FaultSet faults = truck.step([&](auto& s, auto&, auto&) {
      s.current_ua = burst ? -12'000'000 : -1'000'000;
      if (t < 300'000) s.current_ua = -6'300'000 + 30'000;
    });
    ASSERT_EQ(faults, 0U) << t;
  }
}

}  // namespace
}  // namespace bms::protection
