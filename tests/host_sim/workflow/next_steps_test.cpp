// The command that diagnoses an experiment together with the recordings that asked for it.
#include "workflow/next_steps.hpp"

#include <gtest/gtest.h>

namespace bms::workflow {
namespace {

RecordingComparison starting_at(double soc, bool given) {
  RecordingComparison c;
  c.record.initial_soc = soc;
  c.record.initial_soc_given = given;
  return c;
}

const diagnosis::NextExperiment rate_steps = {.profile = "rate_steps",
                                              .capacity_ah = 6,
                                              .start_soc = 0.95,
                                              .step_s = 1,
                                              .duration_s = 9'000,
                                              .separates = {0, 1},
                                              .leaves = {},
                                              .gain = 50};

TEST(NextSteps, TheCommandHasTheOptionsOfTheFirstDiagnosis) {
  DiagnoseOptions o;
  o.cell = "my cell.toml";
  o.recordings = {"monday.csv", "it's tuesday.csv"};
  o.holdouts = {"friday.csv"};
  o.reading.map = {"current_a=I (A)"};
  o.reading.unit = {"voltage_v=mV"};
  o.reading.sign = files::CurrentSign::discharge_positive;
  EXPECT_EQ(joint_command(o, {starting_at(0.98, true), starting_at(0.5, true)}, rate_steps),
            "bms diagnose --cell 'my cell.toml' --recording monday.csv --recording 'it'\\''s tuesday.csv' "
            "--recording rate_steps_measured.csv --holdout friday.csv --initial-soc 0.98 0.5 0.95 "
            "--map 'current_a=I (A)' --unit voltage_v=mV --discharge-positive");
}

TEST(NextSteps, AStartThatNobodyHasGivenIsNotStated) {
  DiagnoseOptions o;
  o.cell = "table9";
  o.recordings = {"a.csv", "b.csv"};
  EXPECT_EQ(joint_command(o, {starting_at(0.98, true), starting_at(0.5, false)}, rate_steps),
            "bms diagnose --cell table9 --recording a.csv --recording b.csv --recording rate_steps_measured.csv");
}

TEST(NextSteps, SaysWhereNothingMoreCanBeLearned) {
  DiagnoseResult r;
  EXPECT_TRUE(next_steps(r).empty()) << "nothing is open";
  r.nothing_more = "No other experiment would.";
  EXPECT_EQ(next_steps(r), std::vector<std::string>{"No other experiment would."});
  r.nothing_more.clear();
  r.next = rate_steps;
  r.then = "bms diagnose";
  EXPECT_EQ(next_steps(r).back(), "bms diagnose");
}

}  // namespace
}  // namespace bms::workflow
