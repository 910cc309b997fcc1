// What a diagnosis says about its causes.
#include "diagnosis/texts.hpp"

#include <gmock/gmock.h>

namespace bms::diagnosis {
namespace {

template <class... M>
Diagnosis with_causes() {
  Diagnosis d;
  d.verdict = Verdict::causes;
  d.explained_share = 0.98;
  for (const std::size_t m : {model::mechanism_index_of<M>...}) {
    Finding& f = d.findings.emplace_back();
    f.setting.index = m;
  }
  return d;
}

TEST(Texts, ManyChangesOfACellAreAlsoWhatAnotherCellsFileLooksLike) {
  const auto asks_for_the_file = ::testing::HasSubstr("the file of another cell");
  EXPECT_THAT(statement(with_causes<model::ResistanceGrowth, model::PolarisationGrowth, model::OcvHysteresis>(), {}),
              asks_for_the_file);
  EXPECT_THAT(statement(with_causes<model::ResistanceGrowth, model::CurrentOffset, model::InitialSoc>(), {}),
              ::testing::Not(asks_for_the_file))
      << "an instrument and a start";
}

Withheld withheld(std::size_t mechanism, double gain, double value = 0, double deviation = 0) {
  Withheld w;
  w.mechanism = w.setting.index = mechanism;
  w.gain = gain;
  w.setting.value[0] = value;
  w.setting.deviation[0] = deviation;
  return w;
}

/// Something does stand out from the tolerance, so its size is said although it is not named.
TEST(Texts, WhatIsWithheldOutsideOfTheHealthyRecordingsHasItsSize) {
  Diagnosis d;
  d.verdict = Verdict::not_testable;
  d.healthy = HealthyBasis{.hours = 3, .recordings = 1, .blocks = 6, .covered = {0.13, 0.13, {}}};
  d.withheld = {withheld(no_mechanism, 900), withheld(model::mechanism_index_of<model::Leakage>, 50),
                withheld(model::mechanism_index_of<model::CurrentGain>, 70, 0.06, 0.01),
                withheld(model::mechanism_index_of<model::VoltageOffset>, 90, 0.015, 0.002)};
  const std::string text = statement(d, {});
  EXPECT_THAT(text, ::testing::HasSubstr("15 ± 2 mV"));
  EXPECT_THAT(text, ::testing::HasSubstr("6.0 ± 1.0 %"));
  EXPECT_THAT(text, ::testing::HasSubstr(", next to a leakage."));
  EXPECT_THAT(text, ::testing::HasSubstr("only 13 % of the recording"));
  EXPECT_LT(text.find("15 ± 2 mV"), text.find("6.0 ± 1.0 %")) << "the larger gain first";
  EXPECT_THAT(text, ::testing::Not(::testing::HasSubstr("Nothing stands out")));
  d.withheld.resize(1);
  EXPECT_THAT(statement(d, {}), ::testing::HasSubstr("an unknown cause acts"));
  d.withheld.clear();
  EXPECT_THAT(statement(d, {}), ::testing::HasSubstr("Nothing stands out"));
}

}  // namespace
}  // namespace bms::diagnosis
