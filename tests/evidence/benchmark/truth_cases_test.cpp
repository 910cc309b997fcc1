#include "benchmark/truth/cases.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <numeric>
#include <set>
#include <string>

#include <gmock/gmock.h>

#include "benchmark/truth/calibration.hpp"
#include "benchmark/truth/case_files.hpp"
#include "benchmark/truth/detection_scale.hpp"
#include "benchmark/truth/effects.hpp"
#include "benchmark/truth/healthy_cells.hpp"

namespace bms::benchmark::truth {

namespace {

using ::testing::AnyOf;
using ::testing::StartsWith;

double ocv_of(const CalibratedCell& cell, double soc) {
  std::size_t k = 0;
  while (k + 2 < cell.ocv_soc.size() && soc >= cell.ocv_soc[k + 1]) ++k;
  return cell.ocv_b0_v[k] + cell.ocv_b1_v[k] * soc;
}

double at_node(const CalibratedCell& cell, const std::vector<double>& values, double soc) {
  if (soc <= cell.rc_soc.front()) return values.front();
  for (std::size_t k = 1; k < values.size(); ++k) {
    if (soc < cell.rc_soc[k])
      return std::lerp(values[k - 1], values[k], (soc - cell.rc_soc[k - 1]) / (cell.rc_soc[k] - cell.rc_soc[k - 1]));
  }
  return values.back();
}

/// The 1RC model of a cell file, written independently.
std::vector<double> simulate(const CalibratedCell& cell, const std::vector<double>& current_a, double step_s,
                             double soc) {
  std::vector<double> voltage_v;
  double v1_v = 0;
  for (std::size_t k = 0; k < current_a.size(); ++k) {
    if (k > 0) {
      const double r1 = at_node(cell, cell.r1_ohm, soc), c1 = at_node(cell, cell.c1_f, soc);
      v1_v = r1 * current_a[k] + (v1_v - r1 * current_a[k]) * std::exp(-step_s / (r1 * c1));
      soc += current_a[k] * step_s / 3'600 / cell.capacity_ah;
    }
    voltage_v.push_back(ocv_of(cell, soc) + v1_v + at_node(cell, cell.r0_ohm, soc) * current_a[k]);
  }
  return voltage_v;
}

Stimulus stimulus_of(std::vector<double> current_a) {
  Stimulus stimulus;
  stimulus.ambient_c.assign(current_a.size(), 25);
  stimulus.current_a = std::move(current_a);
  return stimulus;
}

Stimulus stretches(std::initializer_list<std::pair<double, int>> current_a_and_seconds) {
  std::vector<double> current_a = {0};
  for (const auto& [a, seconds] : current_a_and_seconds)
    current_a.insert(current_a.end(), static_cast<std::size_t>(seconds), a);
  return stimulus_of(std::move(current_a));
}

/// Columns of one length, time that rises, and an SOC within the allowed range.
void expect_valid(const Series& series, std::size_t fewest_rows) {
  const std::size_t rows = series.time_s.size();
  EXPECT_GE(rows, fewest_rows);
  EXPECT_LE(rows, 25'000u);
  EXPECT_EQ(series.current_a.size(), rows);
  EXPECT_EQ(series.voltage_v.size(), rows);
  EXPECT_EQ(series.soc.size(), rows);
  EXPECT_TRUE(series.temperature_c.empty() || series.temperature_c.size() == rows);
  EXPECT_TRUE(std::is_sorted(series.time_s.begin(), series.time_s.end(), std::less_equal<>{}));
  const auto [lowest, highest] = std::minmax_element(series.soc.begin(), series.soc.end());
  EXPECT_GE(*lowest, 0.025);
  EXPECT_LE(*highest, 0.985);
}

/// Returns true if a charging current raises the voltage.
bool voltage_follows_current(const Series& series) {
  double together = 0;
  for (std::size_t k = 1; k < series.time_s.size(); ++k)
    together += (series.current_a[k] - series.current_a[k - 1]) * (series.voltage_v[k] - series.voltage_v[k - 1]);
  return together > 0;
}

HealthyCell cell_of(std::uint64_t seed) {
  plant::Random random(seed);
  return draw_healthy_cell(random);
}

}  // namespace

TEST(TruthCases, AreTheSameForTheSameSplitSeedAndIndexInAnyOrder) {
  for (std::size_t index : {3u, 17u, 58u}) {
    const Case first = make_case(Split::development, 5, index);
    make_case(Split::final, 9, index);
    const Case again = make_case(Split::development, 5, index);
    EXPECT_EQ(csv_of(first.recording), csv_of(again.recording));
    EXPECT_EQ(csv_of(first.holdout), csv_of(again.holdout));
    EXPECT_EQ(cell_toml(first.cell, "c"), cell_toml(again.cell, "c"));
    EXPECT_EQ(first.answer.ids, again.answer.ids);
    EXPECT_EQ(first.given_initial_soc, again.given_initial_soc);
  }
}

TEST(TruthCases, OfOneSplitOrSeedAreNotThoseOfAnother) {
  for (std::size_t index = 0; index < 10; ++index) {
    const Case development = make_case(Split::development, 1, index);
    EXPECT_NE(development.cell.capacity_ah, make_case(Split::final, 1, index).cell.capacity_ah);
    EXPECT_NE(development.cell.capacity_ah, make_case(Split::development, 2, index).cell.capacity_ah);
  }
}

TEST(TruthCases, ContainEveryEffectAndAreValidInputOfADiagnosis) {
  std::map<CaseKind, int> kinds;
  std::set<std::string> singles, outside, faults;
  for (std::size_t index = 0; index < case_count(Split::development); ++index) {
    const Case c = make_case(Split::development, 1, index);
    SCOPED_TRACE(c.name + " " + name_of(c.answer.kind) + " " + (c.answer.ids.empty() ? "" : c.answer.ids.front()));
    ++kinds[c.answer.kind];
    if (c.answer.kind == CaseKind::single) singles.insert(c.answer.ids.at(0));
    if (c.answer.kind == CaseKind::outside) outside.insert(c.answer.ids.at(0));
    if (c.answer.kind == CaseKind::data_fault) faults.insert(c.answer.ids.at(0));
    if (c.answer.kind == CaseKind::pair) {
      EXPECT_GE(c.answer.strength, 2);
    }

    expect_valid(c.recording, 4'000);
    expect_valid(c.holdout, 1'000);
    const bool inverted = c.answer.kind == CaseKind::data_fault && c.answer.ids.at(0) == "inverted_current";
    EXPECT_EQ(voltage_follows_current(c.recording), !inverted);
    EXPECT_EQ(voltage_follows_current(c.holdout), !inverted);
    EXPECT_NEAR(c.holdout_initial_soc, c.holdout.soc.front(), 0.0026);
    const bool wrong_initial_soc = std::count(c.answer.ids.begin(), c.answer.ids.end(), "initial_soc") > 0;
    EXPECT_EQ(std::abs(c.given_initial_soc - c.recording.soc.front()) > 0.0051, wrong_initial_soc)
        << c.given_initial_soc - c.recording.soc.front();

    const CalibratedCell& cell = c.cell;
    ASSERT_EQ(cell.ocv_b0_v.size() + 1, cell.ocv_soc.size());
    EXPECT_THAT(cell.ocv_soc.size(), ::testing::AllOf(::testing::Ge(10u), ::testing::Le(21u)));
    EXPECT_EQ(cell.ocv_soc.front(), 0);
    EXPECT_EQ(cell.ocv_soc.back(), 1);
    for (std::size_t k = 0; k < cell.ocv_b1_v.size(); ++k) {
      EXPECT_GT(cell.ocv_b1_v[k], 1e-5);
      if (k > 0) {
        EXPECT_NEAR(cell.ocv_b0_v[k - 1] + cell.ocv_b1_v[k - 1] * cell.ocv_soc[k],
                    cell.ocv_b0_v[k] + cell.ocv_b1_v[k] * cell.ocv_soc[k], 1e-6);
      }
    }
  }
  EXPECT_EQ(kinds, (std::map<CaseKind, int>{{CaseKind::null, 36},
                                            {CaseKind::single, 48},
                                            {CaseKind::pair, 18},
                                            {CaseKind::outside, 12},
                                            {CaseKind::data_fault, 6}}));
  EXPECT_EQ(singles, std::set<std::string>(catalogue_ids().begin(), catalogue_ids().end()));
  EXPECT_EQ(outside, std::set<std::string>(outside_ids().begin(), outside_ids().end()));
  EXPECT_EQ(faults.size(), 5u);
}

// Without noise and calibration errors only the straight lines of the tables differ from the cell.
TEST(TruthCell, AgreesWithItsCalibrated1RcModelWhenItIsHealthy) {
  double worst_rms_v = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const HealthyCell cell = cell_of(seed);
    plant::Random random(seed);
    const CalibratedCell file = calibrate(cell, 0, random);
    EXPECT_EQ(file.capacity_ah, cell.capacity_ah);
    const Stimulus stimulus = stimulus_of(draw_current_a(
        {.profile = Profile::hppc, .capacity_ah = cell.capacity_ah, .start_soc = 0.95, .lowest_soc = 0.1}, random));
    const CellTrace trace = run_cell(cell, {}, stimulus, 0.95);
    const std::vector<double> model_v = simulate(file, stimulus.current_a, stimulus.step_s, 0.95);
    double sum = 0;
    for (std::size_t k = 0; k < model_v.size(); ++k)
      sum += (model_v[k] - trace.voltage_v[k]) * (model_v[k] - trace.voltage_v[k]);
    worst_rms_v = std::max(worst_rms_v, std::sqrt(sum / static_cast<double>(model_v.size())));
  }
  EXPECT_LT(worst_rms_v, 0.0013);
  EXPECT_GT(worst_rms_v, 0.0002) << "a truth that equals the model proves nothing";
}

TEST(TruthCell, KeepsItsHysteresisDuringARestWhileItsPolarisationDecays) {
  const HealthyCell cell = cell_of(4);
  const double i = cell.capacity_ah / 2;  // to 0.5 from above, and from below: 0.9 -> 0.5 -> 0.2 -> 0.5
  const Stimulus stimulus = stretches({{-i, 2'880}, {0, 20'000}, {-i, 2'160}, {i, 2'160}, {0, 20'000}});
  const std::size_t from_above = 2'880 + 20'000, from_below = stimulus.current_a.size() - 1;
  const auto gap_v = [&](const CellEffects& effects) {
    const CellTrace trace = run_cell(cell, effects, stimulus, 0.9);
    return trace.voltage_v[from_below] - trace.voltage_v[from_above];
  };
  CellEffects hysteretic, slow;
  hysteretic.hysteresis = {.half_width = {0.005, 0.03}, .share = {0.5, 0.5}, .half_gap_v = 0.01};
  slow.diffusion = {.resistance_ohm = 0.01 / i, .time_s = 2'000, .lag_s = 20};
  EXPECT_NEAR(gap_v({}), 0, 1e-6);
  EXPECT_NEAR(gap_v(hysteretic), 0.02, 1e-6);
  EXPECT_NEAR(gap_v(slow), 0, 1e-5);
  const CellTrace polarised = run_cell(cell, slow, stimulus, 0.9), healthy = run_cell(cell, {}, stimulus, 0.9);
  EXPECT_NEAR(polarised.voltage_v[2'880] - healthy.voltage_v[2'880], -0.01, 2e-4)
      << "steady state after 1.4 times the diffusion time";
}

TEST(TruthCell, WithChargeTransferHasItsCalibratedResistanceAtSmallCurrentsOnly) {
  const HealthyCell cell = cell_of(7);
  CellEffects effects;
  effects.charge_transfer = {.share_of_r0 = 0.4, .share_of_r1 = 1, .alpha = 0.4};
  const auto drop_of_healthy = [&](double rate) {
    const Stimulus stimulus = stretches({{-rate * cell.capacity_ah, 60}});
    const double rest_v = cell.ocv_v.at(0.6);
    const CellTrace healthy = run_cell(cell, {}, stimulus, 0.6), real = run_cell(cell, effects, stimulus, 0.6);
    const double ocv_change_v = cell.ocv_v.at(healthy.soc.back()) - rest_v;
    return (real.voltage_v.back() - rest_v - ocv_change_v) / (healthy.voltage_v.back() - rest_v - ocv_change_v);
  };
  EXPECT_NEAR(drop_of_healthy(0.005), 1, 0.01);
  EXPECT_LT(drop_of_healthy(4), 0.85);
}

TEST(TruthCell, ReachesTheSteadyStateOfTheButlerVolmerEquation) {
  const HealthyCell cell = cell_of(7);
  const double current_a = -2 * cell.capacity_ah, thermal_v = 0.025693;  // RT/F at 25 degrees C
  const Stimulus stimulus = stretches({{current_a, 200}});
  for (double alpha : {0.35, 0.5, 0.65}) {
    CellEffects effects;
    effects.charge_transfer = {.share_of_r0 = 0.3, .share_of_r1 = 0.6, .alpha = alpha};
    const CellTrace trace = run_cell(cell, effects, stimulus, 0.7);
    const double soc = trace.soc.back();
    const auto current_of = [&](double overvoltage_v, double ohm) {
      return thermal_v / ohm *
             (std::exp((1 - alpha) * overvoltage_v / thermal_v) - std::exp(-alpha * overvoltage_v / thermal_v));
    };
    const double r1_ohm = cell.r1_ohm.at(soc), in_r1_v = trace.v1_v.back() - 0.4 * r1_ohm * current_a;
    EXPECT_NEAR(current_of(in_r1_v, 0.6 * r1_ohm) / current_a, 1, 0.015);  // C1 lags behind R1, which moves with soc
    const double in_r0_v =
        trace.voltage_v.back() - cell.ocv_v.at(soc) - trace.v1_v.back() - 0.7 * cell.r0_ohm.at(soc) * current_a;
    EXPECT_NEAR(current_of(in_r0_v, 0.3 * cell.r0_ohm.at(soc)) / current_a, 1, 1e-4);
  }
}

TEST(DetectionScale, IsProportionalToTheDifferenceAndSmallForCalibrationErrors) {
  const HealthyCell cell = cell_of(3);
  plant::Random random(3);
  const Stimulus stimulus = stimulus_of(
      draw_current_a({.profile = Profile::hppc, .capacity_ah = cell.capacity_ah, .start_soc = 0.95}, random));
  const CellTrace trace = run_cell(cell, {}, stimulus, 0.95);
  const DetectionScale detection_scale(cell, stimulus, trace, 0.001);

  CellEffects grown;
  grown.growth.of_r0 = 0.02;
  std::vector<double> d = run_cell(cell, grown, stimulus, 0.95).voltage_v;
  for (std::size_t k = 0; k < d.size(); ++k) d[k] -= trace.voltage_v[k];
  EXPECT_LT(detection_scale.strength(d), 0.7) << "2 % of R0 is within the tolerance";
  std::vector<double> tenfold = d;
  for (double& v : tenfold) v *= 10;
  EXPECT_NEAR(detection_scale.strength(tenfold), 10 * detection_scale.strength(d), 1e-6);
  EXPECT_NEAR(detection_scale.cosine_similarity(d, tenfold), 1, 1e-9);

  std::vector<double> elsewhere = run_cell(cell, {}, stimulus, 0.945).voltage_v;
  for (std::size_t k = 0; k < d.size(); ++k) elsewhere[k] -= trace.voltage_v[k];
  EXPECT_LT(detection_scale.strength(elsewhere), 0.25) << "0.5 % of start soc is one sigma";
}

TEST(CaseFiles, HaveAHeaderAndNoTemperatureColumnWithoutTemperatures) {
  Series series = {.time_s = {0, 1},
                   .current_a = {0, -1.5},
                   .voltage_v = {3.3, 3.28},
                   .temperature_c = {25, 25.1},
                   .soc = {0.9, 0.8999}};
  EXPECT_EQ(csv_of(series),
            "time_s,current_a,voltage_v,temperature_c,soc_ref\n0.00,0.0000,3.30000,25.00,0.900000\n1.00,-1.5000,3."
            "28000,25.10,0.899900\n");
  series.temperature_c.clear();
  EXPECT_THAT(csv_of(series), StartsWith("time_s,current_a,voltage_v,soc_ref\n0.00,0.0000,3.30000,0.900000\n"));
}

TEST(TruthSources, IncludeOnlyThemselvesThePlantEigenAndTheStandardLibrary) {
  int files = 0, includes = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(BMS_SOURCE_DIR "/evidence/benchmark/truth")) {
    const std::string extension = entry.path().extension();
    if (extension != ".cpp" && extension != ".hpp") continue;
    ++files;
    std::ifstream file(entry.path());
    for (std::string line; std::getline(file, line);) {
      if (!line.starts_with("#include ")) continue;
      ++includes;
      const std::string what = line.substr(9);
      EXPECT_THAT(what, AnyOf(StartsWith("\"benchmark/truth/"), StartsWith("\"plant/"), StartsWith("<")))
          << entry.path();
      // among includes in angle brackets only those of Eigen contain a slash
      if (what.starts_with("<")) {
        EXPECT_TRUE(what.find('/') == std::string::npos || what.starts_with("<Eigen/")) << entry.path() << ": " << what;
      }
    }
  }
  EXPECT_GE(files, 55);
  EXPECT_GE(includes, 150);
}

}  // namespace bms::benchmark::truth
