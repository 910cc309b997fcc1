// Fits of a search compared with the minimum that they should have reached.
#include "diagnosis/search.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "diagnosis/prepare.hpp"
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

}  // namespace
}  // namespace bms::diagnosis
