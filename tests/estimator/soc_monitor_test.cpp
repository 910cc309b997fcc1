#include "estimator/soc_monitor.hpp"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace bms::estimator
