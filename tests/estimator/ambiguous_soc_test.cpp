#include "estimator/ambiguous_soc.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "estimator/start.hpp"
#include "tests/cells.hpp"

namespace bms::estimator {
namespace {

template <class S>
using Model = model::ExtendedRc<0, 0>::Of<S>;

/// A filter's state with an open bank, and a cell at rest with another SOC.
struct Restart {
  explicit Restart(double soc) {
    state.charge.set(soc, cell.charge);
    state.covariance.set_diagonal({1e-8, 0.3 * 0.3});
    constants.set_time_step(cell.noise, 1'000'000);
    constants.set_temperature(cell, 2'500);
    const SocDistribution<double> before{soc, 0.3 * 0.3};
    ambiguous.open_at(soc, PriorMisfit<double>(before));
  }
  /// One second at rest; the voltage is the OCV at true_soc.
  void second(double true_soc) {
    const double soc = state.charge.soc(cell.charge);
    std::uint8_t interval = 0;
    const double innovation_v =
        model::look_up(cell, true_soc, interval).ocv_v - model::look_up(cell, soc, interval).ocv_v;
    ambiguous.update(cell, {0, 1, 25}, constants, soc, innovation_v, 0, {}, interval, state);
  }

  model::Cell<double, model::max_intervals> cell = tests::prepared<double>();
  CellState<double, Model> state;
  StepConstants<double, Model<double>, PersistentErrors<double, Model>> constants;
  AmbiguousSoc<double, Model> ambiguous;
};

TEST(AmbiguousSoc, FindsTheSocWhereTheCurveIsSteepAndCloses) {
  Restart r(0.5);
  EXPECT_TRUE(r.ambiguous.open());
  for (int k = 0; k < 1'800 && r.ambiguous.open(); ++k) r.second(0.05);
  EXPECT_FALSE(r.ambiguous.open());
  EXPECT_NEAR(r.state.charge.soc(r.cell.charge), 0.05, 0.02);
  EXPECT_LT(std::sqrt(r.state.soc_variance()), SocBank<double>::close_below_sigma);
}

TEST(AmbiguousSoc, StaysOpenOnThePlateau) {
  Restart r(0.5);
  for (int k = 0; k < 1'800; ++k) r.second(0.5);
  EXPECT_TRUE(r.ambiguous.open());
  EXPECT_GT(std::sqrt(r.state.soc_variance()), SocBank<double>::close_below_sigma);
}

/// Samples that no sensor should give leave a mean deviation of volts.
TEST(AmbiguousSoc, ALargeDeviationFromBeforePasses) {
  Restart r(0.5);
  const SocDistribution<double> before{0.5, 0.3 * 0.3};
  r.ambiguous.open_at(0.5, PriorMisfit<double>(before), false, 100);
  for (int k = 0; k < 1'800; ++k) r.second(0.05);
  EXPECT_TRUE(r.ambiguous.open());
  for (int k = 0; k < 4 * 3'600 && r.ambiguous.open(); ++k) r.second(0.05);
  EXPECT_FALSE(r.ambiguous.open());
  EXPECT_NEAR(r.state.charge.soc(r.cell.charge), 0.05, 0.02);
}

/// The place of the filter is the most probable one, but all others together are e times as probable.
TEST(AmbiguousSoc, TakesOverFromTheFilterWhenTheSocIsMoreProbablyElsewhere) {
  const auto takes_over = [](double others) {
    Restart r(0.5);
    r.ambiguous.open_at(0.5, PriorMisfit<double>(), true, 100);  // the model was off by volts: no voltage says anything
    r.ambiguous.hypotheses().open_at(
        0.5, [&](int k) { return std::abs(SocBank<double>::grid(k) - 0.5) < 0.05 ? 0 : others; });
    for (int k = 0; k < 128; ++k) r.second(0.5);
    return !r.ambiguous.in_background();
  };
  EXPECT_TRUE(takes_over(0.5));
  EXPECT_TRUE(takes_over(1.0)) << "58 e^-1 = 21.3, and 6 at the filter's place";
  EXPECT_FALSE(takes_over(1.5)) << "58 e^-1.5 = 12.9";
}

TEST(AmbiguousSoc, AStartThatNoVoltageContradictsStays) {
  for (const double soc : {0.02, 0.5, 0.9, 0.98, 1.0}) {
    for (const double sigma : {0.01, 0.02, 0.028}) {
      Restart r(soc);
      const SocDistribution<double> before{soc, sigma * sigma};
      const PriorMisfit<double> misfit(before, WrongPrior::even_odds);
      r.ambiguous.open_at(soc, misfit, true, 100);  // the model was off by volts: no voltage says anything
      for (int k = 0; k < 300; ++k) r.second(soc);
      EXPECT_TRUE(r.ambiguous.in_background() || !r.ambiguous.open()) << soc << ", " << sigma;
      EXPECT_NEAR(r.state.charge.soc(r.cell.charge), soc, 1e-6) << sigma;
    }
  }
}

TEST(AmbiguousSoc, TheModelsErrorAndTheStatesThatAreNotCorrectedPersist) {
  const Restart r(0.5);
  EXPECT_DOUBLE_EQ((AmbiguousSoc<double, Model>::persistent_variance(r.cell.noise, r.state, {2, 1})),
                   r.cell.noise.model_v2 + 4e-8);
}

}  // namespace
}  // namespace bms::estimator
