// Faults as large as real instruments have: a divider with a wrong resistor, an amplifier that has lost its reference,
// a shunt of another value.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <string_view>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/fit_parameters.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

/// A drive with its current and voltage changed.
PreparedRecording with_fault(double current_gain, double current_offset_a, double voltage_gain,
                             double voltage_offset_v) {
  PreparedRecording r = test::recorded(test::drive(1, 310), 0.7, 310);
  for (double& a : r.current_a.edit()) a = a * (1 + current_gain) + current_offset_a;
  for (double& v : r.voltage_v.edit()) v = v * (1 + voltage_gain) + voltage_offset_v;
  return r;
}

TEST(LargeFaults, OfInstrumentsAreNamedWithTheirSize) {
  struct Case {
    std::string_view id;
    double size;
    PreparedRecording recording;
  };
  for (const Case& c :
       {Case{"current_gain", 0.35, with_fault(0.35, 0, 0, 0)}, Case{"current_offset", 1.5, with_fault(0, 1.5, 0, 0)},
        Case{"voltage_gain", -0.12, with_fault(0, 0, -0.12, 0)},
        Case{"voltage_offset", 0.3, with_fault(0, 0, 0, 0.3)}}) {
    const Diagnosis d = diagnose(test::table9(), {}, {c.recording});
    ASSERT_TRUE(names(d.verdict)) << c.id << ": " << name_of(d.verdict);
    const Finding& first = d.findings.front();
    EXPECT_EQ(model::catalogue[first.setting.index].id, c.id);
    EXPECT_NEAR(first.setting.value[0], c.size, 0.05 * std::abs(c.size)) << c.id;
  }
}

TEST(LargeFaults, WhatIsRareCostsAsItsLogarithm) {
  const model::CellParameters<> cell = test::table9();
  Hypothesis h = with({}, model::mechanism_index_of<model::VoltageOffset>, cell);
  const FitParameters parameters(cell, h);
  const auto cost = [&](double offset_v) {
    parameters.of(h, 0) = offset_v;
    return parameters.prior(h);
  };
  EXPECT_EQ(cost(0.02), 0) << "common";
  EXPECT_NEAR(cost(0.05), 9, 1e-9) << "three times 10 mV beyond it";
  EXPECT_NEAR(cost(-0.32), 9 + 18 * std::log(10), 1e-9);
  constexpr double at_v = 0.2, step_v = 1e-6;
  const PriorDistance d = parameters.prior_distance(0, at_v);
  EXPECT_NEAR(2 * d.away / d.sigma, (cost(at_v + step_v) - cost(at_v - step_v)) / (2 * step_v), 1e-3);
}

}  // namespace
}  // namespace bms::diagnosis
