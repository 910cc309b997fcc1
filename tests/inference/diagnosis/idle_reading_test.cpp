// What the current sensor reads in rests: an error of the sensor, or nothing that can be said.
#include "diagnosis/idle_reading.hpp"

#include <cmath>
#include <functional>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/recording_facts.hpp"
#include "diagnosis/selection.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

constexpr std::size_t load_rows = 300, rest_rows = 300;

/// Spells of load at load_a with rests between them; read_a(row of the rest, rest): what is added to the reading there.
PreparedRecording spells(double load_a, std::size_t rests,
                         const std::function<double(std::size_t, std::size_t)>& read_a, double noise_share = 1) {
  std::vector<double> current_a;
  for (std::size_t n = 0; n < rests; ++n) {
    current_a.insert(current_a.end(), load_rows, load_a);
    current_a.insert(current_a.end(), rest_rows, 0.0);
  }
  PreparedRecording r = test::recorded(current_a, 0.7, 41);
  for (std::size_t k = 0; k < r.size(); ++k) {
    const std::size_t in_spell = k % (load_rows + rest_rows), rest = k / (load_rows + rest_rows);
    if (in_spell < load_rows) continue;
    double& a = r.current_a.edit()[k];
    a = noise_share * a + read_a(in_spell - load_rows, rest);
  }
  return r;
}

std::size_t checks_of(PreparedRecording r) {
  add_idle_checks(r, test::table9());
  return r.checks.size();
}

TEST(IdleReading, OfAChargingCurrentAfterEachDischargeIsAnErrorOfTheSensor) {
  PreparedRecording r = spells(-6, 4, [](std::size_t, std::size_t) { return 0.03; });
  for (std::size_t k = 0; k < r.size(); ++k) {
    if (k % (load_rows + rest_rows) < load_rows) r.current_a.edit()[k] += 0.03;
  }
  PreparedRecording checked = r;
  add_idle_checks(checked, test::table9());
  ASSERT_EQ(checked.checks.size(), 4U);
  EXPECT_NEAR(checked.checks[2].read, 0.03, 0.003);
  EXPECT_EQ(checked.checks[2].reference, 0);
  const auto fitted_offset = [](const PreparedRecording& record) {
    const LikelihoodModel likelihood(test::table9(), {}, {record}, NoiseModel{});
    const std::size_t m = model::mechanism_index("current_offset");
    const HypothesisFit f = likelihood.fit(with(likelihood.base(), m, likelihood.cell()));
    return std::pair(f.hypothesis.settings.back().value[0], std::sqrt(f.covariance(0, 0)));
  };
  EXPECT_NEAR(fitted_offset(checked).first, 0.03, 2 * fitted_offset(checked).second);
  EXPECT_LT(fitted_offset(checked).second, 0.5 * fitted_offset(r).second);
  const auto is_certain = [](const PreparedRecording& record) {
    const LikelihoodModel likelihood(test::table9(), {}, {record}, NoiseModel{});
    return scope_of(likelihood).expected.contains(model::mechanism_index("current_offset"));
  };
  EXPECT_TRUE(is_certain(checked));
  EXPECT_FALSE(recording_facts(test::table9(), std::vector{checked}).trusted_instruments)
      << "a leakage next to the offset cannot be distinguished from it";
  EXPECT_FALSE(is_certain(r)) << "without the rests";
}

TEST(IdleReading, SaysNothingWhereACurrentMayFlow) {
  const auto steady = [](double a) { return [a](std::size_t, std::size_t) { return a; }; };
  EXPECT_EQ(checks_of(spells(-6, 4, steady(-0.03))), 0U) << "a device that is always on";
  EXPECT_EQ(checks_of(spells(6, 4, steady(0.03))), 0U) << "the end of a charge";
  EXPECT_EQ(checks_of(spells(-6, 1, steady(0.03))), 0U) << "one rest";
  EXPECT_EQ(checks_of(spells(-6, 4, [](std::size_t, std::size_t rest) { return rest % 2 == 0 ? 0.01 : 0.05; })), 0U)
      << "differs from rest to rest";
  EXPECT_EQ(checks_of(spells(-6, 4, steady(0.2))), 0U) << "more than a rest's current";
}

TEST(IdleReading, LeavesOutZerosOfAnInstrumentThatDoesNotMeasure) {
  EXPECT_EQ(checks_of(spells(
                -6, 4, [](std::size_t, std::size_t) { return 0.0; }, 0)),
            0U);
  PreparedRecording r = spells(
      -6, 4, [](std::size_t row, std::size_t) { return row < 150 ? 0.02 + 0.001 * static_cast<double>(row % 3) : 0; },
      0);
  add_idle_checks(r, test::table9());
  ASSERT_EQ(r.checks.size(), 4U);
  EXPECT_NEAR(r.checks[0].read, 0.021, 1e-4);
}

}  // namespace
}  // namespace bms::diagnosis
