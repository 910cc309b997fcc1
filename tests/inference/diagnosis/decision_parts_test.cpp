// Parts of the decision, each by itself.
#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "diagnosis/block_covariance.hpp"
#include "diagnosis/effect_gain.hpp"
#include "diagnosis/law_evidence.hpp"
#include "diagnosis/prepare.hpp"
#include "diagnosis/profile.hpp"
#include "diagnosis/selection.hpp"
#include "diagnosis/thresholds.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr std::size_t growth = model::mechanism_index_of<model::ResistanceGrowth>,
                      voltage_offset = model::mechanism_index_of<model::VoltageOffset>;
constexpr double r0_ohm = 0.0133;  // of the plant's cell

/// More of R0, and a relaxation that no fit here has.
std::function<double(std::size_t, double, double)> more_resistance(double share, double relaxing_ohm = 0) {
  return [=, slow_v = 0.0](std::size_t, double current_a, double) mutable {
    slow_v += (relaxing_ohm * current_a - slow_v) / 40;
    return slow_v + share * r0_ohm * current_a;
  };
}

LikelihoodModel likelihood_of(const std::function<double(std::size_t, double, double)>& add_v) {
  model::CellParameters<> cell = test::table9();
  cell.tolerance.resistance_fraction = 0.001;  // otherwise it is as wide as what is looked for
  return likelihood_model_of(cell, {}, {test::recorded(test::drive(1, 301), 0.7, 301, add_v)});
}

HypothesisFit fit_of_growth(const LikelihoodModel& likelihood) {
  return likelihood.fit(with(likelihood.base(), growth, likelihood.cell()));
}

const MechanismSetting& growth_in(const HypothesisFit& f) { return *f.hypothesis.find(growth); }

TEST(LeastOfThoseThatGo, IsTheFirstOfEqualsAndNoneIfAllMayStay) {
  const auto weight = [](std::size_t m) { return m == 3 ? std::nullopt : std::optional<int>(m == 5 ? 1 : 0); };
  EXPECT_EQ(weakest_removable({3, 5, 7, 9}, weight), 7U);
  EXPECT_EQ(weakest_removable({3, 5}, weight), 5U);
  EXPECT_EQ(weakest_removable({3}, weight), no_mechanism);
}

TEST(Scope, KeepsWhatIsCertainInMostOfTheRecording) {
  constexpr std::size_t by_temperature = model::mechanism_index_of<model::TemperatureResistance>;
  const auto scope = [](double cold_share) {
    PreparedRecording r = test::recorded(test::drive(0.5, 302), 0.7, 302);
    r.temperature_c.edit().assign(r.size(), 25);
    const auto cold = static_cast<std::ptrdiff_t>(cold_share * static_cast<double>(r.size()));
    std::fill_n(r.temperature_c.edit().begin(), cold, 5.0);
    return scope_of(likelihood_model_of(test::table9(), {}, {r}));
  };
  EXPECT_THAT(scope(0.4).expected, ElementsAre(by_temperature));
  EXPECT_THAT(scope(0.4).kept, IsEmpty());
  EXPECT_THAT(scope(0.6).kept, ElementsAre(by_temperature));
}

TEST(AnotherLawExplainsMore, ByNoMoreThanATie) {
  const double tie = thresholds.decision.tie;
  const auto doubted = [&](double outside_catalogue, double remaining) {
    return another_law_explains_more({{"slow", "time", 90, 0}, {"voltage", "time", 80, outside_catalogue}}, 60,
                                     remaining);
  };
  EXPECT_TRUE(doubted(50.5 - tie, 10)) << "the causes explain 60 and leave 10";
  EXPECT_FALSE(doubted(49.5 - tie, 10));
  EXPECT_FALSE(doubted(70, 0)) << "nothing is left";
}

/// What is removed depends on the gain over how much wider the error of the model makes the variance.
TEST(WithoutUncertain, AGainIsWorthLessWhereTheErrorOfTheModelIsLarge) {
  LikelihoodModel likelihood = likelihood_of(more_resistance(0.1, 0.004));
  const Progress progress;
  const Stopped stopped;
  Search search(likelihood, progress, stopped);
  const HypothesisFit control = likelihood.fit(likelihood.base());
  Survivors found{fit_of_growth(likelihood), {}, {}, {}};
  const double was = growth_in(found.best).deviation[0];
  found.best.hypothesis.settings.back().value[0] = 2 * was;
  HypothesisFit wide = found.best;
  include_model_error(likelihood, wide);
  const double times = std::pow(growth_in(wide).deviation[0] / was, 2);
  ASSERT_GT(times, 2) << "the test is of no use: the model has no error";
  const double needed = std::pow(thresholds.decision.own_sigmas, 2) * times;
  const Scope scope = scope_of(likelihood);
  found.gains[growth] = 1.05 * needed;
  EXPECT_THAT(without_uncertain(search, likelihood, control, scope, found).best.hypothesis.added(),
              ElementsAre(growth));
  found.gains[growth] = 0.95 * needed;
  EXPECT_THAT(without_uncertain(search, likelihood, control, scope, found).best.hypothesis.added(), IsEmpty());
}

TEST(Profiled, AFitThatIsTooSureHasTheWidthOfTheLikelihood) {
  const LikelihoodModel likelihood = likelihood_of(more_resistance(0.1));
  const HypothesisFit right = profiled(likelihood, fit_of_growth(likelihood));  // nothing better is near
  HypothesisFit sure = right;
  sure.hypothesis.settings.back().deviation[0] /= 3;
  sure.covariance /= 9;
  const HypothesisFit f = profiled(likelihood, sure);
  EXPECT_NEAR(growth_in(f).value[0], growth_in(right).value[0], 0.5 * growth_in(right).deviation[0]);
  const double times = growth_in(f).deviation[0] / growth_in(right).deviation[0];
  EXPECT_GT(times, 0.9);
  EXPECT_LT(times, 1.4) << "no wider than it looks: four of the deviations that it was given";
  EXPECT_NEAR(f.covariance(0, 0) / std::pow(growth_in(f).deviation[0], 2), 1, 1e-9);
}

TEST(Profiled, LooksForABetterFitFromSomeDistance) {
  const LikelihoodModel likelihood = likelihood_of(more_resistance(0.1));
  const HypothesisFit right = fit_of_growth(likelihood);
  HypothesisFit off = right;
  off.hypothesis.settings.back().value[0] += 20 * growth_in(right).deviation[0];
  off.residual = likelihood.residual(off.hypothesis, off.calibration);
  off.cost = off.residual.squaredNorm() + off.calibration.squaredNorm();
  ASSERT_GT(off.cost, right.cost + 100);
  const HypothesisFit f = profiled(likelihood, off);
  EXPECT_LT(f.cost, right.cost + 0.1);
  EXPECT_NEAR(growth_in(f).value[0], growth_in(right).value[0], 0.5 * growth_in(right).deviation[0]);
}

/// What an effect of known size would gain in a healthy recording.
double expected_gain(std::size_t mechanism, double size) {
  LikelihoodModel likelihood = likelihood_model_of(test::table9(), {}, {test::recorded(test::drive(1, 303), 0.7, 303)});
  const Progress progress;
  const Stopped stopped;
  Search search(likelihood, progress, stopped);
  const HypothesisFit control = search.with_own_noise(likelihood.fit(likelihood.base()));
  MechanismSetting s = model::default_setting(mechanism, likelihood.cell());
  s.value[0] = size;
  return EffectGain(likelihood, search.nominal_noise(), control).of(s);
}

/// What a mechanism gains in the same recording with an effect.
double gain_in(std::size_t mechanism, const std::function<double(std::size_t, double, double)>& add_v) {
  LikelihoodModel likelihood =
      likelihood_model_of(test::table9(), {}, {test::recorded(test::drive(1, 303), 0.7, 303, add_v)});
  const Progress progress;
  const Stopped stopped;
  Search search(likelihood, progress, stopped);
  const HypothesisFit control = search.with_own_noise(likelihood.fit(likelihood.base()));
  return search.gain(control, search.with_own_noise(likelihood.fit(
                                  with(likelihood.base(), mechanism, likelihood.cell()), control.calibration)));
}

/// The base parameters follow.
TEST(EffectGain, IsWhatARecordingWithTheEffectGains) {
  for (const double share : {0.1, 0.5})
    EXPECT_NEAR(expected_gain(growth, share) / gain_in(growth, more_resistance(share)), 1, 0.05) << share;
  // with a size that exceeds the noise by far, the noise that is left lets them follow further
  for (const double offset_v : {0.01, 0.03, 0.05})
    EXPECT_NEAR(expected_gain(voltage_offset, offset_v) / gain_in(voltage_offset, [=](auto...) { return offset_v; }), 1,
                0.15)
        << offset_v;
}

/// With the nominal noise it would be nearly the square.
TEST(EffectGain, FarAboveTheNoiseIsLessThanTheSquareOfTheSize) {
  EXPECT_LT(expected_gain(voltage_offset, 0.1), 0.5 * 100 * expected_gain(voltage_offset, 0.01));
}

/// A sensor that reads exactly 0 does not measure: its zero has no error there.
TEST(LikelihoodModel, TheErrorOfTheZeroLeavesAReadingOfExactlyZero) {
  const auto change_v = [](double read_a) {
    PreparedRecording r = test::recorded(std::vector<double>(1'800, 0.0), 0.95, 304);
    r.current_a.edit().assign(r.size(), read_a);
    const LikelihoodModel likelihood(test::table9(), {}, {r}, NoiseModel{});
    Eigen::VectorXd u = likelihood.unchanged();
    likelihood.calibration().each_lever(0, r.time_s.back(), 0.95, [&](std::size_t lever, std::size_t unknown, double) {
      if (lever == Lever::zero) u[static_cast<Eigen::Index>(unknown)] = 3;
    });
    const auto last_v = [&](const Eigen::VectorXd& at) { return likelihood.voltage(likelihood.base(), at, 0).back(); };
    return std::abs(last_v(u) - last_v(likelihood.unchanged()));
  };
  EXPECT_EQ(change_v(0), 0);
  EXPECT_GT(change_v(1e-9), 1e-6);
}

/// A covariance that is not one, by as little as rounding, is as wide as one next to it.
TEST(BlockCovariance, WithoutAFactorItContainsTheErrorOfTheModel) {
  const LikelihoodModel likelihood = likelihood_of(more_resistance(0.1, 0.004));
  const HypothesisFit fit =
      likelihood.fit(with(with(likelihood.base(), growth, likelihood.cell()), voltage_offset, likelihood.cell()));
  const auto wide = [&](double correlation) {
    HypothesisFit f = fit;
    f.covariance(0, 1) = f.covariance(1, 0) = correlation * std::sqrt(f.covariance(0, 0) * f.covariance(1, 1));
    return block_covariance(likelihood, f);
  };
  const Eigen::MatrixXd below = wide(1 - 1e-10), above = wide(1 + 1e-10);
  for (Eigen::Index j = 0; j < 2; ++j) {
    EXPECT_GT(above(j, j), 4 * fit.covariance(j, j));
    EXPECT_NEAR(above(j, j) / below(j, j), 1, 0.01);
  }
  HypothesisFit broken = fit;
  broken.covariance(1, 1) = -broken.covariance(1, 1);
  const Eigen::MatrixXd positive = block_covariance(likelihood, broken);
  EXPECT_GT(positive(0, 0), 4 * fit.covariance(0, 0));
  EXPECT_GT(positive(1, 1), 0);
}

}  // namespace
}  // namespace bms::diagnosis
