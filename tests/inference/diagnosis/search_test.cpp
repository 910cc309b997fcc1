// Fits of a search compared with the minimum that they should have reached.
#include "diagnosis/search.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "diagnosis/prepare.hpp"
#include "diagnosis/screen.hpp"
#include "diagnosis/thresholds.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

/// Far from the cell file, where derivatives by the base parameters taken at the file lead nowhere.
Hypothesis several(const LikelihoodModel& likelihood) {
  Hypothesis h = likelihood.base();
  for (const char* id : {"ocv_hysteresis", "slow_polarisation", "temperature_resistance", "current_gain"})
    h = with(h, model::mechanism_index(id), likelihood.cell());
  return h;
}

TEST(Search, AFitThatIsCompletedStandsInAMinimum) {
  double slow_v = 0;
  PreparedRecording r = test::recorded(test::drive(2, 51), 0.7, 51, [&](std::size_t, double current_a, double soc) {
    slow_v += (0.012 * current_a - slow_v) / 400;
    return slow_v + 0.05 * (soc - 0.5) * current_a / 6 + 0.02 * std::tanh(current_a / 3);
  });
  LikelihoodModel likelihood = likelihood_model_of(test::table9(), {}, {r});
  const Progress progress;
  const Stopped stopped;
  Search search(likelihood, progress, stopped);
  const HypothesisFit begun = likelihood.fit(several(likelihood), 1);
  const HypothesisFit best = search.converged(begun);
  likelihood.set_noise(best.noise);
  likelihood.linearise(best.hypothesis, best.calibration);
  const HypothesisFit again = likelihood.fit(best.hypothesis, best.calibration);
  EXPECT_LT(best.cost - again.cost, 1);
  EXPECT_GT(search.score(begun) - search.score(best), 1);  // there was something to gain
}

TEST(Screen, AStrengthThatWouldBeNegativeIsNoneAndTheOthersAreJudgedWithoutIt) {
  // R1 flattens as the current grows, R0 does the opposite: the best shares of both are negative and positive
  constexpr std::size_t transfer = model::mechanism_index_of<model::ChargeTransfer>;
  double flat_v = 0;
  const PreparedRecording r = test::recorded(test::drive(2, 52), 0.7, 52, [&](std::size_t, double a, double) {
    const double x = a / 6, less_v = x == 0 ? 0 : a * (1 - std::asinh(x) / x);
    flat_v += (0.004 * less_v - flat_v) / 30;
    return 0.0005 * less_v - flat_v;
  });
  LikelihoodModel likelihood = likelihood_model_of(test::table9(), {}, {r});
  const HypothesisFit control = likelihood.fit(likelihood.base());
  const Screen screen(likelihood, control, {transfer});
  ASSERT_EQ(screen.candidates().size(), 1U);
  const Candidate& c = screen.candidates().front();
  EXPECT_GT(c.gain, thresholds.decision.detected);
  EXPECT_LT(c.start.value[0], 0.01);
  EXPECT_GT(c.start.value[1], 0.1);
}

}  // namespace
}  // namespace bms::diagnosis
