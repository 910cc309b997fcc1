#include "estimator/health.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "estimator/soc_estimator.hpp"
#include "plant/random.hpp"
#include "plant/truth_cell.hpp"
#include "tests/cells.hpp"
#include "tests/starting_point.hpp"

namespace bms::estimator {
namespace {

template <class Scalar>
class HealthOfEveryScalar : public ::testing::Test {};
using Scalars = ::testing::Types<float, double, arithmetic::FixedPoint>;
TYPED_TEST_SUITE(HealthOfEveryScalar, Scalars);

/// A day of a truck whose cell has other than the file's capacity and resistances: down from full to nearly empty, up
/// again.
template <class S>
struct Day {
  CapacityHealth<S> capacity;
  ResistanceHealth<S> resistance;

  Day(double capacity_ah, double more_ohm, int turns) {
    const auto cell = tests::prepared<S>();
    plant::Cell truth({.capacity_ah = capacity_ah}, {.soc = 0.97, .v_rc_v = 0, .temperature_c = 25});
    plant::Random random(11);
    SocEstimator<S> estimator(starting_at(0.97, 0.01));
    std::uint64_t time_us = 0;
    for (int turn = 0; turn < turns; ++turn) {
      for (int k = 0; k < 20'000; ++k) {
        const bool down = turn % 2 == 0;
        if (down ? truth.soc() < 0.04 : truth.soc() > 0.97) break;
        const double load_a = k % 60 < 40 ? -6 : -1.5;
        const double current_a = down ? load_a : 3;
        truth.run(current_a, 25, 1);
        time_us += 1'000'000;
        const measurement::Sample s{
            time_us, static_cast<std::int32_t>(1e6 * (current_a + 0.01 * random.normal())),
            static_cast<std::int32_t>(1e6 * (truth.voltage_v() + more_ohm * current_a + 0.001 * random.normal())),
            2'500};
        const auto e = estimator.step(cell, s);
        watch(cell, s, e, k == 0);
      }
    }
  }

  template <class Cell>
  void watch(const Cell& cell, const measurement::Sample& s, const Estimate<S>& e, bool first) {
    using namespace model;
    const auto at = look_up(cell, e.soc);
    const Current<S> current_a = from_micro<Current<S>>(s.current_ua);
    const Voltage<S> innovation_v = from_micro<Voltage<S>>(s.voltage_uv) - e.voltage_predicted_v;
    const VoltagePerSoc<S> slope = VoltagePerSoc<S>(at.ocv_delta_v * at.per_width);
    const Voltage<S> drop_v = Voltage<S>(at.r0_ohm * current_a), doubt_v = drop_v * Fraction<S>(0.3);
    const Soc<S> off = ratio<Soc<S>>(innovation_v, slope);
    const Variance<S> told2 =
        ratio<Variance<S>>(ratio<Variance<S>>(Variance<S>(at.error_v2 + doubt_v * doubt_v), slope), slope);
    const Soc<S> counted = Soc<S>(current_a * Fraction<S>(1.0 / 21'600));
    if (first) resistance.interrupt();
    capacity.count(counted, Variance<S>(1e-10));
    constexpr double known = CapacityHealth<S>::known_soc;
    // further away the slope differs
    if (told2 < Variance<S>(known * known) && arithmetic::magnitude(off) < Soc<S>(known))
      capacity.read(Soc<S>(e.soc + off), told2);
    else
      capacity.leave();
    resistance.update(innovation_v, drop_v, Variance<S>(1e-6));
  }
};

TYPED_TEST(HealthOfEveryScalar, FindsTheCapacityThatIsLeft) {
  for (const double left : {0.8, 1.0, 1.05}) {
    const Day<TypeParam> day(6 * left, 0, 4);
    const auto found = day.capacity.learned().health();
    EXPECT_NEAR(arithmetic::as_double(found.ratio), left, 2 * arithmetic::as_double(found.sigma)) << left;
    EXPECT_LT(arithmetic::as_double(found.sigma), 0.02) << left;
  }
}

TYPED_TEST(HealthOfEveryScalar, FindsTheResistanceThatHasGrown) {
  for (const double more : {0.0, 0.3, 0.6}) {
    const Day<TypeParam> day(6, more * 0.0133, 1);
    const auto found = day.resistance.health();
    // voltages of such a cell contradict the SOC: R0 is then read at one where it differs by up to a tenth
    EXPECT_NEAR(arithmetic::as_double(found.ratio), 1 + more, 0.02 + 0.1 * more) << more;
    EXPECT_LT(arithmetic::as_double(found.sigma), 0.03) << more;
  }
}

TYPED_TEST(HealthOfEveryScalar, WhoHasSeenNothingKnowsNothing) {
  const auto capacity = CapacityHealth<TypeParam>().learned().health();
  EXPECT_NEAR(arithmetic::as_double(capacity.sigma), 0.1, 1e-6);
  const auto resistance = ResistanceHealth<TypeParam>().health();
  EXPECT_NEAR(arithmetic::as_double(resistance.sigma), 0.3, 1e-6);
}

TYPED_TEST(HealthOfEveryScalar, GoesOnWithWhatAnEarlierRunHasFound) {
  const Day<TypeParam> day(6 * 0.8, 0.3 * 0.0133, 4);
  CapacityHealth<TypeParam> capacity;
  ResistanceHealth<TypeParam> resistance;
  const auto ppm = [](const auto& value) { return arithmetic::to_micro(value); };
  const auto left = day.capacity.learned().health(), grown = day.resistance.health();
  capacity.restore(ppm(left.ratio), ppm(left.sigma));
  resistance.restore(ppm(grown.ratio), ppm(grown.sigma));
  const auto same = [](const Health<TypeParam>& after, const Health<TypeParam>& before) {
    EXPECT_NEAR(arithmetic::as_double(after.ratio), arithmetic::as_double(before.ratio), 1e-6);
    EXPECT_NEAR(arithmetic::as_double(after.sigma), arithmetic::as_double(before.sigma), 6e-5);
  };
  same(capacity.learned().health(), day.capacity.learned().health());
  same(resistance.health(), day.resistance.health());
  EXPECT_GT(arithmetic::as_double(capacity.learned().health().sigma), 0) << "a later visit still counts";
}

TYPED_TEST(HealthOfEveryScalar, HalfAPlateauIsNoCapacity) {
  CapacityHealth<TypeParam> capacity;
  using namespace model;
  for (int k = 0; k < 1'000; ++k) {
    capacity.count(Soc<TypeParam>(-1e-4), Variance<TypeParam>(0.0));
    capacity.leave();
  }
  EXPECT_NEAR(as_double(capacity.learned().health().sigma), 0.1, 1e-6);
}

}  // namespace
}  // namespace bms::estimator
