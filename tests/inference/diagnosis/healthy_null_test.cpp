// What stands out from healthy recordings: the test itself on random gain, and whole diagnoses of cells whose model
// is wrong in a way that is not a fault.
#include "diagnosis/healthy_null.hpp"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <Eigen/LU>

#include "diagnosis/block_covariance.hpp"
#include "diagnosis/healthy_block.hpp"
#include "diagnosis/learned_error.hpp"
#include "diagnosis/prepare.hpp"
#include "diagnosis/texts.hpp"
#include "diagnosis/withhold.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

using healthy_data::HealthyBlock;
using healthy_data::HealthyData;

HealthyBlock block(std::vector<healthy_data::HealthyGain> gains, double hours = 1) {
  HealthyBlock b;
  b.recording = "healthy.csv";
  b.duration_s = 3'600 * hours;
  b.gains = std::move(gains);
  return b;
}

HealthyData blocks_of_offset(const std::vector<double>& gains) {
  HealthyData d;
  d.known = true;
  for (const double e : gains) d.blocks.push_back(block({{"voltage_offset", e}}));
  return d;
}

TEST(HealthyNull, ACauseThatHealthyRecordingsShowAsMuchDoesNotStandOut) {
  const HealthyNull null(blocks_of_offset({300, 20, 4'000, 50, 900, 120, 70, 2'500}), 0.01, 3'600);
  const HealthyComparison c = null.compare("voltage_offset", 3'000);
  EXPECT_FALSE(c.stands_out);
  EXPECT_EQ(c.healthy_gain, 4'000);
  EXPECT_FALSE(c.hours_needed.has_value()) << "more of the same would not help";
}

TEST(HealthyNull, ACauseFarAboveAllHealthyRecordingsStandsOut) {
  const HealthyNull null(blocks_of_offset({300, 200, 400, 150, 350, 220, 270, 250}), 0.01, 3'600);
  EXPECT_TRUE(null.compare("voltage_offset", 6'000).stands_out);
  EXPECT_FALSE(null.compare("voltage_offset", 450).stands_out);
}

TEST(HealthyNull, ACauseThatHealthyRecordingsNeverShowNeedsLess) {
  const HealthyNull null(blocks_of_offset({300, 200, 400, 150, 350, 220, 270, 250}), 0.01, 3'600);
  EXPECT_TRUE(null.compare("channel_skew", 600).stands_out);
  EXPECT_FALSE(null.compare("channel_skew", 30).stands_out) << "some other cause reaches as much by chance";
}

TEST(HealthyNull, AnUnknownCauseNextToAWithheldOneNamesThatOne) {
  Diagnosis d;
  d.verdict = Verdict::unknown;
  EXPECT_THAT(statement(d, {}), ::testing::HasSubstr("none of the known causes"));
  Withheld w;
  w.mechanism = model::mechanism_index("polarisation_growth");
  w.healthy.hours_needed = 3;
  d.healthy = HealthyBasis{.hours = 0.5};
  d.withheld = {w};
  EXPECT_THAT(statement(d, {}), ::testing::HasSubstr("polarisation could cause it and is not named: 0.5 h of healthy"));
  EXPECT_THAT(statement(d, {}), ::testing::Not(::testing::HasSubstr("none of the known causes")));
}

TEST(HealthyNull, WithoutAnyTheHoursDependOnTheGain) {
  EXPECT_EQ(hours_if_none_shows_any(1e6, 1, 0.01), 1);
  EXPECT_GT(hours_if_none_shows_any(100, 1, 0.01), 3);
  EXPECT_EQ(hours_if_none_shows_any(30, 1, 0.01), 99) << "by rank alone";
  EXPECT_DOUBLE_EQ(hours_if_none_shows_any(1e6, 0.5, 0.01), 0.5);
}

TEST(HealthyNull, WithFewBlocksItSaysHowManyHoursWouldDo) {
  const HealthyNull few(blocks_of_offset({300, 200, 400}), 0.01, 3'600);
  EXPECT_TRUE(few.compare("voltage_offset", 6'000).stands_out);
  const HealthyComparison c = few.compare("voltage_offset", 1'500);
  EXPECT_FALSE(c.stands_out);
  ASSERT_TRUE(c.hours_needed.has_value());
  EXPECT_GT(*c.hours_needed, 3);
  EXPECT_LT(*c.hours_needed, 12);
  const HealthyComparison faint = few.compare("voltage_offset", 900);
  ASSERT_TRUE(faint.hours_needed.has_value());
  EXPECT_GT(*faint.hours_needed, *c.hours_needed);
  EXPECT_LE(*faint.hours_needed, 99) << "with 99 blocks the rank decides";
}

TEST(HealthyNull, TheGainIsExpectedToGrowWithTheDuration) {
  const HealthyNull as_long(blocks_of_offset({300, 200, 400, 150, 350, 220, 270, 250}), 0.01, 3'600),
      longer(blocks_of_offset({300, 200, 400, 150, 350, 220, 270, 250}), 0.01, 10 * 3'600);
  EXPECT_TRUE(as_long.compare("voltage_offset", 5'000).stands_out);
  EXPECT_FALSE(longer.compare("voltage_offset", 5'000).stands_out);
  EXPECT_EQ(longer.compare("voltage_offset", 5'000).healthy_gain, 4'000);
}

/// A gain grows with the duration: nine minutes that show 25 would show 125 in 45.
TEST(HealthyNull, AShortBlockShowsACauseIfItWouldInALongRecording) {
  HealthyData healthy;
  healthy.known = true;
  healthy.blocks.push_back(block({{"voltage_offset", 25}}, 0.15));
  const HealthyCoverage elsewhere = {0, 0, {}};
  EXPECT_FALSE(healthy_decide(HealthyNull(healthy, 0.01, 540), elsewhere));
  EXPECT_TRUE(healthy_decide(HealthyNull(healthy, 0.01, 2'700), elsewhere));
  EXPECT_FALSE(healthy_decide(HealthyNull({}, 0.01, 2'700), {1, 1, {}}));
}

TEST(HealthyNull, TheGainNeededIsTheSmallestThatStandsOut) {
  const HealthyNull null(blocks_of_offset({300, 200, 400, 150, 350, 220, 270, 250}), 0.01, 3'600);
  const auto needed = null.gain_needed("voltage_offset");
  ASSERT_TRUE(needed.has_value());
  EXPECT_TRUE(null.compare("voltage_offset", 1.01 * *needed).stands_out);
  EXPECT_FALSE(null.compare("voltage_offset", 0.99 * *needed).stands_out);
  const auto with_two = HealthyNull(blocks_of_offset({300, 200}), 0.01, 3'600).gain_needed("voltage_offset");
  ASSERT_TRUE(with_two.has_value());
  EXPECT_GT(*with_two, 2 * *needed) << "the fewer, the larger";
  const auto with_one = HealthyNull(blocks_of_offset({300}), 0.01, 3'600).gain_needed("channel_skew");
  ASSERT_TRUE(with_one.has_value());
  EXPECT_GT(*with_one, 2 * *with_two);
  EXPECT_FALSE(HealthyNull({}, 0.01, 3'600).gain_needed("voltage_offset").has_value());
}

/// With its own level in addition, what it shows would count twice.
TEST(HealthyNull, ASingleBlockCountsOnceForTheCauseThatItShows) {
  const HealthyNull null(blocks_of_offset({300}), 0.01, 3'600);
  const auto shown = null.gain_needed("voltage_offset"), another = null.gain_needed("channel_skew");
  ASSERT_TRUE(shown.has_value());
  ASSERT_TRUE(another.has_value());
  EXPECT_NEAR(*shown / *another, 1, 0.01);
  EXPECT_GT(*shown, 10 * 300);
}

TEST(HealthyNull, WhereNoHealthyBlockWasALargerGainIsNeeded) {
  const HealthyNull null(blocks_of_offset({300, 200, 400, 150, 350, 220, 270, 250}), 0.01, 3'600);
  double before = *null.gain_needed("voltage_offset");
  for (const double covered : {0.75, 0.5, 0.25, 0.0}) {
    const auto needed = null.gain_needed("voltage_offset", covered);
    ASSERT_TRUE(needed.has_value());
    EXPECT_GT(*needed, 1.01 * before) << covered;
    EXPECT_LT(null.compare("voltage_offset", *needed, 1).false_alarm, 0.01) << covered;
    before = *needed;
  }
}

/// Levels of the blocks as in a healthy recording; that of the next one spread by so much more.
TEST(HealthyNull, FalseAlarmsKeepTheirRateWhereNoHealthyBlockWas) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  for (const double rate : {0.01, 0.05}) {
    int alarms = 0;
    constexpr int trials = 20'000;
    for (int trial = 0; trial < trials; ++trial) {
      std::vector<double> gains(8);
      for (double& gain : gains) gain = 26 * std::exp(4 + 0.5 * normal(random));
      const HealthyNull null(blocks_of_offset(gains), rate, 3'600);
      const double elsewhere = std::hypot(0.5, log_spread_beyond(0));
      alarms += null.compare("voltage_offset", 26 * std::exp(4 + elsewhere * normal(random)), 0).stands_out ? 1 : 0;
    }
    EXPECT_LE(alarms, 1.2 * rate * trials) << rate;
    EXPECT_GE(alarms, 0.1 * rate * trials) << "the rate is also used";
  }
}

/// The cell's own spread is not known to the null.
TEST(HealthyNull, OneOrTwoBlocksRaiseNoMoreFalseAlarms) {
  std::mt19937_64 random(6);
  std::normal_distribution<double> normal;
  std::gamma_distribution<double> chi_square(1, 2);  // of two degrees of freedom
  for (const std::size_t blocks : {std::size_t{1}, std::size_t{2}}) {
    for (const double covered : {0.0, 0.5, 1.0}) {
      int alarms = 0, of_another_cause = 0, of_a_fault = 0;
      constexpr int trials = 20'000;
      for (int trial = 0; trial < trials; ++trial) {
        const double own = 0.5 * std::sqrt(2 / chi_square(random));
        std::vector<double> gains(blocks);
        for (double& gain : gains) gain = 26 * std::exp(4 + own * normal(random));
        const HealthyNull null(blocks_of_offset(gains), 0.05, 3'600);
        const double next = 4 + std::hypot(own, log_spread_beyond(covered)) * normal(random);
        alarms += null.compare("voltage_offset", 26 * std::exp(next), covered).stands_out ? 1 : 0;
        of_another_cause += null.compare("channel_skew", 26 * std::exp(next), covered).stands_out ? 1 : 0;
        of_a_fault += null.compare("channel_skew", 26 * std::exp(next + 8), covered).stands_out ? 1 : 0;
      }
      EXPECT_LE(alarms, 1.2 * 0.05 * trials) << blocks << " blocks, " << covered;
      // a cause that the blocks do not show, as large as the one that they show
      if (blocks == 1) {
        EXPECT_LE(of_another_cause, 1.2 * 0.05 * trials) << covered;
        EXPECT_GE(of_another_cause, 0.2 * 0.05 * trials) << "the rate is also used, " << covered;
      }
      EXPECT_GE(of_a_fault, 0.5 * trials) << blocks << " blocks, " << covered;
    }
  }
}

TEST(HealthyNull, AnErrorGrowsAsTheRootOfAGain) {
  EXPECT_EQ(error_factor(1, 0.01), 1);
  EXPECT_NEAR(2 * std::log(error_factor(0, 0.01)), 2.326 * log_spread_beyond(0), 0.02);
  EXPECT_LT(error_factor(0.5, 0.01), error_factor(0, 0.01));
}

healthy_data::HealthyRegime regime(const char* axis, double from, double to, double rms_v) {
  return {.axis = axis, .from = from, .to = to, .hours = 1, .bias_v = 0, .rms_v = rms_v, .spread_v = 0};
}

/// Good to 2 mV between 20 and 100 %, to 80 mV near empty, in a discharge at 0.8C.
std::vector<healthy_data::HealthyRegime> of_discharges() {
  return {regime("soc", 0, 0.1, 0.08),  regime("soc", 0.1, 0.2, 0.01),       regime("soc", 0.2, 0.6, 0.002),
          regime("soc", 0.6, 1, 0.002), regime("current_c", 0, 0.05, 0.003), regime("current_c", 0.5, 1, 0.003)};
}

PreparedRecording discharge(double current_a) {
  std::vector<double> profile(60, 0.0);
  profile.insert(profile.end(), 2'000, current_a);
  return test::recorded(profile, 0.95, 1);
}

TEST(LearnedError, TakesThePlaceOfAWideTolerance) {
  model::CellParameters<> cell = test::table9();
  cell.tolerance.ocv_v = 0.04;
  cell.tolerance.resistance_fraction = 0.3;
  const LearnedError learned(of_discharges(), cell, {discharge(-4.8)});
  ASSERT_TRUE(learned.known());
  EXPECT_LT(learned.at(0.5), 0.004);
  EXPECT_GT(learned.at(0.02), 0.08);
  EXPECT_NEAR(learned.more_at(0.5), 0, 1e-9);
  EXPECT_DOUBLE_EQ(learned.applied(cell).tolerance.ocv_v, learned.at(0.5));
  EXPECT_LT(learned.applied(cell).tolerance.resistance_fraction, 0.2);
}

TEST(LearnedError, HoldsNeitherElsewhereNorAgainstANarrowTolerance) {
  model::CellParameters<> cell = test::table9();
  EXPECT_FALSE(LearnedError(of_discharges(), cell, {discharge(-4.8)}).known()) << "the file promises 1.5 mV";
  cell.tolerance.ocv_v = 0.04;
  EXPECT_FALSE(LearnedError(of_discharges(), cell, {discharge(-2)}).known()) << "no healthy recording had 0.3C";
  EXPECT_FALSE(LearnedError({}, cell, {discharge(-4.8)}).known());
  EXPECT_EQ(LearnedError({}, cell, {discharge(-4.8)}).applied(cell).tolerance.ocv_v, 0.04);
}

TEST(HealthyNull, AHighRateIsDecidedByRank) {
  const HealthyNull null(blocks_of_offset({300, 200, 400, 150, 350, 220, 270, 250, 310}), 0.1, 3'600);
  EXPECT_DOUBLE_EQ(null.compare("voltage_offset", 1).false_alarm, 1);
}

/// Share of healthy recordings of which any of several causes stands out. spread: of the gain, in ln.
double false_alarms(std::size_t blocks, double spread, double rate) {
  plant::Random random(7);
  const std::vector<std::string> causes = {"a", "b", "c", "d", "e"};
  const auto random_gains = [&] {
    std::vector<healthy_data::HealthyGain> all;
    double usual = 30;
    for (const std::string& cause : causes) {
      all.push_back({cause, usual * std::exp(spread * random.normal())});
      usual *= 4;
    }
    return all;
  };
  constexpr int trials = 2'000;
  int alarms = 0;
  for (int k = 0; k < trials; ++k) {
    HealthyData d;
    d.known = true;
    for (std::size_t b = 0; b < blocks; ++b) d.blocks.push_back(block(random_gains()));
    const HealthyNull null(d, rate, 3'600);
    bool any = false;
    for (const auto& e : random_gains()) any = any || null.compare(e.cause, e.gain).stands_out;
    alarms += any ? 1 : 0;
  }
  return static_cast<double>(alarms) / trials;
}

TEST(HealthyNull, WhateverTheCauseFalseAlarmsKeepTheirRate) {
  // 2,000 trials: the rate is known to a third of 1 %
  for (const std::size_t blocks : {1U, 2U, 4U, 10U, 40U}) {
    EXPECT_LE(false_alarms(blocks, 0.7, 0.01), 0.022) << blocks;
    EXPECT_LE(false_alarms(blocks, 1.5, 0.01), 0.022) << blocks;
  }
  EXPECT_LE(false_alarms(120, 1, 0.05), 0.065);
  EXPECT_GE(false_alarms(120, 1, 0.05), 0.02) << "the rate is also used";
}

/// A real cell's relaxation, which the plant does not have: 4 mOhm with 40 s, and 3 mOhm more when charging.
std::function<double(std::size_t, double, double)> not_in_the_model(double extra_ohm = 0) {
  return [slow_v = 0.0, extra_ohm](std::size_t, double current_a, double) mutable {
    slow_v += (0.004 * current_a - slow_v) / 40;
    return slow_v + (current_a > 0 ? 0.001 * current_a : 0) + extra_ohm * current_a;
  };
}

HealthyData learned(std::size_t recordings) {
  static std::vector<HealthyBlock> blocks;  // each takes a second
  Options options;
  options.learns = true;
  while (blocks.size() < recordings) {
    const std::uint64_t seed = 100 + blocks.size();
    const PreparedRecording r = test::recorded(test::drive(0.5, seed), 0.7, seed, not_in_the_model());
    blocks.push_back(healthy_block(r, diagnose(test::table9(), {}, {r}, options)));
  }
  HealthyData d;
  d.known = true;
  d.blocks.assign(blocks.begin(), blocks.begin() + static_cast<std::ptrdiff_t>(recordings));
  return d;
}

/// Causes that are a resistance, at one current or within a row.
const auto resistance = testing::AnyOf("resistance_growth", "contact_step", "fast_polarisation");

TEST(DiagnoseWithHealthy, BlamesNothingForWhatHealthyRecordingsShow) {
  const PreparedRecording r = test::recorded(test::drive(0.5, 200), 0.7, 200, not_in_the_model());
  EXPECT_TRUE(names(diagnose(test::table9(), {}, {r}).verdict)) << "the model is wrong";
  Options options;
  options.healthy = learned(8);
  Diagnosis d = diagnose(test::table9(), {}, {r}, options);
  EXPECT_FALSE(names(d.verdict)) << name_of(d.verdict);
  EXPECT_NE(d.verdict, Verdict::unknown);
  EXPECT_FALSE(d.withheld.empty());
  ASSERT_TRUE(d.healthy.has_value());
  EXPECT_EQ(d.healthy->blocks, 8U);
  EXPECT_NEAR(d.healthy->hours, 4, 0.01);
  describe(d, test::table9(), {r});
  EXPECT_THAT(d.statement, testing::HasSubstr("ealthy"));
}

TEST(DiagnoseWithHealthy, NamesAFaultThatHealthyRecordingsDoNotShow) {
  // a sensor that is late is not what the model lacks
  PreparedRecording r = test::recorded(test::drive(0.5, 201), 0.7, 201, not_in_the_model());
  std::vector<double>& current_a = r.current_a.edit();
  for (std::size_t k = current_a.size() - 1; k >= 2; --k) current_a[k] = current_a[k - 2];
  Options options;
  options.healthy = learned(8);
  const Diagnosis d = diagnose(test::table9(), {}, {r}, options);
  ASSERT_TRUE(names(d.verdict)) << name_of(d.verdict);
  EXPECT_EQ(model::catalogue[d.findings.front().setting.index].id, "channel_skew");
  EXPECT_NEAR(d.findings.front().setting.value[0], 2, 0.2);
}

TEST(DiagnoseWithHealthy, BlamesNothingWhereTheHealthyRecordingsWereNot) {
  const PreparedRecording r = test::recorded(test::drive(0.5, 202), 0.2, 202, not_in_the_model());
  Options options;
  options.healthy = learned(4);
  for (HealthyBlock& b : options.healthy.blocks) b.soc = {0.8, 0.9};
  Diagnosis d = diagnose(test::table9(), {}, {r}, options);
  EXPECT_EQ(d.verdict, Verdict::not_testable);
  EXPECT_LT(d.healthy->covered.share, 0.5);
  describe(d, test::table9(), {r});
  EXPECT_THAT(d.statement, testing::HasSubstr("healthy"));
}

TEST(DiagnoseWithHealthy, ALargeErrorIsUnknownAlsoWhereTheHealthyRecordingsWereNot) {
  Options options;
  options.healthy = learned(4);
  for (HealthyBlock& b : options.healthy.blocks) b.soc = {0.8, 0.9};
  for (const double extra_ohm : {0.05, 0.2}) {
    const PreparedRecording r = test::recorded(test::drive(0.5, 202), 0.2, 202, not_in_the_model(extra_ohm));
    const Diagnosis d = diagnose(test::table9(), {}, {r}, options);
    EXPECT_LT(d.healthy->covered.share, 0.5);
    EXPECT_TRUE(d.verdict == Verdict::unknown || names(d.verdict)) << name_of(d.verdict);
    for (const Finding& f : d.findings) EXPECT_THAT(model::catalogue[f.setting.index].id, resistance);
  }
}

/// 1.5C with short rests.
PreparedRecording pulsed_discharge(std::uint64_t seed, double extra_ohm = 0) {
  std::vector<double> current_a;
  for (int k = 0; k < 2'000; ++k) current_a.push_back(k % 120 < 20 ? 0 : -9);
  return test::recorded(current_a, 0.9, seed, not_in_the_model(extra_ohm));
}

HealthyData learned_from_pulses() {
  Options learning;
  learning.learns = true;
  HealthyData healthy;
  healthy.known = true;
  for (const std::uint64_t seed : {301U, 302U, 303U, 304U}) {
    const PreparedRecording r = pulsed_discharge(seed);
    healthy.blocks.push_back(healthy_block(r, diagnose(test::table9(), {}, {r}, learning)));
  }
  return healthy;
}

PreparedRecording pulsed_discharge_read_too_much() {
  PreparedRecording r = pulsed_discharge(305);
  for (double& a : r.current_a.edit()) a *= 1.35;
  return r;
}

/// With its error taken away the recording lies where the healthy ones were, so they decide: what they do not let stand
/// out is not named by the tolerance either.
TEST(DiagnoseWithHealthy, ASensorThatReadsTooMuchAndIsWithheldIsNotNamedByTheTolerance) {
  Options options;
  options.healthy = learned_from_pulses();
  for (HealthyBlock& b : options.healthy.blocks) b.gains.clear();
  options.false_alarm_rate = 1e-12;  // nothing stands out
  const Diagnosis d = diagnose(test::table9(), {}, {pulsed_discharge_read_too_much()}, options);
  ASSERT_TRUE(d.healthy.has_value());
  EXPECT_TRUE(d.healthy->decided);
  EXPECT_FALSE(names(d.verdict)) << name_of(d.verdict);
  EXPECT_THAT(d.withheld,
              testing::Contains(testing::Field(&Withheld::mechanism, model::mechanism_index("current_gain"))));
}

TEST(DiagnoseWithHealthy, ASensorThatReadsTooMuchDoesNotHideBeyondTheHealthyCurrents) {
  Options options;
  options.healthy = learned_from_pulses();
  const PreparedRecording r = pulsed_discharge_read_too_much();
  const Diagnosis d = diagnose(test::table9(), {}, {r}, options);
  ASSERT_TRUE(names(d.verdict)) << name_of(d.verdict);
  EXPECT_EQ(model::catalogue[d.findings.front().setting.index].id, "current_gain");
  EXPECT_NEAR(d.findings.front().setting.value[0], 0.35, 0.06) << "the cell's relaxation is not in the model";
  EXPECT_GE(d.healthy->covered.share, 0.9);
  // such a load on a cell that has 10 mohm more, however, is beyond them: more than they would show there, a
  // resistance; four recordings that were elsewhere cannot promise one false alarm in a hundred
  options.false_alarm_rate = 0.02;
  for (HealthyBlock& b : options.healthy.blocks) b.current_a = {-5, 0};
  const Diagnosis beyond = diagnose(test::table9(), {}, {pulsed_discharge(306, 0.01)}, options);
  ASSERT_TRUE(names(beyond.verdict)) << name_of(beyond.verdict);
  ASSERT_FALSE(beyond.findings.empty());
  for (const Finding& f : beyond.findings) EXPECT_THAT(model::catalogue[f.setting.index].id, resistance);
}

TEST(DiagnoseWithHealthy, TheStandardDeviationContainsTheErrorOfTheModel) {
  // 3 mOhm of R0 in addition to a relaxation that the fit does not have; plain: from a white residual
  const MechanismSetting growth = [] {
    MechanismSetting s = model::default_setting(model::mechanism_index("resistance_growth"), test::table9());
    s.value[0] = 0.1;
    return s;
  }();
  const auto fitted = [&](const PreparedRecording& r) {
    model::CellParameters<> cell = test::table9();
    cell.tolerance.resistance_fraction = 0.001;  // otherwise the tolerance is the larger part
    const LikelihoodModel likelihood = likelihood_model_of(cell, {}, {r});
    HypothesisFit fit = likelihood.fit(with(likelihood.base(), growth));
    const double plain = fit.hypothesis.settings.back().deviation[0];
    include_model_error(likelihood, fit);
    return fit.hypothesis.settings.back().deviation[0] / plain;
  };
  const auto drive = test::drive(1, 205);
  EXPECT_LT(fitted(test::recorded(drive, 0.7, 205, [](std::size_t, double a, double) { return 0.003 * a; })), 1.8);
  EXPECT_GT(fitted(test::recorded(drive, 0.7, 205, not_in_the_model(0.003))), 2.5);
}

TEST(DiagnoseWithHealthy, TheErrorOfTheModelLeavesWhatIsKnownWithoutTheVoltage) {
  // 0.3 K below the reference the voltage says little of the energies, and with the error of the model next to nothing
  MechanismSetting cold = model::default_setting(model::mechanism_index("temperature_resistance"), test::table9());
  cold.value[0] = 40'000;
  cold.value[1] = 45'000;
  cold.value[3] = 0.5;
  PreparedRecording r = test::recorded(test::drive(1, 206), 0.7, 206, not_in_the_model(0.004));
  r.temperature_c.edit().assign(r.size(), 24.7);
  model::CellParameters<> cell = test::table9();
  cell.tolerance.resistance_fraction = 0.001;  // otherwise the tolerance is the larger part
  const LikelihoodModel likelihood = likelihood_model_of(cell, {}, {r});
  HypothesisFit fit = likelihood.fit(with(likelihood.base(), cold));
  const Eigen::MatrixXd plain = fit.covariance;
  include_model_error(likelihood, fit);
  const MechanismSetting& s = fit.hypothesis.settings.back();
  EXPECT_LE(s.deviation[0], 1.0001e4);
  EXPECT_LE(s.deviation[1], 1.5001e4);
  EXPECT_GT(fit.covariance.determinant(), 4 * plain.determinant()) << "what the data say is less certain";
  for (Eigen::Index j = 0; j < plain.rows(); ++j) EXPECT_GE(fit.covariance(j, j), 0.999 * plain(j, j));
}

/// Healthy recordings of which none could be compared say nothing, so they take no answer away.
TEST(DiagnoseWithHealthy, WithoutAnyUsableBlockTheAnswerIsThatWithoutHealthyRecordings) {
  Options options;
  options.healthy.known = true;
  for (const double extra_ohm : {0.0, 0.02, 0.15}) {
    const PreparedRecording r = test::recorded(test::drive(0.5, 204), 0.7, 204, not_in_the_model(extra_ohm));
    const Diagnosis with = diagnose(test::table9(), {}, {r}, options), without = diagnose(test::table9(), {}, {r});
    EXPECT_EQ(with.verdict, without.verdict) << extra_ohm;
    EXPECT_EQ(with.findings.size(), without.findings.size()) << extra_ohm;
    EXPECT_EQ(with.limits.size(), without.limits.size()) << extra_ohm;
    EXPECT_FALSE(with.healthy.has_value()) << extra_ohm;
    EXPECT_THAT(with.warnings, testing::Contains(testing::HasSubstr("none of the healthy recordings"))) << extra_ohm;
    EXPECT_THAT(without.warnings, testing::IsEmpty()) << extra_ohm;
  }
  const PreparedRecording r = test::recorded(test::drive(0.5, 204), 0.7, 204, not_in_the_model(0.02));
  const Diagnosis d = diagnose(test::table9(), {}, {r}, options);
  ASSERT_TRUE(names(d.verdict)) << name_of(d.verdict);
  EXPECT_THAT(model::catalogue[d.findings.front().setting.index].id, resistance);
}

/// Healthy recordings that were elsewhere and show no cause confirm the tolerance: no reason to name less. Those that
/// show one do not.
TEST(DiagnoseWithHealthy, WhatHealthyRecordingsElsewhereConfirmTakesNoAnswerAway) {
  Options confirming;
  confirming.healthy = learned(1);
  confirming.healthy.blocks.front().soc = {0.9, 1};
  confirming.healthy.blocks.front().gains.clear();
  Options doubting = confirming;
  doubting.healthy.blocks.front().gains = {{"voltage_offset", 300}};
  const PreparedRecording faulty = test::recorded(test::drive(0.5, 207), 0.3, 207, not_in_the_model(0.02));
  const Diagnosis with = diagnose(test::table9(), {}, {faulty}, confirming),
                  without = diagnose(test::table9(), {}, {faulty});
  ASSERT_TRUE(with.healthy.has_value());
  EXPECT_LT(with.healthy->covered.share, 0.5);
  ASSERT_TRUE(names(without.verdict)) << name_of(without.verdict);
  EXPECT_EQ(with.verdict, without.verdict);
  EXPECT_FALSE(with.healthy->decided);
  EXPECT_THAT(statement(with, {}), testing::HasSubstr("without a known false alarm rate"));
  EXPECT_THAT(statement(without, {}), testing::Not(testing::HasSubstr("false alarm rate")));
  const Diagnosis doubted = diagnose(test::table9(), {}, {faulty}, doubting);
  EXPECT_FALSE(names(doubted.verdict));
  EXPECT_TRUE(doubted.healthy->decided);
  // an error of the model is named there as without them: they were elsewhere
  const PreparedRecording relaxing = test::recorded(test::drive(0.5, 208), 0.3, 208, not_in_the_model());
  EXPECT_EQ(diagnose(test::table9(), {}, {relaxing}, confirming).verdict,
            diagnose(test::table9(), {}, {relaxing}).verdict);
  const PreparedRecording healthy = test::recorded(test::drive(0.5, 208), 0.3, 208);
  EXPECT_EQ(diagnose(test::table9(), {}, {healthy}, confirming).verdict, Verdict::not_testable)
      << "nothing found there";
  EXPECT_EQ(diagnose(test::table9(), {}, {healthy}).verdict, Verdict::no_mismatch);
}

/// The weight of a gain of some thousands next to that of no mechanism is beyond a double.
TEST(DiagnoseWithHealthy, ProbabilitiesAreNumbersHoweverMuchAWithheldCauseExplains) {
  Options options;
  options.healthy = learned(1);
  options.healthy.blocks.front().soc = {0.9, 1};
  options.healthy.blocks.front().gains = {{"voltage_offset", 300}};
  const PreparedRecording faulty = test::recorded(test::drive(0.5, 207), 0.5, 207, not_in_the_model(0.02));
  const Diagnosis d = diagnose(test::table9(), {}, {faulty}, options);
  ASSERT_FALSE(names(d.verdict));
  ASSERT_FALSE(d.candidates.empty());
  EXPECT_GT(d.candidates.front().gain, 2'200);
  double sum = 0;
  for (const Ranked& r : d.candidates) {
    EXPECT_GE(r.probability, 0);
    sum += r.probability;
  }
  EXPECT_LE(sum, 1);
  EXPECT_GT(sum, 0);
}

TEST(DiagnoseWithHealthy, AGoodModelStaysWithoutMismatch) {
  Options options;
  options.healthy = learned(4);
  for (HealthyBlock& b : options.healthy.blocks) b.gains.push_back({"voltage_offset", 1e7});
  const Diagnosis d = diagnose(test::table9(), {}, {test::recorded(test::drive(0.5, 203), 0.7, 203)}, options);
  EXPECT_EQ(d.verdict, Verdict::no_mismatch);
  EXPECT_TRUE(d.withheld.empty());
  EXPECT_FALSE(d.limits.empty());
  EXPECT_THAT(d.limits, testing::Not(testing::Contains(
                            testing::Field(&DetectionLimit::mechanism, model::mechanism_index("voltage_offset")))))
      << "a limit that no offset reaches";
}

}  // namespace
}  // namespace bms::diagnosis
