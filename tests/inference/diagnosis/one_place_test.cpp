// What shows in one place of a recording only is not blamed on a part without healthy recordings of the cell.
#include "diagnosis/one_place.hpp"

#include <cmath>

#include <gmock/gmock.h>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/texts.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

using ::testing::HasSubstr;

/// A discharge at 1C of the plant's cell, with a rest before it and after it.
std::vector<double> discharge() {
  std::vector<double> current_a(60, 0.0);
  current_a.resize(2'700, -6.0);
  current_a.resize(3'000, 0.0);
  return current_a;
}

TEST(OnePlace, AKneeAtTheEndOfADischargeIsNotNamed) {
  const auto knee = [](std::size_t k, double, double) { return k > 2'600 && k < 2'700 ? -0.03 : 0.0; };
  const Diagnosis d = diagnose(test::table9(), {}, {test::recorded(discharge(), 0.9, 21, knee)});
  EXPECT_EQ(d.verdict, Verdict::not_testable) << d.statement;
  EXPECT_TRUE(d.findings.empty());
  ASSERT_FALSE(d.withheld.empty());
  ASSERT_TRUE(d.withheld.front().only_place);
  EXPECT_GE(d.withheld.front().only_place->end_s, 2'600);
  EXPECT_TRUE(d.withheld.front().healthy.hours_needed);
  EXPECT_THAT(statement(d, {}), HasSubstr("no healthy recording of this cell says"));
}

TEST(OnePlace, WhatElseIsThereIsUnknown) {
  const auto knee_and_hum = [](std::size_t k, double, double) {
    return (k > 2'600 && k < 2'700 ? -0.03 : 0.0) + 0.002 * std::sin(2 * 3.14159265 * static_cast<double>(k) / 300);
  };
  const Diagnosis d = diagnose(test::table9(), {}, {test::recorded(discharge(), 0.9, 21, knee_and_hum)});
  EXPECT_EQ(d.withheld.size(), 1U) << "what the knee looks like";
  EXPECT_EQ(d.verdict, Verdict::unknown) << d.statement;
  EXPECT_EQ(d.law ? d.law->law : "", "voltage");
}

TEST(OnePlace, TheSameSizeEverywhereIsNamed) {
  const auto contact = [](std::size_t, double current_a, double) { return 0.005 * current_a; };
  const Diagnosis d = diagnose(test::table9(), {}, {test::recorded(discharge(), 0.9, 21, contact)});
  EXPECT_TRUE(names(d.verdict)) << d.statement;
  EXPECT_TRUE(d.withheld.empty());
}

TEST(OnePlace, AContactThatGoesAndComesUnderOneCurrentIsNamed) {
  const auto burst = [](std::size_t k, double current_a, double) {
    return k > 1'000 && k < 1'040 ? 0.01 * current_a : 0.0;
  };
  const Diagnosis d = diagnose(test::table9(), {}, {test::recorded(discharge(), 0.9, 22, burst)});
  ASSERT_EQ(d.findings.size(), 1U) << d.statement;
  EXPECT_EQ(model::catalogue[d.findings.front().setting.index].id, "contact_intermittent");
}

}  // namespace
}  // namespace bms::diagnosis
