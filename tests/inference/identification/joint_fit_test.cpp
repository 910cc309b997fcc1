// The truth is the plant at several temperatures: its resistances follow the formulas below, which come from the
// description of the mechanisms and not from model/.
#include "identification/joint_fit.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <span>

#include "files/cell_file.hpp"
#include "identification/joint_structure.hpp"
#include "identification/variance_parts.hpp"
#include "plant/truth_cell.hpp"
#include "tests/inference/identification/plant.hpp"

namespace bms::identification {
namespace {

/// What the cell of a test does, at 25 degrees C.
struct Truth {
  double r0_ohm = 0.013, r1_ohm = 0.009, c1_f = 1'600;
  double r0_share = 0.4, r0_j_per_mol = 45'000, r1_j_per_mol = 35'000;
  double slow_ohm = 0, slow_s = 150;       ///< second pair, at the energy of the first
  double half_gap_v = 0, play_soc = 0.05;  ///< hysteresis: a play operator
};

struct Trip {
  double temperature_c = 25;
  double r0_change = 0;         ///< of this recording
  double branch_position = 0;   ///< at its start
  double current_offset_a = 0;  ///< that the sensor reads too much
  unsigned seed = 1;
};

double arrhenius(double j_per_mol, double temperature_c) {
  return std::exp(j_per_mol / 8.314462618 * (1 / (temperature_c + 273.15) - 1 / 298.15));
}

plant::MonotoneCurve constant(double value) { return plant::MonotoneCurve({{0, value}, {1, value}}); }

/// Three hours from 80 to 20 % of charge, discharging three times as much as charging, with 1 mV of noise.
JointRecording recorded(const Truth& truth, const Trip& trip, std::vector<double>* soc = nullptr) {
  plant::CellParameters p;
  p.step_s = 0.5;
  const double at = arrhenius(truth.r1_j_per_mol, trip.temperature_c);
  const double r0_ohm =
      truth.r0_ohm * (1 - truth.r0_share + truth.r0_share * arrhenius(truth.r0_j_per_mol, trip.temperature_c));
  p.circuit = {constant(r0_ohm * (1 + trip.r0_change)), constant(truth.r1_ohm * at), constant(truth.c1_f)};
  plant::Cell cell(p, {0.8, 0, trip.temperature_c});
  std::mt19937_64 random(trip.seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::normal_distribution<double> noise(0, 0.001);
  JointRecording r{"at " + std::to_string(trip.temperature_c), {}, {}, 0.8, 0};
  r.data.capacity_ah = p.capacity_ah;
  constexpr double row_s = 2;
  double slow_v = 0, h = trip.branch_position, soc_before = 0.8, current_a = 0, left_s = 60;
  for (double time_s = 0; cell.soc() > 0.2 && time_s < 40'000; time_s += row_s) {
    if (time_s > 0) {
      if (left_s <= 0) {
        const double kind = uniform(random), size_a = 1 + 5 * uniform(random);
        current_a = kind < 0.25 ? size_a : -size_a;
        if (kind > 0.8) current_a = 0;
        left_s = 6 + 60 * uniform(random);
      }
      left_s -= row_s;
      cell.run(current_a, trip.temperature_c, row_s);
      const double alpha = 1 - std::exp(-row_s / truth.slow_s);
      slow_v += alpha * (truth.slow_ohm * at * current_a - slow_v);
      h = std::clamp(h + (cell.soc() - soc_before) / truth.play_soc, -1.0, 1.0);
      soc_before = cell.soc();
    }
    r.data.time_s.edit().push_back(time_s);
    r.data.current_a.edit().push_back(current_a + trip.current_offset_a);
    r.data.voltage_v.edit().push_back(cell.voltage_v() + slow_v + truth.half_gap_v * h + noise(random));
    r.temperature_c.edit().push_back(trip.temperature_c);
    if (soc != nullptr) soc->push_back(cell.soc());
  }
  return r;
}

model::CellParameters<> start_cell(double half_gap_v = 0) {
  model::CellParameters<> cell = files::read_cell("table9").parameters;
  cell.rc = {};
  cell.rc.soc.push_back(0.5);
  cell.rc.r0_ohm.push_back(0.02);
  cell.rc.r1_ohm.push_back(0.02);
  cell.rc.c1_f.push_back(2'000);
  cell.reference_temperature_c = 25;
  for (std::size_t k = 0; half_gap_v > 0 && k < cell.ocv.soc.size; ++k) cell.ocv.half_gap_v.push_back(half_gap_v);
  return cell;
}

std::vector<model::MechanismSetting> hysteresis(const model::CellParameters<>& cell, double half_gap_v) {
  model::MechanismSetting m = model::default_setting(model::mechanism_index("ocv_hysteresis"), cell);
  m.value[0] = half_gap_v;
  m.value[4] = 1;  // between the measured branches
  return {m};
}

std::vector<JointRecording> at_temperatures(const Truth& truth, const std::vector<double>& all_c) {
  std::vector<JointRecording> recordings;
  unsigned seed = 1;
  for (const double c : all_c) recordings.push_back(recorded(truth, {.temperature_c = c, .seed = seed++}));
  return recordings;
}

double value_of(const JointModel& model, const JointFit& fit, const std::string& name) {
  for (std::size_t k = 0; k < model.unknowns.size(); ++k) {
    if (model.unknowns[k].name() == name) return fit.value[static_cast<Eigen::Index>(k)];
  }
  ADD_FAILURE() << "no unknown " << name;
  return 0;
}

const JointCandidate& one_pair(const std::vector<JointCandidate>& all) { return all[0]; }
const JointCandidate& two_pairs(const std::vector<JointCandidate>& all) { return all[1]; }

TEST(JointFit, FindsTheCircuitAndItsActivationEnergiesFromSeveralTemperatures) {
  const Truth truth;
  const auto recordings = at_temperatures(truth, {-10, 5, 25, 45});
  const auto candidates = joint_candidates(start_cell(), {}, recordings);
  const JointModel& model = one_pair(candidates).model;
  const JointFit fit = fit_joint(model, recordings, {});
  EXPECT_TRUE(fit.optimum.converged) << fit.optimum.reason;
  const struct {
    const char* name;
    double expected, tolerance;
  } cases[] = {{"r0_ohm", truth.r0_ohm, 0.01},
               {"r1_ohm", truth.r1_ohm, 0.02},
               {"c1_f", truth.c1_f, 0.04},
               {"temperature_resistance.r0_activation_j_per_mol", truth.r0_j_per_mol, 0.05},
               {"temperature_resistance.r0_share", truth.r0_share, 0.07},
               {"temperature_resistance.r1_activation_j_per_mol", truth.r1_j_per_mol, 0.02}};
  for (const auto& c : cases) EXPECT_NEAR(value_of(model, fit, c.name) / c.expected, 1, c.tolerance) << c.name;
  for (const double v : fit.rmse_v) EXPECT_LT(v, 0.0016) << "1 mV of noise, and lines for the smooth OCV";
  for (const RecordingState& s : fit.states) EXPECT_NEAR(s.r0_change, 0, 0.02);
}

TEST(JointFit, AChangedContactStaysWithItsRecording) {
  const Truth truth;
  std::vector<JointRecording> recordings = at_temperatures(truth, {25, 25.5, 24.5, 25, 25});
  recordings[2] = recorded(truth, {.temperature_c = 24.5, .r0_change = 0.3, .seed = 9});
  const auto candidates = joint_candidates(start_cell(), {}, recordings);
  const JointModel& model = one_pair(candidates).model;
  const JointFit fit = fit_joint(model, recordings, {});
  const double r0_ohm = value_of(model, fit, "r0_ohm");
  for (std::size_t k = 0; k < recordings.size(); ++k) {
    const double expected = truth.r0_ohm * (k == 2 ? 1.3 : 1) * (1 - 0.4 + 0.4 * arrhenius(45'000, 25));
    EXPECT_NEAR(r0_ohm * (1 + fit.states[k].r0_change) / expected, 1, 0.02) << k;
  }
  // four recordings of 1 and one of 1.3: the squares of the relative changes are least at sum of squares over sum
  EXPECT_NEAR(r0_ohm / truth.r0_ohm, (4 + 1.3 * 1.3) / (4 + 1.3), 0.02);
}

TEST(JointFit, TheInitialBranchBelongsToTheRecordingAndThePlayToTheCell) {
  const double half_gap_v = 0.015;
  const Truth truth{.half_gap_v = half_gap_v, .play_soc = 0.06};
  const std::vector<JointRecording> recordings = {recorded(truth, {.branch_position = 0.8, .seed = 2}),
                                                  recorded(truth, {.branch_position = -0.7, .seed = 3})};
  const auto cell = start_cell(half_gap_v);
  const auto candidates = joint_candidates(cell, hysteresis(cell, half_gap_v), recordings);
  const JointModel& model = one_pair(candidates).model;
  const JointFit fit = fit_joint(model, recordings, {});
  EXPECT_NEAR(fit.states[0].branch_position, 0.8, 0.1);
  EXPECT_NEAR(fit.states[1].branch_position, -0.7, 0.1);
  EXPECT_NEAR(1 / value_of(model, fit, "ocv_hysteresis.decay"), truth.play_soc, 0.006);
  EXPECT_EQ(with_values(model, fit.value).mechanisms[0].value[3], 0)
      << "a state of a recording is not a value of a cell";
}

TEST(JointFit, StandardDeviationsCoverTheTruth) {
  const Truth truth;
  int inside = 0, all = 0;
  for (unsigned trial = 0; trial < 5; ++trial) {
    std::vector<JointRecording> recordings;
    for (unsigned k = 0; k < 3; ++k)
      recordings.push_back(recorded(truth, {.temperature_c = -5 + 20.0 * k, .seed = 100 + 10 * trial + k}));
    const auto candidates = joint_candidates(start_cell(), {}, recordings);
    const JointModel& model = one_pair(candidates).model;
    const JointFit fit = fit_joint(model, recordings, {});
    const double expected[] = {truth.r0_ohm,       truth.r1_ohm,   truth.c1_f,
                               truth.r0_j_per_mol, truth.r0_share, truth.r1_j_per_mol};
    for (Eigen::Index k = 0; k < 6; ++k) {
      ASSERT_GT(fit.std[k], 0);
      inside += std::abs(fit.value[k] - expected[k]) < 3 * fit.std[k] ? 1 : 0;
      ++all;
    }
  }
  EXPECT_GE(inside, all * 8 / 10);
}

TEST(JointFit, WhatRecordingsDoNotShowIsKnownToBeWithinItsBounds) {
  JointRecording idle = recorded(Truth(), {.temperature_c = 25, .seed = 3});
  for (double& a : idle.data.current_a.edit()) a = 0;
  JointFit fit;
  const auto candidates = joint_candidates(start_cell(), {}, std::vector<JointRecording>{idle});
  const JointModel& model = one_pair(candidates).model;
  ASSERT_NO_THROW(fit = fit_joint(model, std::vector<JointRecording>{idle}, {}));
  for (std::size_t k = 0; k < model.unknowns.size(); ++k) {
    const JointUnknown& u = model.unknowns[k];
    const double sigma = fit.std[static_cast<Eigen::Index>(k)];
    EXPECT_TRUE(sigma >= 0 && sigma <= (u.high - u.low) / std::sqrt(12.0)) << u.name() << " " << sigma;
  }
}

TEST(JointFit, TheCurrentCorrectionIsTheOffsetThatTheReferenceShows) {
  for (const double offset_a : {-0.05, 0.0, 0.03}) {
    std::vector<double> soc;
    const JointRecording r = recorded({}, {.current_offset_a = offset_a}, &soc);
    EXPECT_NEAR(current_correction_a(r.data, soc, 0.8), -offset_a, 1e-6) << offset_a;
  }
}

TEST(JointFit, RefusesARecordingWithoutAVoltage) {
  std::vector<JointRecording> recordings = at_temperatures({}, {25});
  const auto candidates = joint_candidates(start_cell(), {}, recordings);
  for (double& v : recordings[0].data.voltage_v.edit()) v = std::nan("");
  EXPECT_THROW(fit_joint(candidates[0].model, recordings, {}), std::invalid_argument);
  EXPECT_THROW(fit_joint(candidates[0].model, {}, {}), std::invalid_argument);
}

TEST(JointStructure, TakesTheSecondPairOnlyWhereTheCellHasOne) {
  const struct {
    double slow_ohm;
    const char* expected;
  } cases[] = {{0, "one RC pair"}, {0.012, "two RC pairs"}};
  for (const auto& c : cases) {
    const auto recordings = at_temperatures({.slow_ohm = c.slow_ohm}, {-10, 10, 25, 40});
    const auto choice = choose_structure(joint_candidates(start_cell(), {}, recordings), recordings, {});
    EXPECT_EQ(choice.candidates[choice.chosen].name, c.expected);
    EXPECT_EQ(choice.left_out, "temperature");
    EXPECT_EQ(choice.parts.size(), 4U);
    for (const CandidateResult& of : choice.candidates) EXPECT_EQ(of.left_out_rmse_v.size(), 4U) << of.name;
    EXPECT_LT(choice.candidates[choice.chosen].left_out_v, 0.003) << "a temperature that was not seen";
  }
}

/// The cell has one pair, and the candidate with one cannot fit it: the one with two does, and its second pair goes to
/// the least resistance. What is left is one pair, from where that fit was.
TEST(JointStructure, ASecondPairAtTheLeastResistanceIsNoPair) {
  const std::vector<JointRecording> recordings = at_temperatures({}, {25, 25});
  auto candidates = joint_candidates(start_cell(), {}, recordings);
  candidates.resize(2);
  candidates[0].model.unknowns[0].low = 0.015;  // R0, which is 13 mOhm
  candidates[0].model.unknowns[0].start = 0.02;
  JointUnknown& slow = candidates[1].model.unknowns[3];
  ASSERT_EQ(slow.name(), "slow_polarisation.resistance_ohm");
  slow.low = 0.002;
  const auto choice = choose_structure(candidates, recordings, {.rows = 300});
  EXPECT_LT(choice.candidates[1].left_out_v, choice.candidates[0].left_out_v) << "or this test shows nothing";
  EXPECT_EQ(choice.candidates[1].name, "two RC pairs: its second pair has no resistance, so it is left out");
  EXPECT_EQ(choice.chosen, 0U);
  EXPECT_EQ(choice.model.mechanisms.size(), 0U);
}

TEST(JointStructure, LeavesOutWhatTheRecordingsAllow) {
  const struct {
    std::vector<double> all_c;
    const char* expected;
    std::size_t parts, left_out;
  } cases[] = {{{25}, "second half", 1, 1},
               {{25, 25}, "recording", 2, 2},
               {{5, 25}, "second half", 1, 2},
               {{5, 5, 25, 25}, "recording", 4, 4},
               // parts of 5 and of 45 degrees C, both of 25, and then 5 and 45 as a whole
               {{5, 25, 26, 45}, "temperature", 3, 6}};
  for (const auto& c : cases) {
    const auto recordings = at_temperatures({}, c.all_c);
    auto candidates = joint_candidates(start_cell(), {}, recordings);
    candidates.resize(1);
    const auto choice = choose_structure(candidates, recordings, {.rows = 300});
    EXPECT_EQ(choice.left_out, c.expected) << c.all_c.size();
    EXPECT_EQ(choice.parts.size(), c.parts) << c.all_c.size();
    EXPECT_EQ(choice.left_outs.size(), c.left_out);
  }
}

// Of many cells whose errors grow differently, two edges seen, the error beyond a third: the plain RMS of the two would
// hold 80 % of them inside two sigma.
TEST(JointStructure, TheGrowthFromTwoEdgesHoldsTheErrorBeyondThem) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> scale(0.02, 0.3);
  constexpr int cells = 20'000;
  int inside = 0, by_rms = 0;
  for (int k = 0; k < cells; ++k) {
    const double of_cell = scale(random);
    const std::array edges{of_cell * normal(random), of_cell * normal(random)};
    const double next = std::abs(of_cell * normal(random));
    inside += next <= 2 * growth_outside(edges) ? 1 : 0;
    by_rms += next <= 2 * std::hypot(edges[0], edges[1]) / std::sqrt(2) ? 1 : 0;
  }
  EXPECT_GT(inside, 0.93 * cells);
  EXPECT_LT(inside, 0.99 * cells);
  EXPECT_LT(by_rms, 0.85 * cells);
  EXPECT_EQ(growth_outside({}), 0);
}

TEST(JointStructure, AnEdgeWithManyRecordingsCountsOnce) {
  const std::array<GrowthAt, 5> outside = {{{-10, 0.3}, {-9, 0.3}, {-10.5, 0.3}, {-10, 0.3}, {45, 0.1}}};
  const std::vector<double> edges = by_edge(outside);
  ASSERT_EQ(edges.size(), 2U);
  EXPECT_NEAR(edges[0], 0.3, 1e-12);
  EXPECT_NEAR(edges[1], 0.1, 1e-12);
  EXPECT_EQ(by_edge(std::span(outside).first(4)).size(), 1U);
  EXPECT_TRUE(by_edge({}).empty());
}

TEST(JointStructure, SeparatesAWrongResistanceFromAWrongSocAxis) {
  const Truth truth{.slow_ohm = 0.01};
  const auto recordings = at_temperatures(truth, {25});
  const auto candidates = joint_candidates(start_cell(), {}, recordings);
  const JointModel found =
      with_values(two_pairs(candidates).model, fit_joint(two_pairs(candidates).model, recordings, {}).value);
  const LeftOutError right = left_out_error(found, recordings[0], {});
  EXPECT_NEAR(right.resistance_error, 0, 0.02);
  EXPECT_NEAR(right.soc_error, 0, 0.003);

  JointModel larger = found;  // by a fifth
  larger.cell.rc.r0_ohm[0] *= 1.2;
  larger.cell.rc.r1_ohm[0] *= 1.2;
  larger.cell.rc.c1_f[0] /= 1.2;
  for (auto& m : larger.mechanisms) {
    if (m.index == model::mechanism_index("slow_polarisation")) m.value[0] *= 1.2;
  }
  const LeftOutError resistance = left_out_error(larger, recordings[0], {});
  EXPECT_NEAR(resistance.resistance_error, 0.2 / 1.2, 0.02) << "relative to the model's overpotential";
  EXPECT_LT(resistance.rest_v, 0.25 * resistance.rmse_v);

  JointRecording shifted = recordings[0];
  shifted.initial_soc += 0.02;
  const LeftOutError axis = left_out_error(found, shifted, {});
  EXPECT_NEAR(axis.soc_error, 0.02, 0.008);
  EXPECT_NEAR(axis.resistance_error, 0, 0.05);
}

TEST(JointStructure, ErrorsGrowWithTheDistanceFromTheTemperaturesOfTheFit) {
  const auto recordings = at_temperatures({}, {-10, 10, 25, 40});
  const auto candidates = joint_candidates(start_cell(), {}, recordings);
  const auto choice = choose_structure({one_pair(candidates)}, recordings, {.rows = 500});
  // 1 / k (1 / 263.15 - 1 / 283.15) and 1 / k (1 / 298.15 - 1 / 313.15) in 1/eV, k = 8.617e-5 eV/K
  const double expected[] = {0, 0, 0, 0, 3.115, 1.864};  // parts of the edges, the two between, the edges as a whole
  ASSERT_EQ(choice.left_outs.size(), 6U);
  for (std::size_t k = 0; k < 6; ++k) EXPECT_NEAR(choice.left_outs[k].beyond_per_ev, expected[k], 0.002) << k;
}

}  // namespace
}  // namespace bms::identification
