// Identification compared with the plant: different equations, noise on current and voltage.
#include "identification/identify.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/cell_file.hpp"
#include "tests/inference/identification/plant.hpp"

namespace bms::identification {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

model::CellParameters<> table9() { return files::read_cell("table9").parameters; }

/// Start values far from the truth.
model::CellParameters<> wrong_start() {
  model::CellParameters<> cell = table9();
  for (std::size_t k = 0; k < cell.rc.soc.size; ++k) {
    cell.rc.r0_ohm[k] = 0.03;
    cell.rc.r1_ohm[k] = 0.03;
    cell.rc.c1_f[k] = 6'000;
  }
  return cell;
}

DataSet record_of(const PlantRun& run, double initial_soc) {
  DataSet r;
  r.data = run.data;
  r.initial_soc = initial_soc;
  r.estimate_initial_v_rc = false;
  return r;
}

double truth_of(const plant::CircuitCurves& circuit, const Parameter& p) {
  if (p.name == "r0_ohm") return circuit.r0_ohm.at(p.soc);
  if (p.name == "r1_ohm") return circuit.r1_ohm.at(p.soc);
  return circuit.c1_f.at(p.soc);
}

TEST(Identify, RecoversTheTruthAtMidSocWithARealisticStandardDeviation) {
  const auto profile = *experiments::experiment("high_1m_low_30s");
  const PlantRun run = run_plant(profile, 0.5);
  const double soc = (run.soc_min + run.soc_max) / 2;
  const plant::CircuitCurves circuit = plant::table9_circuit();
  const double truths[3] = {circuit.r0_ohm.at(soc), circuit.r1_ohm.at(soc), circuit.c1_f.at(soc)};
  const double tolerance[3] = {0.01, 0.05, 0.05};
  constexpr int draws = 200;
  std::mt19937_64 random(7);
  int inside[3] = {};
  double mean[3] = {};
  for (int draw = 0; draw < draws; ++draw) {
    DataSet r = record_of(run, 0.5);
    r.data = noisy(run.data, random);
    GreyBoxOptions options;
    options.soc_nodes = {soc};
    const Identification found = identify_grey_box(wrong_start(), {r}, options, Method::trust_region_reflective);
    ASSERT_TRUE(found.optimum.converged) << found.optimum.reason;
    for (int k = 0; k < 3; ++k) {
      const Parameter& p = found.parameters[static_cast<std::size_t>(k)];
      mean[k] += p.value / draws;
      inside[k] += std::abs(p.value - truths[k]) <= 2 * p.std ? 1 : 0;
      ASSERT_NEAR(p.value, truths[k], tolerance[k] * truths[k]) << p.name << " in draw " << draw;
    }
  }
  for (int k = 0; k < 3; ++k) {
    EXPECT_GE(inside[k], 0.90 * draws) << k;
    EXPECT_LE(inside[k], 0.98 * draws) << k;
    EXPECT_NEAR(mean[k], truths[k], 0.2 * tolerance[k] * truths[k]) << k;
  }
}

TEST(Identify, IdentifiesTheTablesFromAShiftAndPredictsAnotherShift) {
  const auto shift = *experiments::experiment("forklift_shift", {6, 11}),
             other = *experiments::experiment("forklift_shift", {6, 12});
  std::mt19937_64 random(1);
  const PlantRun run = run_plant(shift, 0.98), unseen = run_plant(other, 0.98);
  DataSet r = record_of(run, 0.98);
  r.data = noisy(run.data, random);
  GreyBoxOptions options;
  options.soc_nodes = nodes_for(run.soc_min, run.soc_max);
  const Identification found = identify_grey_box(wrong_start(), {r}, options, Method::trust_region_reflective);
  const plant::CircuitCurves circuit = plant::table9_circuit();
  for (const Parameter& p : found.parameters) {
    if (p.soc < 0.35 || p.soc > 0.75) continue;
    const double is = truth_of(circuit, p);
    EXPECT_NEAR(p.value, is, (p.name == "r0_ohm" ? 0.015 : 0.08) * is) << p.name << " at " << p.soc;
  }
  DataSet validation = record_of(unseen, 0.98);
  validation.data = noisy(unseen.data, random);
  const FitStatistics fit = validate(found.cell, validation, found.fading);
  EXPECT_LT(fit.rmse_v, 0.0016);
  EXPECT_GT(fit.fit_percent, 95);
}

TEST(Identify, InitialSocOnThePlateauIsNotObservable) {
  // pulses on the plateau
  const PlantRun run = run_plant(*experiments::experiment("high_1m_low_30s"), 0.45);
  std::mt19937_64 random(3);
  DataSet r = record_of(run, 0.55);
  r.data = noisy(run.data, random);
  r.estimate_initial_soc = true;
  GreyBoxOptions options;
  options.soc_nodes = {0.45};
  const Identification found = identify_grey_box(table9(), {r}, options, Method::trust_region_reflective);
  EXPECT_FALSE(found.initial[0].observable);
  EXPECT_GT(found.initial[0].soc_std, observable_soc_std);
  EXPECT_THAT(found.warnings, Contains(StartsWith("initial_soc_not_observable: ")));
}

// The paper's own case: 40 %, where it found 29.17 %. There the pieces of Table 9 have a corner, and the bursts cross
// it: the state of charge is claimed, so it has to be right, on a cell with a hysteresis of 12 mV as well.
TEST(Identify, InitialSocNextToACornerOfTheOcvIsWithinItsUncertainty) {
  for (const double soc : {0.40, 0.41}) {
    for (const double half_gap_v : {0.0, 0.012}) {
      PlantRun run = run_plant(*experiments::experiment("high_1m_low_30s"), soc);
      double branch = -1;  // reached by discharge; the OCV of the cell file is in the middle
      for (std::size_t k = 1; k < run.data.size(); ++k) {
        const double i = run.data.current_a[k], target = i > 0 ? 1 : -1;
        branch = target + (branch - target) * std::exp(-40 * std::abs(i) / (3'600 * 6));
        run.data.voltage_v.edit()[k] += half_gap_v * branch;
      }
      std::mt19937_64 random(3);
      DataSet r = record_of(run, 0.55);
      r.data = noisy(run.data, random);
      r.estimate_initial_soc = true;
      GreyBoxOptions options;
      options.soc_nodes = {0.4};
      const Identification found = identify_grey_box(table9(), {r}, options, Method::trust_region_reflective);
      EXPECT_NEAR(found.initial[0].soc, soc, 2 * found.initial[0].soc_std) << soc << " " << half_gap_v;
    }
  }
}

TEST(Identify, InitialSocOnASlopeIsIdentified) {
  const PlantRun run = run_plant(*experiments::experiment("high_1m_low_30s"), 0.16);
  std::mt19937_64 random(3);
  DataSet r = record_of(run, 0.18);
  r.data = noisy(run.data, random);
  r.estimate_initial_soc = true;
  GreyBoxOptions options;
  options.soc_nodes = {0.15};
  const Identification found = identify_grey_box(table9(), {r}, options, Method::trust_region_reflective);
  EXPECT_TRUE(found.initial[0].observable);
  EXPECT_NEAR(found.initial[0].soc, 0.16, 2 * found.initial[0].soc_std);
  EXPECT_NEAR(found.initial[0].soc, 0.16, 0.01);
}

// An OCV that was taken from the same voltages moves its errors into R0 and R1, and out of the residuals.
TEST(Identify, AnErrorThatTheResidualsDoNotShowKeepsNodesAlike) {
  std::vector<experiments::ProfileRow> profile;
  for (int k = 0; k < 2'700; ++k) profile.push_back({static_cast<double>(k), k % 90 < 60 ? -6.0 : 0.0});
  const PlantRun run = run_plant(profile, 0.9);
  std::mt19937_64 random(3);
  DataSet r = record_of(run, 0.9);
  r.data = noisy(run.data, random);
  for (std::size_t k = 0; k < r.data.size(); ++k)
    r.data.voltage_v.edit()[k] += 0.01 * std::sin(static_cast<double>(k) / 90);
  const auto steps = [&](double hidden_v) {
    GreyBoxOptions options;
    options.soc_nodes = {0.4, 0.5, 0.6, 0.7, 0.8, 0.9};
    options.ocv_hidden_v = hidden_v;
    const auto& rc = identify_grey_box(table9(), {r}, options, Method::trust_region_reflective).cell.rc;
    double sum = 0;
    for (std::size_t k = 1; k < rc.soc.size; ++k) sum += std::pow(std::log(rc.r1_ohm[k] / rc.r1_ohm[k - 1]), 2);
    return std::sqrt(sum);
  };
  EXPECT_LT(steps(0.03), 0.8 * steps(0));
}

TEST(Identify, RejectsARestAndNamesTheExperimentThatIsNeeded) {
  DataSet r;
  for (int k = 0; k < 600; ++k) {
    r.data.time_s.edit().push_back(k);
    r.data.current_a.edit().push_back(0.001 * (k % 2));
    r.data.voltage_v.edit().push_back(3.3);
  }
  r.data.capacity_ah = 6;
  GreyBoxOptions options;
  options.soc_nodes = {0.5};
  try {
    identify_grey_box(table9(), {r}, options, Method::trust_region_reflective);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("so r0_ohm, r1_ohm and c1_f cannot be identified"));
    EXPECT_THAT(error.what(), HasSubstr("high_1m_low_30s"));
  }
}

TEST(Identify, OnePulseWithoutARestGivesAWarning) {
  std::vector<experiments::ProfileRow> profile;
  for (int k = 0; k < 32; ++k)
    profile.push_back({static_cast<double>(k), k >= 30 ? -6.0 : 0.0});  // two seconds, then it ends
  const PlantRun run = run_plant(profile, 0.5);
  std::mt19937_64 random(3);
  DataSet r = record_of(run, 0.5);
  r.data = noisy(run.data, random);
  GreyBoxOptions options;
  options.soc_nodes = {0.5};
  const Identification found = identify_grey_box(table9(), {r}, options, Method::trust_region_reflective);
  EXPECT_THAT(found.warnings, Contains(HasSubstr("_ohm at 50 %")));
  EXPECT_THAT(found.warnings, Contains(HasSubstr("high_1m_low_30s")));
}

TEST(Identify, AnInvertedCurrentEndsAtABoundAndGivesAWarning) {
  const PlantRun run = run_plant(*experiments::experiment("high_1m_low_30s"), 0.5);
  DataSet r = record_of(run, 0.5);
  for (double& i : r.data.current_a.edit()) i = -i;
  GreyBoxOptions options;
  options.soc_nodes = {0.5};
  const Identification found = identify_grey_box(table9(), {r}, options, Method::trust_region_reflective);
  EXPECT_THAT(found.warnings, Contains(HasSubstr("at_bound: r0_ohm at 50 %")));
}

TEST(Identify, NeighbouringNodesWithTheSameDoubtShareAWarning) {
  const PlantRun run = run_plant(*experiments::experiment("high_1m_low_30s"), 0.5);
  DataSet r = record_of(run, 0.5);
  for (double& i : r.data.current_a.edit()) i = -i;
  GreyBoxOptions options;
  options.soc_nodes = {0.49, 0.5, 0.51};
  const Identification found = identify_grey_box(table9(), {r}, options, Method::trust_region_reflective);
  EXPECT_THAT(found.warnings, Contains(HasSubstr("at_bound: r0_ohm at 49 to 51 % (3 points) ended at a bound")));
  EXPECT_THAT(found.warnings, Not(Contains(HasSubstr("r0_ohm at 50 %"))));
}

}  // namespace
}  // namespace bms::identification
