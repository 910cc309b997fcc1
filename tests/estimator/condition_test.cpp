#include "estimator/condition.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "plant/random.hpp"
#include "plant/truth_cell.hpp"
#include "tests/cells.hpp"
#include "tests/starting_point.hpp"

namespace bms::estimator {
namespace {

template <class Scalar>
class ConditionOfEveryScalar : public ::testing::Test {};
using Scalars = ::testing::Types<float, double, arithmetic::FixedPoint>;
TYPED_TEST_SUITE(ConditionOfEveryScalar, Scalars);

/// The plant's cell, an estimator and its condition.
template <class S>
struct Truck {
  using Estimator = SocEstimator<S>;

  explicit Truck(double soc, const measurement::StartingPoint& start)
      : plant({}, {.soc = soc, .v_rc_v = 0, .temperature_c = 25}), estimator(start) {}

  Estimate<S> second(double current_a, bool limits_wanted = true, bool with_voltage = true) {
    plant.run(current_a, 25, 1);
    time_us += 1'000'000;
    const measurement::Sample s{time_us, static_cast<std::int32_t>(1e6 * (current_a + 0.01 * random.normal())),
                                with_voltage
                                    ? static_cast<std::int32_t>(1e6 * (plant.voltage_v() + 0.001 * random.normal()))
                                    : measurement::no_reading,
                                2'500};
    const auto e = estimator.step(cell, s);
    condition.update(cell, s, e, estimator, limits_wanted);
    return e;
  }

  plant::Cell plant;
  plant::Random random{3};
  model::Cell<S, model::max_intervals> cell = tests::prepared<S>();
  Estimator estimator;
  Condition<Estimator> condition;
  std::uint64_t time_us = 0;
};

double load(int k) {
  if (k % 60 < 30) return -6;
  return k % 60 < 40 ? 3 : 0;
}

TYPED_TEST(ConditionOfEveryScalar, ReportsOverAShiftWhatItsPartsReport) {
  Truck<TypeParam> truck(0.95, starting_at(0.95, 0.01));
  double shown = 0.95, largest_jump = 0;
  bool observable = false, bridged = false;
  for (int k = 0; k < 6'000; ++k) {
    truck.second(load(k));
    const double now = arithmetic::as_double(truck.condition.display_soc());
    if (k > 0) largest_jump = std::max(largest_jump, std::abs(now - shown));
    shown = now;
    observable = observable || truck.condition.quality().observable;
    bridged = bridged || truck.condition.quality().since_anchor_s > 600;
  }
  EXPECT_LT(largest_jump, 0.0005) << "6 A for a second are 0.03 %, and half a percent a minute";
  EXPECT_NEAR(shown, truck.plant.soc(), 0.02);
  EXPECT_TRUE(observable) << "at 90 %";
  EXPECT_TRUE(bridged) << "on the plateau";
  EXPECT_NEAR(arithmetic::as_double(truck.condition.resistance().ratio), 1, 0.06);
  EXPECT_LT(arithmetic::as_double(truck.condition.resistance().sigma), 0.05);
  EXPECT_EQ(arithmetic::as_double(truck.condition.limits_now().discharge_a), 6) << "what the file allows";
}

TYPED_TEST(ConditionOfEveryScalar, LimitsAreComputedWhenTheyAreWanted) {
  Truck<TypeParam> truck(0.5, starting_at(0.5, 0.01));
  for (int k = 0; k < 10; ++k) truck.second(0, false);
  EXPECT_EQ(arithmetic::as_double(truck.condition.limits_now().discharge_a), 0);
  truck.second(0, true);
  EXPECT_EQ(arithmetic::as_double(truck.condition.limits_now().discharge_a), 6);
}

TYPED_TEST(ConditionOfEveryScalar, WithoutAVoltageNothingIsLearnedAndTheDisplayGoesOn) {
  Truck<TypeParam> truck(0.9, starting_at(0.9, 0.01));
  truck.second(0);
  const double before = arithmetic::as_double(truck.condition.display_soc());
  for (int k = 0; k < 600; ++k) truck.second(-6, true, false);
  EXPECT_NEAR(arithmetic::as_double(truck.condition.display_soc()), before - 600.0 / 3'600, 0.002);
  EXPECT_FALSE(truck.condition.quality().observable);
  EXPECT_NEAR(arithmetic::as_double(truck.condition.resistance().sigma), 0.3, 1e-3);
}

}  // namespace
}  // namespace bms::estimator
