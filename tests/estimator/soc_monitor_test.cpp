#include "estimator/soc_monitor.hpp"

#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "model/extended.hpp"
#include "tests/cells.hpp"

namespace bms::estimator {
namespace {

template <class S>
using Model = model::ExtendedRc<0, 0>::Of<S>;

/// Flags of a check of a voltage that the model predicts exactly.
std::uint32_t flags_at(double soc, double sigma) {
  const auto cell = tests::prepared<double>();
  StepConstants<double, Model<double>, PersistentErrors<double, Model>> constants;
  constants.set_time_step(cell.noise, 1'000'000);
  constants.set_temperature(cell, 2'500);
  CellState<double, Model> state;
  state.charge.set(soc, cell.charge);
  state.covariance.set_diagonal({1e-8, sigma * sigma});
  SocMonitor<double, Model> monitor;
  monitor.start(cell);
  monitor.watch(cell, constants, state, 1'000'000, 0, 0, 0, true);
  if (!monitor.needs_check(soc, 0)) return 0;
  return monitor.judge(cell, {0, 1, 25}, constants, soc, 0, monitor.resistance_error_v2(constants, 0, state), 0, state);
}

TEST(SocMonitor, ContradictsASocThatNoCellCanHave) {
  EXPECT_EQ(flags_at(1.2, 0.01), soc_ambiguous | soc_contradicted);
  EXPECT_EQ(flags_at(-0.2, 0.01), soc_ambiguous | soc_contradicted);
}

TEST(SocMonitor, LetsASocPassThatIsPossibleWithinItsSigmaOrTheErrorOfACapacity) {
  EXPECT_EQ(flags_at(1.04, 0.001), 0U);
  EXPECT_EQ(flags_at(-0.04, 0.001), 0U);
  EXPECT_EQ(flags_at(1.2, 0.1), 0U);
  EXPECT_EQ(flags_at(0.5, 0.001), 0U);
}

/// Whether a deviation of the voltage that grows by 1 mV a minute for 40 min contradicts the SOC at a temperature, with
/// the file of a cell that was identified at 0 to 40 degrees C.
bool growing_deviation_contradicts_at(std::int16_t cdegc) {
  auto parameters = tests::table9;
  parameters.range.temperature_min_c = 0;
  parameters.range.temperature_max_c = 40;
  const model::ExtendedCell<double, model::max_intervals, model::ChosenLaws<double>> follows{
      tests::prepared<double>(parameters),
      model::chosen<double>(std::vector<model::MechanismSetting>{model::default_setting(
                                model::mechanism_index("temperature_resistance"), parameters)},
                            parameters.capacity_ah)};
  const auto cell = tests::prepared<double>(parameters);
  StepConstants<double, Model<double>, PersistentErrors<double, Model>> constants;
  constants.set_time_step(cell.noise, 1'000'000);
  constants.set_temperature(follows, cdegc);
  CellState<double, Model> state;
  state.charge.set(0.5, cell.charge);
  state.covariance.set_diagonal({1e-8, 1e-4});
  SocMonitor<double, Model> monitor;
  monitor.start(cell);
  for (std::uint64_t minute = 1; minute <= 40; ++minute) {
    const double off_v = -1e-3 * static_cast<double>(minute);
    monitor.force_check();
    monitor.watch(cell, constants, state, minute * 60'000'000, 0, 0, off_v, true);
    if (!monitor.needs_check(0.5, off_v)) continue;
    const auto flags = monitor.judge(cell, {0, 1, 25}, constants, 0.5, off_v,
                                     monitor.resistance_error_v2(constants, 0, state), 0, state);
    if ((flags & soc_contradicted) != 0) return true;
  }
  return false;
}

TEST(SocMonitor, TakesADeviationForTheModelsWhereThatWasNotIdentified) {
  EXPECT_TRUE(growing_deviation_contradicts_at(2'500));
  EXPECT_FALSE(growing_deviation_contradicts_at(-2'000));
}

}  // namespace
}  // namespace bms::estimator
