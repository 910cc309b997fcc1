// Which experiment is proposed, and whether its recording decides.
#include "diagnosis/next_experiment.hpp"

#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>

#include "diagnosis/reference.hpp"
#include "diagnosis/texts.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

constexpr std::size_t index_of(std::string_view id) { return model::mechanism_index(id); }

MechanismSetting setting(std::string_view id, std::initializer_list<double> values) {
  MechanismSetting s = model::default_setting(index_of(id), test::table9());
  std::copy(values.begin(), values.end(), s.value.begin());
  return s;
}

/// A diagnosis that has found the first of a set and cannot distinguish the others from it.
Diagnosis undecided(const std::vector<MechanismSetting>& set, double deviation) {
  const LikelihoodModel likelihood(test::table9(), {}, {test::recorded(test::drive(0.1, 1), 0.7, 1)}, NoiseModel{});
  Diagnosis d;
  d.verdict = Verdict::ambiguous;
  const auto fitted = [&](const MechanismSetting& s) {
    Fitted f{with(likelihood.base(), s), {}};
    const auto n = static_cast<Eigen::Index>(f.hypothesis.sought().size());
    f.covariance = Eigen::MatrixXd::Identity(n, n) * deviation * deviation;
    return f;
  };
  d.extended = fitted(set.front()).hypothesis;
  d.covariance = fitted(set.front()).covariance;
  Finding f;
  f.setting = set.front();
  for (std::size_t k = 1; k < set.size(); ++k) {
    f.equivalent_to.push_back(set[k].index);
    f.rivals.push_back(fitted(set[k]));
  }
  d.findings = {f};
  return d;
}

TEST(NextExperiment, AnOpenContactorSeparatesLeakageFromAnOffset) {
  const auto next = next_experiment(
      test::table9(), undecided({setting("leakage", {0.05}), setting("current_offset", {-0.05})}, 0.003), false);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->profile, "zero_current") << "the shortest in which nothing flows";
  EXPECT_THAT(next->separates, testing::ElementsAre(index_of("leakage"), index_of("current_offset")));
  EXPECT_GE(next->gain, 40);
  EXPECT_THAT(why(*next), testing::StartsWith("To distinguish "));
}

TEST(NextExperiment, EveryUsualSetHasACourseThatSeparatesIt) {
  const std::vector<std::vector<MechanismSetting>> sets = {
      {setting("voltage_offset", {0.01}), setting("voltage_gain", {0.003})},
      {setting("current_gain", {0.03}), setting("capacity_change", {0.03})},
      {setting("resistance_growth", {0.3}), setting("contact_step", {0.004})},
      {setting("resistance_growth", {0.3}), setting("fast_polarisation", {0.004, 0.6})},
      {setting("self_heating", {4, 900, 30'000}), setting("temperature_resistance", {20'000})},
      {setting("ocv_hysteresis", {0.01}), setting("slow_polarisation", {0.004, 1'300})},
      {setting("initial_soc", {0.04}), setting("capacity_change", {0.08}), setting("ocv_shape", {0.03, 0.03})},
      {setting("coulombic_loss", {0.01}), setting("leakage", {0.02})},
  };
  for (const auto& set : sets) {
    const auto next = next_experiment(test::table9(), undecided(set, 1e-4), true);
    const std::string_view first = model::catalogue[set.front().index].id;
    ASSERT_TRUE(next) << first;
    EXPECT_EQ(next->separates.size(), set.size()) << first << " by " << next->profile;
  }
}

TEST(NextExperiment, IsLaidOutForTheSmallestPossibleCapacity) {
  const auto next = next_experiment(
      test::table9(), undecided({setting("capacity_change", {0.25}), setting("ocv_shape", {0.05, 0.05})}, 1e-3), false);
  ASSERT_TRUE(next);
  EXPECT_LE(next->capacity_ah, 4.5);
  EXPECT_THAT(command(*next), testing::HasSubstr("--capacity-ah 4.5"));
}

TEST(NextExperiment, WhatHasBeenCarriedOutIsNotProposedAgain) {
  const Diagnosis d = undecided({setting("leakage", {0.05}), setting("current_offset", {-0.05})}, 0.003);
  const auto first = next_experiment(test::table9(), d, false);
  ASSERT_TRUE(first);
  const auto second = next_experiment(test::table9(), d, false, {first->profile});
  ASSERT_TRUE(second);
  EXPECT_NE(second->profile, first->profile);
  std::vector<std::string> all;
  for (const experiments::Experiment& e : experiments::experiments()) all.emplace_back(e.name);
  EXPECT_FALSE(next_experiment(test::table9(), d, false, all)) << "nothing more can be learned";
  const std::string text = nothing_more_text(d);
  EXPECT_THAT(text, testing::StartsWith("No other experiment would distinguish a leakage from an offset of the current "
                                        "sensor: nothing more can be learned"));
  EXPECT_THAT(text, testing::HasSubstr("Zero the current sensor")) << "what to do instead";
}

TEST(NextExperiment, AFindingWithoutRivalsNeedsNoExperiment) {
  Diagnosis d = undecided({setting("leakage", {0.05})}, 0.003);
  EXPECT_FALSE(next_experiment(test::table9(), d, true));
}

/// An hour of driving, then half an hour with the contactor open.
PreparedRecording with_open_contactor(double offset_a) {
  std::vector<double> current_a = test::drive(2, 31);
  for (std::size_t k = 3'600; k < 5'400; ++k) current_a[k] = 0;
  PreparedRecording r = test::recorded(current_a, 0.7, 31);
  std::vector<double> reference_a(r.size(), std::nan(""));
  for (std::size_t k = 0; k < r.size(); ++k) r.current_a.edit()[k] += offset_a;
  for (std::size_t k = 3'600; k < 5'400; ++k) reference_a[k] = 0;
  average_references(r, reference_a, {}, test::table9());
  return r;
}

TEST(Reference, TheReadingOfAnOpenContactorDecidesBetweenLeakageAndAnOffset) {
  const double offset_a = 0.06;
  const PreparedRecording r = with_open_contactor(offset_a);
  ASSERT_GE(r.checks.size(), 5U);
  const auto cost = [](const PreparedRecording& record, const char* id) {
    const LikelihoodModel likelihood(test::table9(), {}, {record}, NoiseModel{});
    return likelihood.fit(with(likelihood.base(), index_of(id), likelihood.cell())).cost;
  };
  PreparedRecording without = r;
  without.checks.clear();
  EXPECT_LT(std::abs(cost(without, "leakage") - cost(without, "current_offset")), 7)
      << "the voltage alone does not decide";
  EXPECT_GT(cost(r, "leakage") - cost(r, "current_offset"), 30);
}

TEST(Reference, VoltageChecksDistinguishAnOffsetFromAGainAndAContact) {
  PreparedRecording r = test::recorded(test::drive(1, 32), 0.7, 32, [](std::size_t, double, double) { return 0.01; });
  std::vector<double> reference_a(r.size(), std::nan("")), reference_v(r.size(), std::nan(""));
  for (std::size_t k = 600; k < 1'800; ++k) {
    reference_a[k] = 0;
    reference_v[k] = k / 120 % 2 == 0 ? 2.5 : 3.6;
    r.voltage_v.edit()[k] = reference_v[k] + 0.01;
  }
  average_references(r, reference_a, reference_v, test::table9());
  EXPECT_TRUE(std::isnan(r.voltage_v[700])) << "a source's voltage is not the cell's";
  const LikelihoodModel likelihood(test::table9(), {}, {r}, NoiseModel{});
  EXPECT_EQ(likelihood.used(), r.size() - 1'200 - (std::abs(r.current_a[0]) < 0.06 ? 0 : 1));
  const auto cost = [&](const char* id) {
    return likelihood.fit(with(likelihood.base(), index_of(id), likelihood.cell())).cost;
  };
  EXPECT_GT(cost("voltage_gain") - cost("voltage_offset"), 30);
  EXPECT_GT(cost("contact_step") - cost("voltage_offset"), 30);
}

/// Readings behind leads, with trusted instruments at the cell whose error wanders by more than they promise.
TEST(Reference, AMeterThatIsNotQuiteSteadyDoesNotHideACause) {
  const std::vector<double> current_a = test::drive(0.4, 34);
  PreparedRecording r = test::recorded(current_a, 0.7, 34, [](std::size_t, double a, double) { return 0.02 * a; });
  const std::vector<double> cell_v = test::recorded(current_a, 0.7, 34).voltage_v.copy();
  std::vector<double> reference_a, reference_v;
  for (std::size_t k = 0; k < r.size(); ++k) {
    const double wander = std::sin(static_cast<double>(k) / 150);
    reference_a.push_back(current_a[k] * 1.007 + 0.003 * wander);
    reference_v.push_back(cell_v[k] + 0.008 * wander);
  }
  const auto verdict = [&](bool current, bool voltage) {
    PreparedRecording with = r;
    const std::vector<double> none;
    average_references(with, current ? reference_a : none, voltage ? reference_v : none, test::table9());
    const Diagnosis d = diagnose(test::table9(), {}, {with});
    const bool resistance = std::any_of(d.findings.begin(), d.findings.end(), [](const Finding& f) {
      return f.setting.index == index_of("resistance_growth") || f.setting.index == index_of("contact_step");
    });
    return resistance ? d.verdict : Verdict::unknown;
  };
  EXPECT_NE(verdict(false, true), Verdict::unknown);
  EXPECT_NE(verdict(true, true), Verdict::unknown);
}

/// Of all mechanisms that a check depends on.
TEST(Reference, DerivativesOfChecksEqualFiniteDifferences) {
  PreparedRecording r = with_open_contactor(0.1);
  r.checks.push_back({Check::Channel::voltage, 4'000, 2, 3.31, 3.3, 0.001, 0});
  r.checks.push_back({Check::Channel::voltage, 4'100, -2, 3.21, 3.2, 0.001, 0});
  const LikelihoodModel likelihood(test::table9(), {}, {r}, NoiseModel{});
  const auto checks = static_cast<Eigen::Index>(r.checks.size());
  const Eigen::VectorXd u = Eigen::VectorXd::Constant(static_cast<Eigen::Index>(likelihood.calibration().size()), 0.2);
  for (const char* id : {"current_offset", "current_gain", "voltage_offset", "voltage_gain", "contact_step"}) {
    Hypothesis h = with(likelihood.base(), index_of(id), likelihood.cell());
    h.settings.back().value[0] = 0.01;
    const Eigen::VectorXd exact = likelihood.derivatives(h, u, std::vector<ParameterRef>{{0, 0}}).col(0).tail(checks);
    Hypothesis more = h, less = h;
    more.settings.back().value[0] += 1e-6;
    less.settings.back().value[0] -= 1e-6;
    const Eigen::VectorXd difference =
        (likelihood.residual(less, u) - likelihood.residual(more, u)).tail(checks) / 2e-6;
    EXPECT_GT(exact.norm(), 0.1) << id;
    EXPECT_LT((difference - exact).norm(), 1e-4 * exact.norm()) << id;
  }
}

TEST(LikelihoodModel, ALaterRecordingKeepsTheContactAndNotTheWrongStart) {
  const PreparedRecording r = test::recorded(test::drive(0.5, 33), 0.7, 33);
  const LikelihoodModel likelihood(test::table9(), {}, {r, r}, NoiseModel{});
  const Eigen::VectorXd none = likelihood.unchanged();
  const std::vector<double> plain = likelihood.voltage(likelihood.base(), none, 1);
  EXPECT_EQ(likelihood.voltage(with(likelihood.base(), setting("initial_soc", {0.1})), none, 1), plain);
  const std::vector<double> contact =
      likelihood.voltage(with(likelihood.base(), setting("contact_step", {0.005, 1'000})), none, 1);
  EXPECT_NEAR(contact[500] - plain[500], 0.005 * r.current_a[500], 1e-9)
      << "before the moment at which the first one got it";
}

}  // namespace
}  // namespace bms::diagnosis
