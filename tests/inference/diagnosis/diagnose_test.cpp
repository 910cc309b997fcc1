// The whole diagnosis of recordings of the plant's cell, whose equations are not those of the catalogue.
#include "diagnosis/diagnose.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include <gmock/gmock.h>

#include "diagnosis/model_tolerance.hpp"
#include "diagnosis/prepare.hpp"
#include "diagnosis/screen.hpp"
#include "diagnosis/selection.hpp"
#include "diagnosis/texts.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::Field;

std::vector<std::string> ids_of(const Diagnosis& d) {
  std::vector<std::string> ids;
  for (const Finding& f : d.findings) ids.emplace_back(model::catalogue[f.setting.index].id);
  return ids;
}

TEST(Diagnose, AHealthyCellHasNoMismatchAndLimits) {
  const Diagnosis d = diagnose(test::table9(), {}, {test::recorded(test::drive(2, 11), 0.7, 11)});
  EXPECT_EQ(d.verdict, Verdict::no_mismatch);
  EXPECT_THAT(ids_of(d), ElementsAre());
  EXPECT_THAT(d.limits, Contains(Field(&DetectionLimit::mechanism, model::mechanism_index("ocv_hysteresis"))));
  EXPECT_THAT(d.not_testable,
              Contains(Field(&NotTestable::mechanism, model::mechanism_index("temperature_resistance"))))
      << "no temperature was recorded";
}

TEST(Diagnose, NamesALargerResistanceAndWhereItsEffectIs) {
  const Diagnosis d = diagnose(test::table9(), {},
                               {test::recorded(test::drive(2, 12), 0.7, 12, [](std::size_t, double current_a, double) {
                                 return 0.003 * current_a;
                               })});
  EXPECT_THAT(ids_of(d), ElementsAre("resistance_growth"));
  EXPECT_NE(d.verdict, Verdict::unknown);
  EXPECT_NEAR(d.findings.front().setting.value[0], 0.003 / 0.0133, 0.04);
  ASSERT_FALSE(d.candidates.empty());
  EXPECT_DOUBLE_EQ(d.candidates.front().explained_share, d.explained_share) << "both are shares of the same error";
}

TEST(Diagnose, NamesAContactThatHasChangedAndWhen) {
  const Diagnosis d = diagnose(
      test::table9(), {}, {test::recorded(test::drive(2, 13), 0.7, 13, [](std::size_t k, double current_a, double) {
        return k >= 4'000 ? 0.002 * current_a : 0;
      })});
  ASSERT_THAT(ids_of(d), ElementsAre("contact_step"));
  EXPECT_NEAR(d.findings.front().setting.value[0], 0.002, 0.0003);
  EXPECT_NEAR(d.findings.front().setting.value[1], 4'000, 60);
}

TEST(Diagnose, VoltageOffsetAndGainAreAmbiguousForAnLfpCell) {
  const Diagnosis d =
      diagnose(test::table9(), {},
               {test::recorded(test::drive(2, 14), 0.7, 14, [](std::size_t, double, double) { return 0.015; })});
  EXPECT_EQ(d.verdict, Verdict::ambiguous);
  ASSERT_EQ(d.findings.size(), 1U);
  std::vector<std::string> set = ids_of(d);
  for (const std::size_t e : d.findings.front().equivalent_to) set.emplace_back(model::catalogue[e].id);
  EXPECT_THAT(set, testing::IsSupersetOf({"voltage_offset", "voltage_gain"}));
}

/// Half gap times the distance to the discharge branch, with a branch position that moves with the charge and stays
/// within -1 .. 1, and one that relaxes exponentially.
std::function<double(std::size_t, double, double)> branch_v(double half_gap_v, double per_soc, bool play) {
  return [=, h = 1.0](std::size_t, double current_a, double) mutable {
    const double moved = per_soc * current_a / (3'600 * 6);
    h = play ? std::clamp(h + moved, -1.0, 1.0) : h + std::abs(moved) * ((current_a > 0 ? 1 : -1) - h);
    return half_gap_v * (h + 1);
  };
}

TEST(Diagnose, FindsHowTheBranchMoves) {
  model::CellParameters<> of_discharge = test::table9();
  of_discharge.ocv.lean = -1;
  for (const bool play : {true, false}) {
    const Diagnosis d =
        diagnose(of_discharge, {}, {test::recorded(test::drive(2, 22), 0.7, 22, branch_v(0.02, 40, play))});
    ASSERT_THAT(ids_of(d), Contains("ocv_hysteresis"));
    const MechanismSetting& found = *d.extended.find(model::mechanism_index("ocv_hysteresis"));
    EXPECT_EQ(found.value[4], play ? 1 : 0);
    EXPECT_NEAR(found.value[0], 0.02, 0.003);
    EXPECT_NEAR(found.value[2], -1, 0.2);
  }
}

TEST(Diagnose, WhatNoMechanismExplainsIsUnknown) {
  // a converter's nonlinearity: a wave over the voltage
  const Diagnosis d = diagnose(
      test::table9(), {}, {test::recorded(test::drive(2, 15), 0.7, 15, [](std::size_t, double current_a, double soc) {
        return 0.012 * std::sin(2 * 3.14159265 * (3.25 + 0.3 * (soc - 0.5) + 0.02 * current_a) / 0.05);
      })});
  EXPECT_EQ(d.verdict, Verdict::unknown);
}

TEST(Diagnose, APeriodThatTheLoadDoesNotHaveIsUnknownAndNamed) {
  const Diagnosis d =
      diagnose(test::table9(), {}, {test::recorded(test::drive(2, 18), 0.7, 18, [](std::size_t k, double, double) {
                 return 0.003 * std::sin(2 * 3.14159265 * static_cast<double>(k) / 173);
               })});
  EXPECT_EQ(d.verdict, Verdict::unknown);
  EXPECT_EQ(d.remaining_goes_with, "a period of its own");
}

TEST(Diagnose, BurstsOfALooseContactAreFoundWhereTheyAre) {
  const auto loose = [](std::size_t k) { return k % 400 >= 170 && k % 400 < 182; };
  const Diagnosis d = diagnose(
      test::table9(), {}, {test::recorded(test::drive(2, 19), 0.7, 19, [&](std::size_t k, double current_a, double) {
        return loose(k) ? 0.002 * current_a : 0;
      })});
  ASSERT_THAT(ids_of(d), ElementsAre("contact_intermittent"));
  EXPECT_NEAR(d.findings.front().setting.value[0], 0.002, 0.0005);
  std::size_t inside = 0, outside = 0;
  for (const model::Span& s : d.extended.bursts.front()) {
    for (auto k = static_cast<std::size_t>(s.start_s); k <= static_cast<std::size_t>(s.end_s); ++k)
      ++(loose(k) ? inside : outside);
  }
  EXPECT_GT(inside, 60U);
  EXPECT_LT(outside, inside / 3);
}

TEST(Diagnose, TheExtendedCellMovesItsTablesToFitTogetherWithTheFindings) {
  // 2 mV of the table are its own error, a third of the resistance is not
  const auto add_v = [](std::size_t, double current_a, double) { return 0.002 + 0.004 * current_a; };
  const Diagnosis d = diagnose(test::table9(), {}, {test::recorded(test::drive(2, 20), 0.7, 20, add_v)});
  ASSERT_THAT(ids_of(d), ElementsAre("resistance_growth"));
  const PreparedRecording later = test::recorded(test::drive(1, 21), 0.6, 21, add_v);
  const auto rms_v = [&](const model::CellParameters<>& cell) {
    const std::vector<double> v = predict(cell, later_recording(d.extended), later);
    double sum = 0;
    for (std::size_t k = 0; k < v.size(); ++k) sum += std::pow(v[k] - later.voltage_v[k], 2);
    return std::sqrt(sum / static_cast<double>(v.size()));
  };
  EXPECT_LT(rms_v(d.cell), 0.9 * rms_v(test::table9()));
  EXPECT_EQ(model::first_fault(d.cell).what, nullptr) << model::first_fault(d.cell).key;
}

TEST(Diagnose, WithoutInformationNothingIsTestable) {
  PreparedRecording rest = test::recorded(std::vector<double>(3'000, 0.0), 0.7, 16);
  EXPECT_EQ(diagnose(test::table9(), {}, {rest}).verdict, Verdict::not_testable);
  PreparedRecording constant = test::recorded(std::vector<double>(3'000, -3.0), 0.9, 17);
  constant.current_a.edit()[0] = -3;
  const Diagnosis d = diagnose(test::table9(), {}, {constant});
  EXPECT_EQ(d.verdict, Verdict::not_testable);
  EXPECT_EQ(d.not_testable.size(), model::mechanism_count - 1) << "all but the term of an unknown cause";
  PreparedRecording brief = test::recorded(test::drive(0.05, 18), 0.7, 18);
  EXPECT_EQ(diagnose(test::table9(), {}, {brief}).verdict, Verdict::not_testable);
}

/// An offset of the current sensor that moves the charge by several per cent: the knees of the OCV are then too far
/// away for a linear estimate to find them.
TEST(Diagnose, FindsAnOffsetThatMovesTheKneesFar) {
  PreparedRecording r = test::recorded(test::drive(4, 31), 0.9, 31);
  for (double& a : r.current_a.edit()) a += 0.2;  // 13 % of soc
  const Diagnosis d = diagnose(test::table9(), {}, {r});
  ASSERT_FALSE(d.findings.empty());
  std::vector<std::string> set = ids_of(d);
  for (const std::size_t e : d.findings.front().equivalent_to) set.emplace_back(model::catalogue[e].id);
  EXPECT_THAT(set, Contains("current_offset"));
}

TEST(Diagnose, LeakageAndCurrentOffsetExcludeEachOtherWithoutATrustedAmmeter) {
  PreparedRecording r = test::recorded(test::drive(2, 32), 0.7, 32);
  LikelihoodModel likelihood(test::table9(), {}, {r}, NoiseModel{});
  const std::size_t leakage = model::mechanism_index("leakage"), offset = model::mechanism_index("current_offset");
  const Hypothesis leaking = with(likelihood.base(), leakage, likelihood.cell());
  EXPECT_TRUE(not_testable(likelihood, leaking, offset).has_value());
  EXPECT_FALSE(not_testable(likelihood, likelihood.base(), offset).has_value());
  r.checks = {{Check::Channel::current, 900, 3, 3.01, 3, 0.002, 0}};
  const LikelihoodModel trusted(test::table9(), {}, {r}, NoiseModel{});
  EXPECT_FALSE(not_testable(trusted, leaking, offset).has_value()) << "a trusted ammeter distinguishes them";
}

/// A late channel shows at the edges alone: little of the mean square, but significant.
TEST(Diagnose, AShortEffectIsFoundTogetherWithALargePermanentOne) {
  std::vector<double> gentle = test::drive(2, 34);
  for (double& a : gentle) a *= 0.1;
  PreparedRecording r = test::recorded(gentle, 0.7, 34);
  for (std::size_t k = r.size() - 1; k > 0; --k) r.voltage_v.edit()[k] = r.voltage_v[k - 1] + 0.06;
  const Diagnosis d = diagnose(test::table9(), {}, {r});
  EXPECT_EQ(d.findings.size(), 2U);
  EXPECT_THAT(ids_of(d), Contains("channel_skew"));
}

/// A hysteresis of the cell file, which begins each recording on a branch of its own.
TEST(Diagnose, WhereARecordingBeganIsNoPropertyOfTheCell) {
  const model::CellParameters<> cell = test::table9();
  MechanismSetting truth = model::default_setting(model::mechanism_index("ocv_hysteresis"), cell);
  truth.value = {0.02, 20, 0, -0.8, 0};
  const PreparedRecording plain = test::recorded(test::drive(2, 41), 0.7, 41);
  const auto measured = [&](const MechanismSetting& s) {
    PreparedRecording r = plain;
    const std::vector<double> with = predict(cell, {s}, plain), without = predict(cell, {}, plain);
    for (std::size_t k = 0; k < r.size(); ++k) r.voltage_v.edit()[k] += with[k] - without[k];
    return r;
  };
  MechanismSetting file = truth;
  file.value[3] = 1;
  EXPECT_EQ(diagnose(cell, {file}, {measured(truth)}).verdict, Verdict::no_mismatch);
  const Hypothesis found{{truth}, 0, {}};
  EXPECT_EQ(later_recording(found).front().value[3], 0) << "a later recording begins elsewhere";
  EXPECT_EQ(later_recording(found, 0.97).front().value[3], 1) << "it was charged last";
  EXPECT_EQ(later_recording(found, 0.03).front().value[3], -1) << "discharged last";
  EXPECT_EQ(later_recording({{truth}, 1, {}}).front().value[3], -0.8) << "a file that has it keeps it";
}

/// Rows far apart: R0 and R1 are identified as 13 +- 60 mohm each, their sum to a few per cent.
TEST(Diagnose, TolerancesOfR0AndR1DoNotHideAContact) {
  model::CellParameters<> cell = test::table9();
  for (std::size_t k = 0; k < cell.rc.soc.size; ++k) {
    cell.rc.r0_std_ohm.push_back(5 * cell.rc.r0_ohm[k]);
    cell.rc.r1_std_ohm.push_back(5 * cell.rc.r1_ohm[k]);
  }
  EXPECT_EQ(diagnose(cell, {}, {test::recorded(test::drive(0.7, 42), 0.7, 42)}).verdict, Verdict::no_mismatch);
  const auto contact = [](std::size_t, double current_a, double) { return 0.12 * current_a; };
  const Diagnosis d = diagnose(cell, {}, {test::recorded(test::drive(0.7, 42), 0.7, 42, contact)});
  ASSERT_TRUE(names(d.verdict)) << name_of(d.verdict);
  EXPECT_THAT(ids_of(d), ElementsAre("resistance_growth"));
  EXPECT_NEAR(d.findings.front().setting.value[0], 0.12 / 0.0133, 1.5);
  EXPECT_EQ(d.findings.front().at_bound[0], 0);
}

TEST(Diagnose, AGrossErrorIsNeverHealthy) {
  model::CellParameters<> cell = test::table9();
  cell.tolerance = {0.4, 0.05, 0.02, 0.4};
  const Diagnosis d = diagnose(
      cell, {}, {test::recorded(test::drive(2, 43), 0.7, 43, [](std::size_t, double, double) { return 0.2; })});
  EXPECT_NE(d.verdict, Verdict::no_mismatch);
}

/// What the elimination leaves of these mechanisms at these first strengths. expected: certain before any voltage is
/// looked at. steps: of their fit before.
Survivors left_of(const PreparedRecording& r, const std::vector<std::pair<const char*, double>>& mechanisms,
                  const std::set<std::size_t>& expected, int steps) {
  LikelihoodModel likelihood = likelihood_model_of(test::table9(), {}, {r});
  const Progress progress;
  const Stopped stopped;
  Search search(likelihood, progress, stopped);
  const HypothesisFit control = search.with_own_noise(likelihood.fit(likelihood.base()));
  Hypothesis all = likelihood.base();
  for (const auto& [id, strength] : mechanisms) {
    all = with(all, model::mechanism_index(id), likelihood.cell());
    all.settings.back().value[0] = strength;
  }
  Scope scope = scope_of(likelihood);
  scope.expected = scope.kept = expected;
  return eliminate(search, likelihood, control, likelihood.fit(all, control.calibration, steps), scope);
}

/// What is left of an offset and a gain of the voltage that cancel on the flat part of the curve.
Survivors left_of_two_that_cancel(const std::set<std::size_t>& expected) {
  return left_of(test::recorded(test::drive(2, 44), 0.7, 44, [](std::size_t, double, double) { return 0.015; }),
                 {{"voltage_offset", 0.1}, {"voltage_gain", -0.027}}, expected, 1);
}

/// The recording knows their sum alone.
TEST(Diagnose, OfTwoThatCancelOneIsNamedWithTheOtherAsItsRival) {
  const Survivors survivors = left_of_two_that_cancel({});
  const std::vector<std::size_t> left = survivors.best.hypothesis.added();
  ASSERT_EQ(left.size(), 1U);
  const std::size_t other = left.front() == model::mechanism_index("voltage_offset")
                                ? model::mechanism_index("voltage_gain")
                                : model::mechanism_index("voltage_offset");
  ASSERT_TRUE(survivors.rivals.contains(left.front()));
  EXPECT_THAT(survivors.rivals.at(left.front()),
              Contains(testing::Truly([&](const HypothesisFit& f) { return f.hypothesis.find(other) != nullptr; })));
}

TEST(Diagnose, OfTwoThatCancelTheOneThatIsCertainStays) {
  for (const char* id : {"voltage_offset", "voltage_gain"}) {
    const std::size_t certain = model::mechanism_index(id);
    EXPECT_THAT(left_of_two_that_cancel({certain}).best.hypothesis.added(), ElementsAre(certain));
  }
}

/// Another set explains more, and lacks it.
TEST(Diagnose, WhatIsCertainIsNotGivenUpForAnotherSet) {
  const PreparedRecording r = test::recorded(test::drive(2, 12), 0.7, 12,
                                             [](std::size_t, double current_a, double) { return 0.003 * current_a; });
  const std::size_t certain = model::mechanism_index("current_gain");
  EXPECT_THAT(left_of(r, {{"current_gain", 0.1}}, {certain}, 5).best.hypothesis.added(), ElementsAre(certain));
  EXPECT_THAT(left_of(r, {{"current_gain", 0.1}}, {}, 5).best.hypothesis.added(),
              ElementsAre(model::mechanism_index("resistance_growth")));
}

TEST(Diagnose, WhenStoppedItNamesNothingAndSaysWhatWasTried) {
  const PreparedRecording r = test::recorded(test::drive(2, 12), 0.7, 12,
                                             [](std::size_t, double current_a, double) { return 0.003 * current_a; });
  int asked = 0;
  const auto after = [&](int fits) {
    asked = 0;
    Options options;
    options.stopped = [&asked, fits] { return ++asked > fits; };
    Diagnosis d = diagnose(test::table9(), {}, {r}, options);
    describe(d, test::table9(), {r});
    return d;
  };
  const Diagnosis nothing = after(0), some = after(6);
  for (const Diagnosis* d : {&nothing, &some}) {
    EXPECT_TRUE(d->interrupted);
    EXPECT_EQ(d->verdict, Verdict::unfinished);
    EXPECT_TRUE(d->findings.empty()) << "what was not tried may explain as much";
    EXPECT_THAT(d->statement, testing::StartsWith("Stopped before the end of the search, so no cause is named."));
    EXPECT_THAT(d->statement, testing::Not(testing::HasSubstr("probability")));
    EXPECT_THAT(d->not_tried, Contains(model::mechanism_index("leakage")));
    EXPECT_THAT(d->statement, testing::HasSubstr("Not tried: "));
  }
  EXPECT_TRUE(nothing.tried.empty());
  EXPECT_THAT(some.tried, Contains(model::mechanism_index("resistance_growth")));
  const Options whole;
  EXPECT_THAT(ids_of(diagnose(test::table9(), {}, {r}, whole)), Contains("resistance_growth"));
}

/// Next to a misfit that is tolerated: as a fault grows, it is first tolerated as well, then named.
TEST(Diagnose, AFaintCauseThatExplainsWhatIsNotTolerated) {
  for (const double ohm : {0.0008, 0.00083, 0.00086, 0.0009, 0.0012}) {
    const Diagnosis d =
        diagnose(test::table9(), {},
                 {test::recorded(test::drive(2, 12), 0.7, 12, [ohm](std::size_t k, double current_a, double) {
                   return ohm * current_a + 0.002 * std::sin(2 * 3.14159265 * static_cast<double>(k) / 1'234);
                 })});
    EXPECT_NE(d.verdict, Verdict::unknown) << ohm << ", left " << d.remaining;
  }
}

TEST(Diagnose, ToleranceIsWidenedUntilOwnRecordingsShowNothing) {
  const auto residual_of = [](double v) {
    return test::recorded(test::drive(2, 33), 0.7, 33, [v](std::size_t k, double, double) {
      return v * std::sin(2 * 3.14159265 * static_cast<double>(k) / 1'234);
    });
  };
  EXPECT_EQ(tolerance_factor(test::table9(), {}, {residual_of(0)}), 1);
  const double factor = tolerance_factor(test::table9(), {}, {residual_of(0.012)});
  EXPECT_GT(factor, 1);
  model::CellParameters<> wide = test::table9();
  wide.tolerance = with_wider_tolerance(wide.tolerance, factor);
  EXPECT_EQ(diagnose(test::table9(), {}, {residual_of(0.012)}).verdict, Verdict::unknown);
  EXPECT_EQ(diagnose(wide, {}, {residual_of(0.012)}).verdict, Verdict::no_mismatch);
}

}  // namespace
}  // namespace bms::diagnosis
