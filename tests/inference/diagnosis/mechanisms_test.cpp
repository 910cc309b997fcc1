// What is known of each mechanism of the catalogue.
#include "diagnosis/mechanism.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "diagnosis/mechanisms/temperature_resistance.hpp"
#include "diagnosis/texts.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

TEST(Mechanisms, EachHasItsOwnWords) {
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    const MechanismText& text = text_of_mechanism(m);
    EXPECT_EQ(text.id, model::catalogue[m].id);
    EXPECT_NE(text.name, text.id) << "its file is missing in inference/diagnosis/mechanisms/all.hpp";
    for (const std::string_view sentence : {text.meaning, text.action})
      EXPECT_THAT(std::string(sentence), testing::EndsWith(".")) << text.id;
    for (const std::string_view part : {text.name, text.brief, text.mark})
      EXPECT_THAT(std::string(part), testing::Not(testing::EndsWith("."))) << text.id;
  }
}

TEST(Mechanisms, EachClaimNamesItsStrengthWithItsUncertainty) {
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    const model::MechanismInfo& info = model::catalogue[m];
    MechanismSetting setting{m, {}, {}};
    for (std::size_t p = 0; p < info.parameters; ++p) {
      setting.value[p] = 0.3 * info.parameter[p].upper(6);
      setting.deviation[p] = 0.02 * setting.value[p];
    }
    EXPECT_THAT(claim(setting), testing::HasSubstr(" ± ")) << info.id;
  }
}

TEST(Mechanisms, AnAmbiguityWithoutAFactThatWouldHelpDoesNotReferToOne) {
  constexpr std::size_t growth = model::mechanism_index("resistance_growth"),
                        fast = model::mechanism_index("fast_polarisation"),
                        hysteresis = model::mechanism_index("ocv_hysteresis");
  Finding f;
  f.setting.index = growth;
  f.equivalent_to = {fast};
  const std::string without = because({}, f, {});
  EXPECT_THAT(without, testing::Not(testing::HasSubstr("That is not enough")));
  EXPECT_THAT(without, testing::HasSubstr(" This recording does not distinguish the two."));
  f.equivalent_to = {hysteresis};
  EXPECT_THAT(because({}, f, {}),
              testing::HasSubstr(" In this recording the charge never turns and there is no rest. That is not "
                                 "enough to distinguish them."));
}

TEST(Mechanisms, FarStartsAreNotAboveTheUpperBound) {
  RecordingFacts facts;
  facts.capacity_ah = 6;
  facts.duration_h = 3;
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    const model::MechanismInfo& info = model::catalogue[m];
    for (const std::vector<double>& start :
         knowledge_of(m).far_starts(model::default_setting(m, test::table9()), facts)) {
      ASSERT_LE(start.size(), info.parameters) << info.id;
      for (std::size_t p = 0; p < start.size(); ++p)
        EXPECT_LE(std::abs(start[p]), info.parameter[p].upper(6)) << info.id;  // a fit clamps to the lower bound
    }
  }
}

TEST(Mechanisms, ASlowPolarisationTakesOverMostOfR1InOneStart) {
  const model::CellParameters<> cell = test::table9();
  const std::size_t growth = model::mechanism_index_of<model::PolarisationGrowth>,
                    slow = model::mechanism_index_of<model::SlowPolarisation>;
  std::vector<MechanismSetting> all = {model::default_setting(slow, cell), model::default_setting(growth, cell)};
  all[0].value[0] = 0.002;
  ASSERT_TRUE(knowledge_of(growth).joint_start(all, cell));
  const double r1_ohm = model::cell_detail::rc_value(cell.rc, cell.rc.r1_ohm, 0.5);
  EXPECT_NEAR((1 + all[1].value[0]) * r1_ohm + all[0].value[0], r1_ohm + 0.002, 1e-12) << "a long load drops as much";
  EXPECT_LT((1 + all[1].value[0]) * (1 + all[1].value[1]), 0.5) << "what stays in the RC pair is faster";
  std::vector<MechanismSetting> alone = {all[1]};
  EXPECT_FALSE(knowledge_of(growth).joint_start(alone, cell));
  EXPECT_FALSE(knowledge_of(slow).joint_start(all, cell));
}

TEST(Mechanisms, ATemperatureSensorNeedsACellFileThatKnowsTheTemperature) {
  RecordingFacts facts;
  facts.temperature = true;
  const auto testable = [&](double relative_sigma) {
    const std::size_t sensor = model::mechanism_index_of<model::TemperatureSensor>;
    return !knowledge_of(sensor)
                .not_testable({.facts = facts, .follows_temperature = true, .temperature_sigma = relative_sigma})
                .has_value();
  };
  EXPECT_TRUE(testable(0)) << "the file states no deviation";
  EXPECT_TRUE(testable(0.1));
  EXPECT_FALSE(testable(0.5));
  // 50 +- 10 kJ/mol on 22 +- 9 % of R0, from a drive at one temperature; the extended file from drives at five
  using Law = Knowledge<model::TemperatureResistance>;
  MechanismSetting one{
      model::mechanism_index_of<model::TemperatureResistance>, {50e3, 20e3, 25, 0.22}, {10e3, 8e6, 0, 0.09}};
  EXPECT_NEAR(Law::temperature_sigma(one), std::hypot(0.2, 0.09 / 0.22), 1e-9);
  one.deviation[1] = 2e3;
  EXPECT_NEAR(Law::temperature_sigma(one), 0.1, 1e-9);
}

}  // namespace
}  // namespace bms::diagnosis
