#include "estimator/persistent_errors.hpp"

#include <cmath>
#include <type_traits>

#include <gtest/gtest.h>

#include "estimator/step_constants.hpp"
#include "model/extended_rc.hpp"
#include "tests/cells.hpp"

namespace bms::estimator {
namespace {

template <class S>
using Plain = model::ExtendedRc<0, 0>::Of<S>;
template <class S>
using WithErrors = model::ExtendedRc<0, 0, true>::Of<S>;
using InSigma = PersistentErrors<double, Plain>;
using AsStates = PersistentErrors<double, WithErrors>;

TEST(PersistentErrors, ThePolicyFollowsTheModelAndTheSimpleOneTakesNoMemory) {
  EXPECT_TRUE((std::is_same_v<InSigma, PersistentErrorsInSigma<double, Plain>>));
  EXPECT_TRUE((std::is_same_v<AsStates, PersistentErrorsAsStates<double, WithErrors>>));
  EXPECT_TRUE(std::is_empty_v<InSigma>);
}

TEST(PersistentErrors, ASlowErrorOfTheCurrentIsNoiseOnlyWhereItIsNoState) {
  const auto noise = tests::prepared<double>().noise;
  EXPECT_EQ(InSigma::soc_noise(1e-9, noise, 2), 1e-9 + 2 * noise.walk_soc2_per_s);
  EXPECT_EQ(AsStates::soc_noise(1e-9, noise, 2), 1e-9);
  EXPECT_EQ(InSigma::model_error_in_bank(noise), noise.model_v2);
  EXPECT_EQ(AsStates::model_error_in_bank(noise), 0);
}

/// The error of the SOC axis lasts as long as the voltage error that is a state: 8 correlation times.
TEST(PersistentErrors, AsStatesAQuarterOfTheModelsVarianceStaysNoiseAndTheAxisCountsOnce) {
  const auto noise = tests::prepared<double>().noise;
  const auto axis = [] { return 4e-6; };
  EXPECT_EQ(InSigma::error_in_noise(noise, 9e-6, axis), 9e-6);
  EXPECT_EQ(AsStates::error_in_noise(noise, 9e-6, axis), noise.model_v2 / 4 + 8 * 4e-6);
}

/// As long as 20 % of charge take, at most a working day, and at least as long as the model's error.
TEST(PersistentErrors, AsStatesALargeErrorOfTheResistancesLastsAsLongAsTheSocStaysNearby) {
  const auto cell = tests::prepared<double>();
  StepConstants<double, WithErrors<double>, AsStates> constants;
  constants.set_time_step(cell.noise, 10'000'000);
  constants.set_temperature(cell, 2'500);
  const double capacity_ah = 1 / (3'600 * cell.limits.soc_per_as), in_state_v2 = 0.75 * cell.noise.model_v2,
               once_s = 10 * constants.correlated_samples(), error_v2 = 5 * in_state_v2;
  const auto noise_v2 = [&](double c_rate, double of_resistances_v2) {
    AsStates::LastingLoad load;
    load.add(-c_rate * capacity_ah, 1);
    return load.noise_v2(of_resistances_v2 / constants.known_error2(), cell, constants);
  };
  const auto lasts_s = [&](double c_rate) {
    return 10 * (noise_v2(c_rate, error_v2) - in_state_v2 * once_s / 10) / (error_v2 - in_state_v2);
  };
  EXPECT_NEAR(lasts_s(0.05), 0.2 / 0.05 * 3'600, 1e-6);
  EXPECT_NEAR(lasts_s(0), 36'000, 1e-6);
  EXPECT_NEAR(lasts_s(50), once_s, 1e-6);
  // the state of the voltage error can take it up
  EXPECT_DOUBLE_EQ(noise_v2(0.05, in_state_v2 / 2), in_state_v2 / 2 * once_s / 10);
  StepConstants<double, Plain<double>, InSigma> plain;
  plain.set_time_step(cell.noise, 10'000'000);
  plain.set_temperature(cell, 2'500);
  EXPECT_EQ(InSigma::LastingLoad::noise_v2(1e-4, cell, plain), 1e-4 * plain.known_noise());
}

TEST(PersistentErrors, AGainErrorGrowsWithTheCountedChargeAndStaysWhenItComesBack) {
  AsStates errors;
  errors.start(0.9);
  double variance = 0, soc = 0.9;
  for (int k = 0; k < 60; ++k) {
    errors.add_gain_error(variance, soc -= 0.01, 0.02);
    errors.bound_gain_error(soc, 1, 0.02);
  }
  EXPECT_NEAR(std::sqrt(variance), 0.02 * 0.6, 1e-9);
  const double before = variance;
  for (int k = 0; k < 60; ++k) {
    errors.add_gain_error(variance, soc += 0.01, 0.02);
    errors.bound_gain_error(soc, 1, 0.02);
  }
  EXPECT_NEAR(variance, before, 1e-12);
}

TEST(PersistentErrors, TheGainsPartOfSigmaIsNotMoreThanSigma) {
  AsStates errors;
  errors.start(0.9);
  double variance = 0;
  errors.add_gain_error(variance, 0.4, 0.02);
  errors.bound_gain_error(0.4, 0.002, 0.02);  // the voltage has found the SOC to 0.2 %: a tenth of the capacity counts
  variance = 0;
  errors.add_gain_error(variance, 0.3, 0.02);
  EXPECT_NEAR(variance, 0.02 * 0.02 * (0.2 * 0.2 - 0.1 * 0.1), 1e-12);
}

TEST(PersistentErrors, ACurrentAtRestMeasuresTheOffset) {
  auto parameters = tests::table9;
  parameters.noise.current_at_rest_a = 0.012;
  parameters.noise.current_offset_a = 0.06;
  const auto cell = tests::prepared<double>(parameters);
  CellState<double, WithErrors> state;
  state.covariance.set_diagonal({1e-6, 1e-6, 1e-4, cell.noise.offset_per_h2});
  AsStates errors;
  for (int k = 0; k < 3'600; ++k) errors.update_offset_at_rest(state, cell, {30'000, true}, 1'000'000, 1);
  EXPECT_NEAR(6 * state.model_state[WithErrors<double>::current_offset], 0.03, 0.006);
  std::array<double, AsStates::values> extra{};
  AsStates::report(state, extra);
  EXPECT_EQ(extra[1], state.model_state[WithErrors<double>::current_offset]);
  EXPECT_LT(6 * extra[2], 0.012);
}

}  // namespace
}  // namespace bms::estimator
