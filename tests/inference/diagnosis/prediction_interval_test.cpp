// The share of readings within the 95 % interval: of errors of known size, and of recordings of the same cell.
#include "diagnosis/prediction_interval.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/prepare.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

TEST(Coverage, IsTheShareOfTheReadingsThatHaveAValue) {
  Coverage c;
  EXPECT_TRUE(std::isnan(c.share()));
  c.add(0.0195, 0.01);
  c.add(-0.0195, 0.01);
  c.add(std::nan(""), 0.01);
  EXPECT_EQ(c.share(), 1);
  c.add(-0.0197, 0.01);
  c.add(0.0197, 0.01);
  EXPECT_EQ(c.readings(), 4U);
  EXPECT_EQ(c.share(), 0.5);
  EXPECT_NEAR(c.half_width_v(), 0.0196, 1e-12);
  EXPECT_NEAR(c.error_v(), 0.0196, 1e-6);
  EXPECT_EQ(sentence_of(c, "a.csv"),
            "The 95 % interval of the prediction contains 50.0 % of the readings of a.csv; its half width is 19.6 mV, "
            "the error 19.6 mV (RMS).");
}

/// The model's own voltage with an error of `times` the interval's standard deviation, constant for 20 s: its noise
/// from row to row remains that of the instrument.
Coverage of_error(double times) {
  const model::CellParameters<> cell = test::table9();
  PreparedRecording r = test::recorded(test::drive(4, 3), 0.7, 3);
  const std::vector<double> predicted_v = predict(cell, {}, r);
  const PredictionInterval before = prediction_interval(cell, {}, r, predicted_v, {});
  plant::Random random(5);
  double spell = 0;
  std::vector<double>& voltage_v = r.voltage_v.edit();
  for (std::size_t k = 0; k < r.size(); ++k) {
    if (k % 20 == 0) spell = random.normal();
    voltage_v[k] = predicted_v[k] + times * spell * before.sigma_v[k];
  }
  return prediction_interval(cell, {}, r, predicted_v, {}).coverage;
}

TEST(PredictionInterval, Contains95PercentOfReadingsThatAreAsUncertainAsItStates) {
  EXPECT_NEAR(of_error(1).share(), nominal_coverage, 0.02);
  EXPECT_NEAR(of_error(3).share(), std::erf(half_width_sigmas / 3 / std::sqrt(2)), 0.05);
}

TEST(PredictionInterval, IsThatOfTheMechanismsAndNeedsNoVoltage) {
  const model::CellParameters<> cell = test::table9();
  PreparedRecording r = test::recorded(test::drive(1, 3), 0.7, 3, [](auto...) { return 0.03; });
  MechanismSetting offset = model::default_setting(model::mechanism_index_of<model::VoltageOffset>, cell);
  offset.value[0] = 0.03;
  EXPECT_GT(prediction_interval(cell, {offset}, r, predict(cell, {offset}, r), {}).coverage.share(), 0.9);
  EXPECT_LT(prediction_interval(cell, {}, r, predict(cell, {}, r), {}).coverage.share(), 0.5);
  r.voltage_v = std::vector(r.size(), std::nan(""));
  const PredictionInterval unmeasured = prediction_interval(cell, {}, r, predict(cell, {}, r), {});
  EXPECT_EQ(unmeasured.coverage.readings(), 0U);
  for (const double v : unmeasured.sigma_v) ASSERT_GT(v, 0.001);
}

}  // namespace
}  // namespace bms::diagnosis
