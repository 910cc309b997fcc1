// Parts of the study, each against an independent value.
#include <gtest/gtest.h>

#include <cmath>

#include "files/cell_file.hpp"
#include "identification/goodness_of_fit.hpp"
#include "identification/ocv_rest_test.hpp"
#include "study/best_experiment.hpp"
#include "study/diagnose_paper.hpp"
#include "study/paper_tables.hpp"
#include "study/table9_fit.hpp"

namespace bms::study {
namespace {

model::CellParameters<> table9() { return files::read_cell("table9").parameters; }

Bench quiet() {
  Bench b;
  b.voltage_noise_v = b.current_noise_a = 0;
  b.ocv_step_s = 5;
  return b;
}

TEST(GoodnessOfFit, IsEquationA6) {
  id::FitFigure fit;
  for (const double y : {1.0, 2.0, 3.0}) fit.add(y, y + 0.5);
  EXPECT_NEAR(fit.percent(), 100 * (1 - std::sqrt(0.75 / 2)), 1e-12);
}

TEST(OcvRestTest, CountsEveryRestOfBothDirections) {
  const auto rests = id::rested_voltages(run_ocv_test(10, quiet(), 1, true).data, 1);
  ASSERT_EQ(rests.size(), 22U);  // the first rest counts for both
  for (const id::RestedVoltage& r : rests) EXPECT_NEAR(r.voltage_v, true_ocv_v(r.soc), 1e-4) << r.soc;
}

TEST(OcvRestTest, TheBranchesOfACellWithHysteresisDiffer) {
  Bench bench = quiet();
  bench.left_out.half_gap_v = 0.012;
  const auto rests = id::rested_voltages(run_ocv_test(10, bench, 1, true).data, 1);
  const id::OcvPoints down = points_of(rests, id::OcvDirection::discharge),
                      up = points_of(rests, id::OcvDirection::charge);
  for (const double soc : {0.3, 0.5, 0.7}) {
    EXPECT_NEAR(up.at(soc) - down.at(soc), 0.024, 0.001) << soc;
    EXPECT_NEAR(points_of(rests, id::OcvDirection::middle).at(soc), true_ocv_v(soc), 0.0005) << soc;
  }
}

TEST(OcvRestTest, PiecesAreContinuousAndGoThroughTheRests) {
  const auto rests = id::rested_voltages(run_ocv_test(10, quiet(), 1, false).data, 1);
  const model::OcvTable<double> t = id::even_pieces(points_of(rests, id::OcvDirection::discharge));
  ASSERT_EQ(t.b0_v.size, 10U);
  for (std::size_t k = 0; k < 10; ++k) {
    const double edge = t.soc[k + 1], below = t.b0_v[k] + t.b1_v[k] * edge;
    EXPECT_NEAR(below, true_ocv_v(edge), 2e-4) << edge;
    if (k + 1 == 10) continue;
    EXPECT_NEAR(t.b0_v[k + 1] + t.b1_v[k + 1] * edge, below, 1e-12) << edge;
  }
}

TEST(OcvRestTest, APolynomialOfItsOrderIsExact) {
  id::OcvPoints points;
  for (int k = 0; k <= 20; ++k) {
    const double x = k / 20.0;
    points.soc.push_back(x);
    points.voltage_v.push_back(3 + x - 2 * std::pow(x, 4) + 1.5 * std::pow(x, 7));
  }
  const auto c = id::polynomial(points);
  EXPECT_NEAR(id::polynomial_at(c, 0.33), 3 + 0.33 - 2 * std::pow(0.33, 4) + 1.5 * std::pow(0.33, 7), 1e-9);
}

TEST(OcvRestTest, TheCellOfThePaperHasTheLimitsOfTable2) {
  const model::CellParameters<> cell = table9();
  EXPECT_EQ(cell.limits.voltage_min_v, 2.0);
  EXPECT_EQ(cell.limits.voltage_max_v, 3.65);
  EXPECT_EQ(cell.limits.charge_current_max_a, cell.capacity_ah);
  EXPECT_EQ(cell.limits.discharge_current_max_a, cell.capacity_ah);
}

TEST(StudyRun, WindowsAreThoseOfThePaper) {
  const StudyData part = window(run_ocv_test(10, quiet(), 1, false), "", 0.8, 0.5);
  EXPECT_NEAR(part.soc_from, 0.8, 0.002);
  EXPECT_NEAR(part.soc_max, 0.8, 0.002);
  EXPECT_NEAR(part.soc_min, 0.5, 0.002);
}

TEST(StudyRun, LeftOutPhysicsFollowsItsDifferentialEquations) {
  Bench bench = quiet();
  bench.left_out = {.half_gap_v = 0.010, .decay = 40, .slow_ohm = 0.008, .slow_s = 600};
  const std::vector<double> current_a(900, -3);
  const StudyData with = run_currents("", current_a, 0.6, bench, 1),
                  without = run_currents("", current_a, 0.6, quiet(), 1);
  double branch = 0, slow_v = 0;  // small steps of Euler
  constexpr int steps = 200;
  for (int k = 0; k < 900 * steps; ++k) {
    branch += 40 * 3 / (3'600.0 * 6) * (-1 - branch) / steps;
    slow_v += (-3 * 0.008 - slow_v) / 600 / steps;
  }
  EXPECT_NEAR(with.data.voltage_v.back() - without.data.voltage_v.back(), 0.010 * branch + slow_v, 1e-6);
}

TEST(StudyRun, EveryOptimiserBeginsAtThePapersStart) {
  const StudyData part = window(run_ocv_test(10, quiet(), 1, false), "", 0.8, 0.5);
  Fitter fitter(table9(), 0, {});
  for (const id::Method method : methods) {
    const ModelFit fit = fitter.fit(grey_box_model, part, method, part);
    EXPECT_LE(fit.optimum.iterations, paper_iterations) << id::name_of(method);
    ASSERT_TRUE(fit.usable);
  }
  // from the start of the paper, steepest descent does not arrive on the transfer function
  const ModelFit steepest = fitter.fit(0, part, id::Method::steepest_descent, part),
                 trust = fitter.fit(0, part, id::Method::trust_region_reflective, part);
  EXPECT_LT(steepest.estimation.fit_percent, trust.estimation.fit_percent - 20);
}

TEST(StudyRun, OneStepAheadIsThePredictorOfTheStructure) {
  const StudyData part = run_on_bench("high_1m_low_30s", 0.41, Bench{}, 3);
  Fitter fitter(table9(), 0, {});
  for (std::size_t k = 0; k < models; ++k) {
    const ModelFit fit = fitter.fit(k, part, id::Method::trust_region_reflective, part, Start::search);
    ASSERT_TRUE(fit.usable) << fit.why_not;
    EXPECT_EQ(fit.validation.one_step_fit_percent, fit.validation.fit_percent) << model_names[k];
  }
}

TEST(StudyRun, WithoutDelayTheStepOfR0IsMet) {
  const StudyData test = run_ocv_test(10, quiet(), 1, false), part = window(test, "", 0.8, 0.5),
                  other = window(test, "", 0.5, 0.2);
  Fitter fitter(table9(), 0, {});
  const WithoutDelay found = observe_without_delay(fitter, part, other);
  ASSERT_TRUE(found.output_error && found.hammerstein_wiener) << found.why_not;
  const ModelFit delayed = fitter.fit(1, part, id::Method::trust_region_reflective, other);
  EXPECT_GT(found.output_error->estimation_fit, delayed.estimation.fit_percent + 2);
}

TEST(StudyRun, AnUnevenRecordingIsResampledForTheLinearModels) {
  StudyData part = run_on_bench("high_1m_low_30s", 0.41, quiet(), 1);
  double shift_s = 0;
  for (std::size_t k = 0; k < part.data.size(); ++k)
    part.data.time_s.edit()[k] += k % 40 == 0 ? shift_s += 0.4 : shift_s;
  const ModelFit fit = Fitter(table9(), 0, {}).fit(1, part, id::Method::trust_region_reflective, part, Start::search);
  EXPECT_TRUE(fit.usable) << fit.why_not;
  bool said = false;
  for (const std::string& w : fit.warnings) said = said || w.starts_with("resampled");
  EXPECT_TRUE(said);
}

TEST(StudyRun, InitialStatesAreFoundWhereTheOcvIsSteep) {
  const StudyData part = window(run_ocv_test(10, quiet(), 1, false), "", 0.3, 0.1);
  const InitialStates found = initial_states(table9(), part, {0.2, 0.0134, 0.011, 1'000});
  EXPECT_NEAR(found.soc, part.soc_from, 0.02);
  EXPECT_GT(found.fit_percent, 60);  // the circuit stays fixed
}

TEST(Table9Fit, FindsCircuitAndPiecesOfThePlant) {
  std::vector<StudyData> parts;
  for (int tenth = 1; tenth <= 10; ++tenth) {
    Bench bench = quiet();
    bench.pulse_step_s = 2;
    parts.push_back(run_on_bench("high_1m_low_30s", std::min(1.0, tenth / 10.0 + 0.01), bench, 1));
  }
  const Table9Fit fit = fit_table9(table9(), parts);
  for (std::size_t k = 2; k < 8; ++k) {
    EXPECT_NEAR(fit.rows[k].r0.value / paper_table(9).at(k, 0), 1, 0.01) << k;
    EXPECT_NEAR(fit.rows[k].r1.value / paper_table(9).at(k, 1), 1, 0.06) << k;
    EXPECT_NEAR(fit.rows[k].c1.value / paper_table(9).at(k, 2), 1, 0.08) << k;
    EXPECT_NEAR(fit.corner_v[k + 1], true_ocv_v(fit.rows[k].soc), 0.0015) << k;
    const double edge = fit.rows[k].soc - 0.1;  // continuity
    EXPECT_NEAR(fit.rows[k].b0_v + fit.rows[k].b1_v * edge, fit.corner_v[k], 1e-9) << k;
  }
}

TEST(BestExperiment, DerivativesAreThoseOfTheVoltage) {
  std::vector<double> current_a;
  for (int k = 0; k < 300; ++k) current_a.push_back(k / 40 % 2 == 0 ? -5 : 3);
  const LocalCell cell;
  const LocalResponse here = local_response(cell, current_a);
  const auto by = [&](auto change, double h) {
    LocalCell above = cell, below = cell;
    change(above, h);
    change(below, -h);
    return Eigen::VectorXd((local_response(above, current_a).voltage_v - local_response(below, current_a).voltage_v) /
                           (2 * h));
  };
  const auto near = [](const Eigen::VectorXd& a, const Eigen::VectorXd& b) { return (a - b).norm() < 1e-5 * b.norm(); };
  EXPECT_TRUE(near(here.by.col(0), by([](LocalCell& c, double h) { c.r0_ohm += h; }, 1e-6)));
  EXPECT_TRUE(near(here.by.col(1), by([](LocalCell& c, double h) { c.r1_ohm += h; }, 1e-7)));
  EXPECT_TRUE(near(here.by.col(2), by([](LocalCell& c, double h) { c.c1_f += h; }, 1e-2)));
  EXPECT_TRUE(near(here.by.col(3), by([](LocalCell& c, double h) { c.left_out.half_gap_v += h; }, 1e-5)));
  EXPECT_TRUE(near(here.by.col(4), by([](LocalCell& c, double h) { c.left_out.slow_ohm += h; }, 1e-5)));
}

TEST(PaperFigures, AreInTheOrderOfTheTables) {
  const std::vector<Figure> f = published_figures();
  ASSERT_EQ(f.size(), 49U + 28U + 3U + 2U + 3U);
  EXPECT_EQ(f[0].value, 93.09);
  EXPECT_EQ(f[48].value, 72.97);
  EXPECT_EQ(f[49 + 27].value, 0.023996);
  EXPECT_EQ(f[49 + 28].value, 0.017241);
  EXPECT_EQ(f[49 + 28 + 3].value, 93.13);
  for (const double d : differences(f, f)) EXPECT_EQ(d, 0);
}

// A cell with known effects: its figures differ least from themselves, and more where an effect is missing.
TEST(PaperFigures, DependOnTheEffects) {
  PaperCandidate with;
  with.bench.left_out = {.half_gap_v = 0.012, .decay = 40, .slow_ohm = 0.010, .slow_s = 900};
  with.bench.ocv_step_s = 10;
  with.bench.start_branch = -1;
  PaperCandidate without = with;
  without.bench.left_out = {};
  PaperRuns runs;
  const std::vector<Figure> a = figures_of(table9(), with, runs), b = figures_of(table9(), without, runs);
  double squares = 0;
  for (const double d : differences(b, a)) squares += d * d / static_cast<double>(a.size());
  EXPECT_GT(std::sqrt(squares), 0.3);
  for (const double d : differences(figures_of(table9(), with, runs), a)) EXPECT_EQ(d, 0);
}

TEST(RankCorrelation, IsSpearmans) {
  EXPECT_NEAR(rank_correlation({1, 2, 3, 4}, {10, 20, 30, 40}), 1, 1e-12);
  EXPECT_NEAR(rank_correlation({1, 2, 3, 4}, {4, 3, 2, 1}), -1, 1e-12);
  EXPECT_NEAR(rank_correlation({1, 2, 3, 4, 5}, {2, 1, 4, 3, 5}), 0.8, 1e-12);
  EXPECT_NEAR(rank_correlation({1, 1, 2}, {1, 2, 3}), std::sqrt(0.75), 1e-12);
}

}  // namespace
}  // namespace bms::study
