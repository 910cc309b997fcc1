// Numbers that are not finite never leave the estimator: mechanisms of strength 0, and a cell whose tables are broken.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "estimator/soc_estimator.hpp"
#include "model/extended.hpp"
#include "tests/cells.hpp"

namespace bms::estimator {
namespace {

constexpr std::size_t mechanism_states = model::ChosenLaws<double>::most_states;

measurement::Sample discharge(int second) {
  return {static_cast<std::uint64_t>(second) * 1'000'000, -3'000'000, 3'250'000 + second % 7 * 100, 2'500};
}

template <class Result>
void expect_finite(const Result& e, int second) {
  for (const double value : {arithmetic::as_double(e.soc), arithmetic::as_double(e.soc_sigma),
                             arithmetic::as_double(e.v_rc_v), arithmetic::as_double(e.voltage_predicted_v)})
    ASSERT_TRUE(std::isfinite(value)) << second;
  ASSERT_GT(arithmetic::as_double(e.soc_sigma), 0) << second;
}

/// Both forms of the hysteresis with a gap of 0, which the bounds of the parameter allow.
template <class S>
void hysteresis_without_a_gap() {
  const double capacity_ah = tests::table9.capacity_ah;
  for (const double measured : {0.0, 1.0}) {
    model::MechanismSetting hysteresis =
        model::default_setting(model::mechanism_index("ocv_hysteresis"), tests::table9);
    hysteresis.value[0] = 0;
    hysteresis.value[4] = measured;
    const std::vector<model::MechanismSetting> all{hysteresis};
    const model::ExtendedCell<S, model::max_intervals, model::ChosenLaws<S>> cell{tests::prepared<S>(),
                                                                                  model::chosen<S>(all, capacity_ah)};
    SocEstimator<S, model::ExtendedRc<1, mechanism_states>::template Of> estimator;
    for (int k = 0; k < 600; ++k) {
      const auto e = estimator.step(cell, discharge(k));
      expect_finite(e, k);
      EXPECT_EQ(e.flags & not_a_number, 0U);
    }
  }
}

TEST(NotANumber, AMechanismWithoutStrengthLeavesTheEstimateFinite) {
  hysteresis_without_a_gap<float>();
  hysteresis_without_a_gap<double>();
  hysteresis_without_a_gap<arithmetic::FixedPoint>();
}

TEST(NotANumber, IsReportedWithAnUnknownSocAndTheChargeCountedOn) {
  auto parameters = tests::table9;
  for (std::size_t k = 0; k < parameters.rc.soc.size; ++k)
    parameters.rc.r0_ohm[k] = std::numeric_limits<double>::quiet_NaN();
  const auto broken = tests::prepared<float>(parameters);
  const auto whole = tests::prepared<float>();
  SocEstimator<float> estimator({800'000'000, 10'000'000});
  const auto before = estimator.step(whole, discharge(0));
  Estimate<float> e;
  for (int k = 1; k <= 1'200; ++k) {
    e = estimator.step(broken, discharge(k));
    expect_finite(e, k);
    EXPECT_NE(e.flags & not_a_number, 0U);
    EXPECT_GT(e.soc_sigma, 0.2F) << "nothing is known";
  }
  EXPECT_NEAR(e.soc, before.soc - 3 * 1'200 / 3'600.0 / parameters.capacity_ah, 1e-3) << "1 Ah was taken out";
  for (int k = 1'201; k < 8'000; ++k) {
    e = estimator.step(whole, discharge(k));
    expect_finite(e, k);
  }
  EXPECT_EQ(e.flags & not_a_number, 0U);
}

TEST(NotANumber, AStartThatClaimsToBeCertainIsNot) {
  SocEstimator<float> estimator({500'000'000, 0});
  EXPECT_GT(estimator.step(tests::prepared<float>(), discharge(0)).soc_sigma, 0.0F);
}

}  // namespace
}  // namespace bms::estimator
