// What no mechanism describes, put into recordings of the plant's cell: the law must be named, and its term must help
// on a recording that was not used.
#include "diagnosis/law_term.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/prepare.hpp"
#include "diagnosis/selection.hpp"
#include "diagnosis/testability.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

using AddV = std::function<double(std::size_t, double, double)>;

std::optional<LawTerm> learned(const AddV& add_v) {
  const LikelihoodModel likelihood =
      likelihood_model_of(test::table9(), {}, {test::recorded(test::drive(2, 31), 0.75, 31, add_v)});
  return learn_law_term(likelihood, likelihood.noise(), law_evidence(likelihood, likelihood.noise()));
}

double error_v(const model::CellParameters<>& cell, const std::vector<MechanismSetting>& settings,
               const PreparedRecording& record) {
  const std::vector<double> v = predict(cell, settings, record);
  double sum = 0;
  for (std::size_t k = 0; k < v.size(); ++k) sum += std::pow(v[k] - record.voltage_v[k], 2);
  return std::sqrt(sum / static_cast<double>(v.size()));
}

void expect_named_and_modelled(const char* law, const AddV& add_v) {
  const auto term = learned(add_v);
  ASSERT_TRUE(term && term->cell) << law;
  EXPECT_EQ(term->law, law);
  EXPECT_LT(term->left_out_after_v, term->left_out_before_v);
  EXPECT_EQ(model::first_fault(*term->cell).what, nullptr) << model::first_fault(*term->cell).key;
  const PreparedRecording later = test::recorded(test::drive(1.5, 32), 0.7, 32, add_v);
  EXPECT_LT(error_v(*term->cell, with_term({}, *term), later), 0.5 * error_v(test::table9(), {}, later)) << law;
}

TEST(LawTerm, AnOcvOfAnotherShapeIsNamedAndModelled) {
  expect_named_and_modelled("ocv",
                            [](std::size_t, double, double soc) { return 0.015 * std::tanh((soc - 0.55) / 0.06); });
}

TEST(LawTerm, AResistanceOfAnotherShapeIsNamedAndModelled) {
  expect_named_and_modelled("ohmic", [](std::size_t, double current_a, double soc) {
    return 0.003 * (1 + std::sin(2 * 3.14159265 * soc / 0.5)) * current_a;
  });
}

TEST(LawTerm, ADriftOfTheInstrumentIsNotLearnedAsALaw) {
  const auto term =
      learned([](std::size_t row, double, double) { return 0.008 * std::sin(static_cast<double>(row) / 700); });
  EXPECT_FALSE(term && term->cell) << term->law << " " << term->left_out_before_v << " " << term->left_out_after_v;
}

/// No table has a term for these.
void expect_named(const char* law, const AddV& add_v) {
  const auto term = learned(add_v);
  ASSERT_TRUE(term) << law;
  EXPECT_EQ(term->law, law) << "next: " << term->laws[1].law << " " << term->laws[1].gain;
  EXPECT_FALSE(term->cell) << law;
}

/// It follows the load's size within half an hour.
AddV lift(double at_1c_v) {
  return [at_1c_v, state = 0.0](std::size_t, double current_a, double) mutable {
    state += (std::abs(current_a) / 6 - state) / 2'000;
    return at_1c_v * std::pow(state, 1.7);
  };
}

TEST(LawTerm, AVoltageThatStaysAfterACurrentInEitherDirectionIsNamedAndModelled) {
  expect_named_and_modelled("slow", lift(0.02));
}

TEST(LawTerm, ACellFileThatHasAMemoryOfTheLoadGetsNoSecondOne) {
  const MechanismSetting small{model::mechanism_index_of<model::LoadMemory>, {1e-4, 1e-4, 1'000}, {}};
  const LikelihoodModel likelihood =
      likelihood_model_of(test::table9(), {small}, {test::recorded(test::drive(2, 31), 0.75, 31, lift(0.02))});
  const auto term = learn_law_term(likelihood, likelihood.noise(), law_evidence(likelihood, likelihood.noise()));
  ASSERT_TRUE(term);
  EXPECT_EQ(term->law, "slow");
  EXPECT_FALSE(term->cell);
}

TEST(LawTerm, IsNoCauseThatIsSearched) {
  const LikelihoodModel likelihood =
      likelihood_model_of(test::table9(), {}, {test::recorded(test::drive(2, 31), 0.75, 31)});
  const Scope scope = scope_of(likelihood);
  constexpr std::size_t memory = model::mechanism_index_of<model::LoadMemory>;
  EXPECT_EQ(std::count(scope.searched.begin(), scope.searched.end(), memory), 0);
  EXPECT_EQ(scope.searched.size(), model::mechanism_count - 1);
  EXPECT_TRUE(not_testable(likelihood, likelihood.base(), memory)) << "not by those who search by themselves either";
}

TEST(LawTerm, WhatExplainsLessThanALawThatNoMechanismChangesIsNotNamed) {
  // a voltage that charging alone builds up: a mechanism explains most of it
  for (const unsigned seed : {33U, 35U}) {
    const AddV built_up = [state = 0.0](std::size_t, double current_a, double) mutable {
      state += (std::max(current_a, 0.0) / 6 - state) / 1'000;
      return 0.025 * std::tanh(state / 0.2);
    };
    const Diagnosis d =
        diagnose(test::table9(), {}, {test::recorded(test::drive(2, seed), 0.75, seed, built_up)}, Options{});
    EXPECT_EQ(d.verdict, Verdict::unknown) << seed;
    EXPECT_FALSE(d.findings.empty()) << seed;
    EXPECT_EQ(d.law ? d.law->law : "", "slow") << seed;
  }
}

TEST(LawTerm, AnErrorThatFollowsTheReadingIsOneOfTheVoltmeter) {
  // rather than of the OCV: a load moves the reading, but not the state of charge
  const std::vector<double> current_a = test::drive(2, 31);
  const PreparedRecording clean = test::recorded(current_a, 0.75, 31);
  expect_named("voltage", [&](std::size_t row, double, double) {
    return 0.006 * std::sin(2 * 3.14159265 * clean.voltage_v[row] / 0.05);
  });
}

TEST(LawTerm, APeriodThatTheLoadDoesNotHaveIsOneOfTheVoltmeter) {
  expect_named("voltage", [](std::size_t row, double, double) {
    return 0.004 * std::sin(2 * 3.14159265 * static_cast<double>(row) / 450);
  });
}

TEST(LawTerm, AReadingThatStandsStillUntilTheVoltageHasMovedIsKnownByItsLeaps) {
  const PreparedRecording healthy = test::recorded(test::drive(2, 31), 0.75, 31);
  PreparedRecording sticking = healthy, coarse = healthy;
  for (std::size_t k = 0; k < healthy.size(); ++k) {
    coarse.voltage_v.edit()[k] = 0.01 * std::round(healthy.voltage_v[k] / 0.01);
    const double fine_v = 0.001 * std::round(healthy.voltage_v[k] / 0.001),
                 before_v = k > 0 ? sticking.voltage_v[k - 1] : fine_v;
    sticking.voltage_v.edit()[k] = std::abs(fine_v - before_v) > 0.008 ? fine_v : before_v;
  }
  EXPECT_TRUE(follows_in_leaps(sticking));
  EXPECT_FALSE(follows_in_leaps(healthy));
  EXPECT_FALSE(follows_in_leaps(coarse));
}

TEST(LawTerm, AReadingInLeapsIsUnknownWhateverFitsIt) {
  PreparedRecording r = test::recorded(test::drive(2, 31), 0.75, 31);
  for (std::size_t k = 1; k < r.size(); ++k) {
    const double fine_v = 0.001 * std::round(r.voltage_v[k] / 0.001), before_v = r.voltage_v[k - 1];
    r.voltage_v.edit()[k] = std::abs(fine_v - before_v) > 0.003 ? fine_v : before_v;
  }
  const Diagnosis d = diagnose(test::table9(), {}, {r}, Options{});
  EXPECT_EQ(d.verdict, Verdict::unknown) << d.statement;
  EXPECT_FALSE(d.findings.empty()) << "the test is of no use: nothing fits it";
  EXPECT_EQ(d.law ? d.law->law : "", "voltage");
}

TEST(LawTerm, AReadingThatMovesInEveryRowWithASquareWaveDoesNotLeap) {
  // read once in each half of the wave
  PreparedRecording r;
  plant::Random random(5);
  for (int k = 0; k < 400; ++k) {
    r.time_s.edit().push_back(10.0 * k);
    r.current_a.edit().push_back(k % 2 == 0 ? 0 : -4);
    r.voltage_v.edit().push_back(3.9 - 0.0005 * k - (k % 2 == 0 ? 0 : 0.3) + 0.0001 * random.normal());
  }
  EXPECT_FALSE(follows_in_leaps(r));
}

TEST(LawTerm, AHealthyCellHasNone) { EXPECT_FALSE(learned(AddV{})); }

}  // namespace
}  // namespace bms::diagnosis
