#include "identification/grey_box.hpp"

#include <gtest/gtest.h>

#include <random>

#include "files/cell_file.hpp"
#include "replay/simulation.hpp"
#include "tests/inference/identification/plant.hpp"

namespace bms::identification {
namespace {

model::CellParameters<> table9() { return files::read_cell("table9").parameters; }

/// An irregular current that crosses edges of the tables.
Data irregular(std::size_t samples) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  Data d;
  d.capacity_ah = 6;
  double time_s = 0;
  for (std::size_t k = 0; k < samples; ++k) {
    d.time_s.edit().push_back(time_s);
    d.current_a.edit().push_back(k == 0 ? 0 : 6 * uniform(random) - 2);
    d.voltage_v.edit().push_back(3.2 + 0.05 * uniform(random));
    time_s += 1 + 30 * (1 + uniform(random));
  }
  return d;
}

TEST(GreyBox, SimulatesTheSameVoltageAsTheOpenLoopSimulation) {
  const auto cell = table9();
  GreyBoxOptions options;
  for (std::size_t k = 0; k < cell.rc.soc.size; ++k) options.soc_nodes.push_back(cell.rc.soc[k]);
  DataSet record;
  record.data = irregular(300);
  record.initial_soc = 0.85;
  record.estimate_initial_v_rc = false;
  const GreyBox grey_box(cell, {record}, options);
  Eigen::VectorXd voltage(300);
  ASSERT_TRUE(grey_box.simulate(grey_box.start(), 0, voltage, nullptr));
  const auto tables = model::prepare<double, model::max_intervals>(cell);
  const auto expected = replay::simulate({.cell = tables,
                                          .capacity_ah = 6,
                                          .time_s = record.data.time_s,
                                          .current_a = record.data.current_a,
                                          .initial_soc = 0.85});
  for (Eigen::Index k = 0; k < 300; ++k)
    ASSERT_NEAR(voltage[k], expected[static_cast<std::size_t>(k)].voltage_v, 1e-12);
}

TEST(GreyBox, DerivativesAreDifferencesOfTheSimulation) {
  model::CellParameters<> cell = table9();
  for (std::size_t k = 0; k < cell.ocv.soc.size; ++k)
    cell.ocv.half_gap_v.push_back(0.02 + 0.01 * static_cast<double>(k % 3));
  GreyBoxOptions options;
  options.soc_nodes = {0.15, 0.35, 0.62, 0.9};
  options.estimate_ocv_branch = true;
  options.tie_v = 0.01;
  DataSet first, second;
  first.data = irregular(200);
  first.initial_soc = 0.86;
  first.estimate_initial_soc = true;
  first.initial_soc_sigma = 0.02;
  first.data.voltage_v.edit()[17] = std::nan("");
  second.data = irregular(120);
  second.initial_soc = 0.4;
  const GreyBox grey_box(cell, {first, second}, options);
  const LeastSquares problem = grey_box.problem();
  const Eigen::VectorXd x = grey_box.start();
  ASSERT_EQ(x.size(), 4 * 3 + 1 + 2 + 1);
  Eigen::VectorXd r, above, below;
  Eigen::MatrixXd jacobian;
  ASSERT_TRUE(problem.evaluate(x, r, &jacobian));
  ASSERT_EQ(r.size(), 200 + 120 + 1 + 9);
  EXPECT_EQ(r[17], 0);
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const double h = 1e-5 * problem.scale[k];
    Eigen::VectorXd moved = x;
    moved[k] += h;
    ASSERT_TRUE(problem.evaluate(moved, above, nullptr));
    moved[k] -= 2 * h;
    ASSERT_TRUE(problem.evaluate(moved, below, nullptr));
    const Eigen::VectorXd numeric = (above - below) / (2 * h);
    EXPECT_LT((numeric - jacobian.col(k)).norm(), 2e-6 * (numeric.norm() + 1e-9))
        << grey_box.unknowns()[static_cast<std::size_t>(k)].name() << " " << k;
  }
}

TEST(GreyBox, TheOcvBranchPositionMovesTheCurveByItsHalfGap) {
  model::CellParameters<> cell = table9();
  for (std::size_t k = 0; k < cell.ocv.soc.size; ++k) cell.ocv.half_gap_v.push_back(0.03);
  const auto moved_ocv = with_ocv_branch(cell, -0.5);
  for (std::size_t k = 0; k < cell.ocv.b0_v.size; ++k) {
    EXPECT_NEAR(moved_ocv.ocv.b0_v[k], cell.ocv.b0_v[k] - 0.015, 1e-12);
    EXPECT_NEAR(moved_ocv.ocv.b1_v[k], cell.ocv.b1_v[k], 1e-12);
  }
  const auto back = with_ocv_branch(moved_ocv, 0);
  for (std::size_t k = 0; k < cell.ocv.b0_v.size; ++k) EXPECT_NEAR(back.ocv.b0_v[k], cell.ocv.b0_v[k], 1e-12);
}

/// Identifies one circuit and the position of the OCV between its branches; half_gap_v: at the first edge of the curve,
/// 20 mV at the others.
GreyBox box_with_branch(double half_gap_v) {
  model::CellParameters<> cell = table9();
  for (std::size_t k = 0; k < cell.ocv.soc.size; ++k) cell.ocv.half_gap_v.push_back(0.02);
  cell.ocv.half_gap_v[0] = half_gap_v;
  GreyBoxOptions options;
  options.soc_nodes = {0.5};
  options.estimate_ocv_branch = true;
  DataSet record;
  record.data = irregular(20);
  return GreyBox(cell, {record}, options);
}

TEST(GreyBox, TheOcvBranchPositionIsLimitedToThoseAtWhichTheCurveRises) {
  const model::OcvTable<double> ocv = table9().ocv;
  // near empty slow charge lies far above slow discharge: towards it the curve would fall
  const GreyBox grey_box = box_with_branch(0.02 + 2 * ocv.b1_v[0] * (ocv.soc[1] - ocv.soc[0]));
  const LeastSquares problem = grey_box.problem();
  Eigen::VectorXd x = grey_box.start();
  EXPECT_NEAR(problem.upper[3], 0.5, 0.01);
  EXPECT_EQ(problem.lower[3], -1);
  for (const double position : {problem.lower[3], problem.upper[3]}) {
    x[3] = position;
    const auto moved = grey_box.cell_with(x);
    for (std::size_t k = 0; k < moved.ocv.b1_v.size; ++k) EXPECT_GT(moved.ocv.b1_v[k], 0) << position << " " << k;
  }
}

TEST(GreyBox, TheOcvBranchPositionIsLimitedToSlopesThatACellFileMayState) {
  const model::OcvTable<double> ocv = table9().ocv;
  // near empty slow charge rises by 100 V per unit of soc more than slow discharge
  const GreyBox grey_box = box_with_branch(0.02 - 50 * (ocv.soc[1] - ocv.soc[0]));
  const LeastSquares problem = grey_box.problem();
  Eigen::VectorXd x = grey_box.start();
  for (const double position : {problem.lower[3], problem.upper[3]}) {
    x[3] = position;
    const auto moved = grey_box.cell_with(x);
    EXPECT_GT(moved.ocv.b1_v[0], 0) << position;
    EXPECT_LE(moved.ocv.b1_v[0], 60) << position;
  }
}

TEST(GreyBox, RejectsMissingNodesRecordingsAndHalfGaps) {
  DataSet record;
  record.data = irregular(20);
  EXPECT_THROW(GreyBox(table9(), {record}, {}), std::invalid_argument);
  GreyBoxOptions options;
  options.soc_nodes = {0.5};
  EXPECT_THROW(GreyBox(table9(), {}, options), std::invalid_argument);
  options.estimate_ocv_branch = true;
  EXPECT_THROW(GreyBox(table9(), {record}, options), std::invalid_argument);
}

TEST(GreyBox, NodesCoverTheRangeOfTheData) {
  EXPECT_EQ(nodes_for(0.48, 0.52), (std::vector<double>{0.5}));
  EXPECT_EQ(nodes_for(0.22, 0.98).size(), 9U);
  EXPECT_EQ(nodes_for(0.0, 1.0).size(), 11U);
}

}  // namespace
}  // namespace bms::identification
