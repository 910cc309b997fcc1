// Identifications from files, as `bms identify` makes them, of cells whose truth is known (identify_trial.hpp).
// identify_trials has many more of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "files/temporary_folder.hpp"
#include "tests/host_sim/workflow/identify_trial.hpp"
#include "workflow/cell_size.hpp"

namespace bms::workflow {
namespace {

/// Of the values at 30 to 90 %.
void expect_truth(const TrialResult& found, const std::string& name, double largest_error) {
  int judged = 0;
  for (const Judged& j : found.judged) {
    if (j.name != name || j.soc < 0.25 || j.soc > 0.95) continue;
    ++judged;
    EXPECT_LT(std::abs(j.relative()), largest_error) << name << " at " << j.soc;
    EXPECT_LT(std::abs(j.sigmas()), 3.5) << name << " at " << j.soc << ": " << j.value << " +- " << j.std;
  }
  EXPECT_EQ(judged, 7) << name;
}

// R1 triples below 20 %: a model with one R1 is off by 24 mV, and nodes tied as strongly as that moved R0 into R1.
TEST(IdentifyCell, FindsR0OfATestToEmptyWhereR1RisesThreefold) {
  const files::TemporaryFolder folder;
  for (const OcvSource ocv : {OcvSource::slow_runs, OcvSource::rests}) {
    const TrialResult found = run_trial(plant::table9_of(100), {"ocv_10min_rest", 1, 0, ocv}, folder.path());
    SCOPED_TRACE(ocv == OcvSource::rests ? "rests" : "slow runs");
    expect_truth(found, "r0_ohm", 0.02);
    expect_truth(found, "r1_ohm", 0.05);
    EXPECT_LE(found.cost, found.truth_cost);
  }
}

TEST(IdentifyCell, ReportsItsStages) {
  IdentifyOptions options;
  options.recordings = {BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv"};
  options.window = {0.6, 0.5};
  options.extend = true;
  options.healthy = options.recordings;
  options.out = options.name = "stages";
  std::vector<std::string> stages;
  double latest = 0;
  options.progress = [&](double done, const std::string& what) {
    EXPECT_GE(done, latest) << what;
    latest = done;
    stages.push_back(what);
  };
  identify_cell(options);
  EXPECT_EQ(latest, 1);
  for (const char* stage : {"reading the recordings", "R0, R1, C1 over the state of charge",
                            "the circuit over all recordings", "identified without forklift_shift.csv"})
    EXPECT_THAT(stages, ::testing::Contains(stage));
}

/// The start values may be those of any cell, and recordings do not show what a maker allows.
TEST(IdentifyCell, TakesNoPulseRatingsFromTheStartValues) {
  files::CellFile start = files::read_cell("table9");
  start.pulses = {25, {12, 9}, {18, 12}};
  start.sources["pulses"] = "another cell";
  for (const auto& [capacity_ah, chemistry] : {std::pair(0.0, ""), {6.5, ""}, {6.0, "LFP"}}) {
    IdentifyOptions options;
    options.chemistry = chemistry;
    options.start_cell = start;
    options.recordings = {BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv"};
    options.window = {0.6, 0.5};
    options.capacity_ah = capacity_ah;
    options.out = options.name = "another";
    const IdentifyResult found = identify_cell(options);
    ASSERT_TRUE(found.cell_file);
    EXPECT_FALSE(found.cell_file->pulses.stated()) << capacity_ah;
    EXPECT_EQ(files::cell_text(*found.cell_file).find("pulses"), std::string::npos) << capacity_ah;
  }
}

/// A file whose ratings are equal to their bounds is accepted, also after it was scaled.
TEST(CellSize, PulseRatingsThatAreEqualToTheirBoundsStayAccepted) {
  std::mt19937 random(29);
  std::uniform_real_distribution<double> limit(0.1, 300), size(0.02, 900);
  for (int k = 0; k < 200; ++k) {
    files::CellFile cell = files::read_cell("table9");
    double& charge_a = cell.parameters.limits.charge_current_max_a;
    double& discharge_a = cell.parameters.limits.discharge_current_max_a;
    charge_a = limit(random);
    discharge_a = limit(random);
    const double pulse_a = 1.1 * discharge_a;
    cell.pulses = {-20, {charge_a, charge_a}, {pulse_a, k % 2 == 0 ? pulse_a : discharge_a}};
    scale_to(size(random), cell);
    const files::CellFile again = files::parse_cell(files::cell_text(cell), "again");
    EXPECT_EQ(again.pulses.charge.for_10s_a, again.parameters.limits.charge_current_max_a);
    EXPECT_GE(again.pulses.discharge.for_10s_a, again.parameters.limits.discharge_current_max_a);
  }
}

}  // namespace
}  // namespace bms::workflow
