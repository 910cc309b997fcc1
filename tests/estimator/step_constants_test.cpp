#include "estimator/step_constants.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "estimator/persistent_errors.hpp"
#include "model/extended.hpp"
#include "tests/cells.hpp"

namespace bms::estimator {
namespace {

template <class S>
using Model = model::ExtendedRc<0, 0>::Of<S>;
template <class S>
using Constants = StepConstants<S, Model<S>, PersistentErrors<S, Model>>;

TEST(StepConstants, AnErrorThatPersistsCountsOncePerItsCorrelationTime) {
  const auto cell = tests::prepared<double>();
  Constants<double> c;
  c.set_time_step(cell.noise, 500'000);
  EXPECT_DOUBLE_EQ(c.duration_s(), 0.5);
  EXPECT_DOUBLE_EQ(c.correlated_samples(), cell.noise.model_correlation_s / 0.5);
  c.set_time_step(cell.noise, 4'000'000'000);
  EXPECT_EQ(c.correlated_samples(), 1) << "a step longer than the correlation time is one sample";
}

TEST(StepConstants, ATurnOfTheBankTakesMinutesAtAnyInterval) {
  const auto cell = tests::prepared<double>();
  Constants<double> c;
  for (const double step_s : {0.1, 1.0, 1.9}) {
    c.set_time_step(cell.noise, static_cast<std::uint64_t>(1e6 * step_s));
    EXPECT_EQ(c.bank_points(), 1) << step_s;
  }
  for (const double step_s : {2.0, 5.0, 10.0, 30.0, 60.0, 127.0, 300.0, 3'600.0}) {
    c.set_time_step(cell.noise, static_cast<std::uint64_t>(1e6 * step_s));
    const int samples = 2 * SocBank<double>::points / c.bank_points();
    EXPECT_EQ(samples * c.bank_points(), 2 * SocBank<double>::points) << step_s << ": ends with a sample";
    EXPECT_LE(samples * step_s, std::max(256.0, step_s)) << step_s;
    EXPECT_DOUBLE_EQ(c.bank_share(), std::min(samples * step_s / cell.noise.model_correlation_s, 1.9)) << step_s;
  }
}

TEST(StepConstants, AStepLongerThanItsTypeIsCutButItsUnknownChargeIsNot) {
  const auto cell = tests::prepared<double>();
  Constants<double> c;
  c.set_time_step(cell.noise, 5'000'000'000);
  EXPECT_DOUBLE_EQ(c.duration_s(), 4'095);
  const double rate = cell.noise.unknown_soc_per_s;
  c.set_time_step(cell.noise, 1'000'000);
  EXPECT_DOUBLE_EQ(c.unknown_charge(cell, 0.0), rate);
  EXPECT_DOUBLE_EQ(c.unknown_charge(cell, -3.0), rate + 3.0 / 6 / 3'600);
  c.set_time_step(cell.noise, 86'400'000'000);
  EXPECT_EQ(c.unknown_charge(cell, 6.0), 1) << "not more than the capacity";
  EXPECT_DOUBLE_EQ(c.charge_of(cell, 3.0), 3.0 * 4'095 / 6 / 3'600);
  c.set_time_step(cell.noise, ~std::uint64_t{0});
  EXPECT_EQ(c.charge_of(cell, 0.0), 0) << "at once";
  EXPECT_EQ(c.charge_of(cell, 12.0), 1);
}

TEST(StepConstants, ColdAndHeatMakeResistancesUncertainThatFollowNoTemperature) {
  const auto cell = tests::prepared<double>();
  Constants<double> c;
  c.set_time_step(cell.noise, 1'000'000);
  c.set_temperature(cell, 2'500);
  EXPECT_DOUBLE_EQ(c.resistance_error(), cell.noise.resistance_error);
  c.set_temperature(cell, 4'500);
  const double less = 1 - std::exp(40'000 / 8.314462618 * (1 / 318.15 - 1 / 298.15));
  EXPECT_NEAR(c.resistance_error(), cell.noise.resistance_error + less, 1e-6);
  c.set_temperature(cell, -500);
  const double more = std::exp(40'000 / 8.314462618 * (1 / 268.15 - 1 / 298.15)) - 1;
  EXPECT_NEAR(c.resistance_error(), cell.noise.resistance_error + more, 1e-6);
  const double known = cell.noise.resistance_error, by_temperature = std::pow(known + more, 2) - known * known;
  EXPECT_NEAR(c.temperature_error2(), by_temperature, 1e-4);
  EXPECT_NEAR(c.resistance_noise(), known * known * c.correlated_samples() + by_temperature * 36'000, 1)
      << "the weather lasts for ten hours";
  c.set_temperature(cell, measurement::no_temperature);
  EXPECT_DOUBLE_EQ(c.resistance_error(), cell.noise.resistance_error);
}

TEST(StepConstants, TheColdBeginsBelowTheReferenceTemperatureOfTheCell) {
  auto parameters = tests::table9;
  parameters.reference_temperature_c = 10;
  const auto cell = tests::prepared<double>(parameters);
  Constants<double> c;
  c.set_time_step(cell.noise, 1'000'000);
  c.set_temperature(cell, 1'000);
  EXPECT_DOUBLE_EQ(c.resistance_error(), cell.noise.resistance_error);
  c.set_temperature(cell, -500);
  const double more = std::exp(40'000 / 8.314462618 * (1 / 268.15 - 1 / 283.15)) - 1;
  EXPECT_NEAR(c.resistance_error(), cell.noise.resistance_error + more, 1e-6);
}

TEST(StepConstants, ACellThatFollowsTheTemperatureIsUncertainOutsideOfItsIdentification) {
  auto parameters = tests::table9;
  parameters.tolerance.resistance_per_ev = 0.2;
  parameters.range.temperature_min_c = 0;
  parameters.range.temperature_max_c = 40;
  using Cell = model::ExtendedCell<double, model::max_intervals, model::ChosenLaws<double>>;
  const std::vector<model::MechanismSetting> follows{
      model::default_setting(model::mechanism_index("temperature_resistance"), parameters)};
  const Cell cell{tests::prepared<double>(parameters), model::chosen<double>(follows, parameters.capacity_ah)};
  Constants<double> c;
  c.set_time_step(cell.noise, 1'000'000);
  constexpr double k_ev = 8.617333e-5;
  for (const double celsius : {0.0, 25.0, 40.0}) {
    c.set_temperature(cell, static_cast<std::int16_t>(100 * celsius));
    EXPECT_DOUBLE_EQ(c.resistance_error(), cell.noise.resistance_error) << celsius;
    EXPECT_EQ(c.extrapolated(), 0) << celsius;
  }
  c.set_temperature(cell, -10);
  EXPECT_NEAR(c.extrapolated(), 0.2 * (1 / 273.05 - 1 / 273.15) / k_ev / cell.noise.resistance_error, 1e-5);
  c.set_temperature(cell, -2'000);
  EXPECT_NEAR(c.resistance_error(), cell.noise.resistance_error + 0.2 * (1 / 253.15 - 1 / 273.15) / k_ev, 1e-5);
  EXPECT_EQ(c.extrapolated(), 1) << "ten times what it is wrong by inside";
  c.set_temperature(cell, 6'000);
  EXPECT_NEAR(c.resistance_error(), cell.noise.resistance_error + 0.2 * (1 / 313.15 - 1 / 333.15) / k_ev, 1e-5);
}

}  // namespace
}  // namespace bms::estimator
