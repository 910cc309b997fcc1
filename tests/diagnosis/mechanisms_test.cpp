// What is known of each mechanism of the catalogue.
#include "diagnosis/mechanism.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "diagnosis/texts.hpp"
#include "tests/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

TEST(Mechanisms, EachHasItsOwnWords) {
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    const MechanismText& text = text_of_mechanism(m);
    EXPECT_EQ(text.id, model::catalogue[m].id);
    EXPECT_NE(text.name, text.id) << "its file is missing in diagnosis/mechanisms/all.hpp";
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

}  // namespace
}  // namespace bms::diagnosis
