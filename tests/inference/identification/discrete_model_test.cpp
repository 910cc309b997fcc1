#include "identification/discrete_model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>

#include <Eigen/Dense>

#include "identification/circuit_from_discrete.hpp"

#include "tests/inference/identification/scipy.hpp"

namespace bms::identification {
namespace {

using Eigen::VectorXd;

void expect_near(const VectorXd& ours, const std::vector<double>& theirs, double tolerance, const std::string& what) {
  ASSERT_EQ(static_cast<std::size_t>(ours.size()), theirs.size()) << what;
  ASSERT_FALSE(theirs.empty()) << what;
  for (std::size_t k = 0; k < theirs.size(); ++k)
    ASSERT_NEAR(ours[static_cast<Eigen::Index>(k)], theirs[k], tolerance) << what << ", sample " << k;
}

/// A minimal Levenberg-Marquardt method: these tests are about the problem, not about the search.
VectorXd search(const LeastSquares& problem, VectorXd x, VectorXd* deviation = nullptr) {
  VectorXd r, tried_r;
  Eigen::MatrixXd jacobian;
  EXPECT_TRUE(problem.evaluate(x, r, &jacobian));
  double damping = 1e-6;
  for (int k = 0; k < 300 && damping < 1e12; ++k) {
    const VectorXd size = jacobian.colwise().norm();
    Eigen::MatrixXd stacked(jacobian.rows() + x.size(), x.size());
    stacked << jacobian * size.cwiseInverse().asDiagonal(),
        Eigen::MatrixXd(VectorXd::Constant(x.size(), std::sqrt(damping)).asDiagonal());
    VectorXd right = VectorXd::Zero(stacked.rows());
    right.head(r.size()) = -r;
    const VectorXd tried = x + size.cwiseInverse().cwiseProduct(stacked.colPivHouseholderQr().solve(right));
    if (problem.evaluate(tried, tried_r, nullptr) && tried_r.squaredNorm() < r.squaredNorm()) {
      if (tried_r.squaredNorm() > (1 - 1e-12) * r.squaredNorm()) damping = 1e12;  // the last
      x = tried;
      EXPECT_TRUE(problem.evaluate(x, r, &jacobian));
      if (damping < 1e12) damping = std::max(damping / 10, 1e-20);
    } else {
      damping *= 10;
    }
  }
  if (deviation != nullptr) {
    const VectorXd size = jacobian.colwise().norm();
    const Eigen::MatrixXd scaled = jacobian * size.cwiseInverse().asDiagonal(),
                          inverse = (scaled.transpose() * scaled).inverse();
    const double variance = r.squaredNorm() / static_cast<double>(r.size() - x.size());
    *deviation = (variance * inverse.diagonal()).cwiseSqrt().cwiseQuotient(size);
  }
  return x;
}

/// 1 min load, 30 s rest, of random height: the paper's experiment that identifies well (4.1), with charge in between.
std::vector<double> pulses(std::size_t n, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> height(-6, 4);
  std::vector<double> u;
  while (u.size() < n) {
    const double i = height(random);
    for (int k = 0; k < 90 && u.size() < n; ++k) u.push_back(k >= 60 ? 0 : i);
  }
  return u;
}

Data data_of(const DiscreteModel& model, const std::vector<double>& input, double noise_v, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 1);
  Data data;
  data.capacity_ah = 6;
  const VectorXd y = simulate(model, input);
  for (std::size_t k = 0; k < input.size(); ++k) {
    data.time_s.edit().push_back(static_cast<double>(k));
    data.current_a.edit().push_back(input[k]);
    data.voltage_v.edit().push_back(y[static_cast<Eigen::Index>(k)] + noise_v * noise(random));
  }
  return data;
}

const CircuitParameters cell{0.4, 0.0126, 0.0192, 2'000};  // tau = 38.4 s
constexpr double capacity_c = 6 * 3'600;

/// The cell of 6 Ah as TF, sampled at 1 Hz: 80 % charged and relaxing by 10 mV at the start.
DiscreteModel tf_of_cell() {
  const DiscreteCoefficients c = discrete_from_circuit(cell, 1, capacity_c);
  const double pole = c.a2;
  return {{c.c0, c.c1, c.c2}, {c.a1, c.a2}, 0, 2.9, {0.32 + 0.01, 0.32 + 0.01 * pole}};
}

DiscreteModel oe_of_cell() {
  const DiscreteCoefficients c = discrete_from_circuit(cell, 1, capacity_c);
  return {{c.c0, c.c1, c.c2}, {-0.9995 - c.a2, 0.9995 * c.a2}, 1, 3.2, {}};
}

TEST(DiscreteModel, SimulatesAsScipysLfilterDoes) {
  auto scipy = scipy_reference();
  if (scipy.empty()) GTEST_SKIP() << "no python3 with scipy: install python3-scipy to compare the simulation with it";
  const auto& u = scipy["x"];
  expect_near(simulate({{0.01317, -0.02263, 0.00946}, {-1.82, 0.8203}, 0, 0, {}}, u), scipy["tf"], 1e-12, "Eq. 17");
  expect_near(simulate({{0.009828, -0.01508, 0.005254}, {-1.835, 0.835}, 1, 0, {}}, u), scipy["oe"], 1e-12,
              "Eq. 21-22");
  expect_near(simulate({{0, 0, 0}, {-1.82, 0.8203}, 0, 0, {0.1, -0.05}}, std::vector<double>(202, 0)).tail(200),
              scipy["free"], 1e-12, "free response");
}

// y[k] = 0.5 y[k-1] + 2 u[k-1] + 3 u[k-2] for u = 1 0 0 ...: 0 2 4 2 1; offset 10; free response from 8: 8 4 2 1 0.5
TEST(DiscreteModel, SimulatesValuesComputedByHand) {
  const std::vector<double> impulse{1, 0, 0, 0, 0};
  expect_near(simulate({{2, 3}, {-0.5}, 1, 0, {}}, impulse), {0, 2, 4, 2, 1}, 0, "delay of one");
  expect_near(simulate({{2, 3}, {-0.5}, 0, 0, {}}, impulse), {2, 4, 2, 1, 0.5}, 0, "none");
  expect_near(simulate({{2, 3}, {-0.5}, 1, 10, {8}}, impulse), {18, 16, 16, 13, 11.5}, 0, "offset and start");
  expect_near(simulate({{1}, {-1.5, 0.5}, 9, 0, {}}, impulse), {0, 0, 0, 0, 0}, 0, "delay longer than the record");
  EXPECT_EQ(simulate({{1}, {-1}, 0, 0, {}}, {}).size(), 0);
}

TEST(DiscreteModel, TheInputBeforeTheRecordIsInTheFreeResponse) {
  const auto u = pulses(400);
  for (const std::size_t nk : {0U, 1U}) {
    const DiscreteModel model{{0.02, -0.03, 0.0105}, {-1.9, 0.905}, nk, 3.2, {}};
    const VectorXd whole = simulate(model, u);
    const std::vector<double> late(u.begin() + 130, u.end());
    Eigen::MatrixXd jacobian;
    const VectorXd from_rest = simulate(model, late, &jacobian);
    // the start that leaves the least: zero from sample nk + nb - 1 - nf on
    const Eigen::Index sure = static_cast<Eigen::Index>(nk);
    const Eigen::MatrixXd starts = jacobian.rightCols(2).bottomRows(270 - sure);
    const VectorXd missing = (whole.tail(270) - from_rest).tail(270 - sure);
    const VectorXd start = starts.colPivHouseholderQr().solve(missing);
    EXPECT_LT((starts * start - missing).cwiseAbs().maxCoeff(), 1e-12) << nk;
    EXPECT_GT(missing.cwiseAbs().maxCoeff(), 1e-3) << nk;
  }
}

TEST(DiscreteModel, DerivativesAreCentralDifferences) {
  const auto u = pulses(300);
  const DiscreteModel models[] = {{{0.02, -0.03, 0.011}, {-1.9, 0.905}, 0, 3.2, {0.1, 0.07}},
                                  {{0.02, -0.03, 0.011}, {-1.9, 0.905}, 1, 3.2, {}},
                                  {{0.02}, {-1.5, 0.8, -0.2}, 2, 0, {0.1, -0.1, 0.2}},
                                  {{1, 2, 3, 4}, {0.7}, 3, 1, {-2}}};
  for (const DiscreteModel& model : models) {
    Eigen::MatrixXd jacobian;
    const VectorXd plain = simulate(model, u), with = simulate(model, u, &jacobian);
    EXPECT_EQ((plain - with).cwiseAbs().maxCoeff(), 0);
    const std::size_t nb = model.b.size(), nf = model.f.size();
    ASSERT_EQ(jacobian.cols(), static_cast<Eigen::Index>(nb + 2 * nf + 1));
    for (std::size_t j = 0; j < nb + 2 * nf + 1; ++j) {
      const double h = 1e-6;
      const auto moved = [&](double by) {
        DiscreteModel m = model;
        if (m.initial_v.empty()) m.initial_v.assign(nf, 0);
        if (j < nb)
          m.b[j] += by;
        else if (j < nb + nf)
          m.f[j - nb] += by;
        else if (j == nb + nf)
          m.offset_v += by;
        else
          m.initial_v[j - nb - nf - 1] += by;
        return simulate(m, u);
      };
      const VectorXd difference = (moved(h) - moved(-h)) / (2 * h), ours = jacobian.col(static_cast<Eigen::Index>(j));
      // a central difference is good to h^2 of the third derivative and 1e-16 / h of the value
      EXPECT_LT((difference - ours).cwiseAbs().maxCoeff(),
                1e-7 * (1 + ours.cwiseAbs().maxCoeff() + plain.cwiseAbs().maxCoeff()))
          << "unknown " << j;
    }
  }
}

TEST(DiscreteModel, RejectsAFreeResponseOfTheWrongLengthAndAnEmptyDenominator) {
  EXPECT_THROW(simulate({{1}, {}, 0, 0, {}}, std::vector{1.0}), std::invalid_argument);
  EXPECT_THROW(simulate({{1}, {-1.5, 0.5}, 0, 0, {1}}, std::vector{1.0}), std::invalid_argument);
}

TEST(Poles, AreFoundAndMirrored) {
  EXPECT_NEAR(largest_pole({-1.5, 0.5}), 1, 1e-12);  // 1, 0.5
  EXPECT_NEAR(largest_pole({0, 0.81}), 0.9, 1e-12);  // +-0.9i
  EXPECT_NEAR(largest_pole({-2}), 2, 1e-12);
  EXPECT_TRUE(stable({-1.5, 0.5}));
  EXPECT_TRUE(stable({-1.5005, 0.50025}));  // 1.0005, 0.5
  EXPECT_FALSE(stable({-1.5005, 0.50025}, 1e-4));
  EXPECT_FALSE(stable({std::nan(""), 0.5}));
  EXPECT_THAT(mirrored_inside({-2.5, 1}),
              testing::Pointwise(testing::DoubleNear(1e-12), {-1.0, 0.25}));  // 2, 0.5 -> 0.5, 0.5
  EXPECT_THAT(mirrored_inside({0, 4, 0}), testing::Pointwise(testing::DoubleNear(1e-12), {0.0, 0.25, 0.0}));  // +-2i
  EXPECT_THAT(mirrored_inside({-1.2, 0.3}), testing::ElementsAre(-1.2, 0.3));
}

TEST(Unknowns, GoToAModelAndBackInTheOrderOfTheStructure) {
  const DiscreteModel tf{{1, 2, 3}, {4, 5}, 0, 3.206, {6, 7}};
  EXPECT_THAT(to_unknowns(tf, transfer_function(3.206)), testing::ElementsAre(1, 2, 3, 4, 5, 6, 7));
  const DiscreteModel oe{{1, 2, 3}, {4, 5}, 1, 6, {0, 7}};
  EXPECT_THAT(to_unknowns(oe, output_error()), testing::ElementsAre(1, 2, 3, 4, 5, 6, 7));
  EXPECT_THAT(to_unknowns(oe, output_error(true)), testing::ElementsAre(1, 2, 3, 4, 5, 6));
  const DiscreteModel back = to_model(to_unknowns(tf, transfer_function(3.206)), transfer_function(3.206));
  EXPECT_EQ(back.b, tf.b);
  EXPECT_EQ(back.f, tf.f);
  EXPECT_EQ(back.offset_v, 3.206);
  EXPECT_EQ(back.initial_v, tf.initial_v);
  EXPECT_EQ(to_model(to_unknowns(oe, output_error()), output_error()).initial_v, oe.initial_v);
  EXPECT_THROW(to_unknowns(tf, output_error()), std::invalid_argument);
  EXPECT_THROW(to_model(VectorXd::Zero(5), output_error()), std::invalid_argument);
}

/// Each coefficient within `tolerance` of the truth.
void expect_unknowns(const VectorXd& x, const VectorXd& truth, double tolerance, const std::string& what) {
  for (Eigen::Index k = 0; k < truth.size(); ++k) EXPECT_NEAR(x[k], truth[k], tolerance) << what << ", unknown " << k;
}

TEST(Identification, WithoutNoiseComesBackTo1e6FromItsOwnStart) {
  const DiscreteModel tf = tf_of_cell(), oe = oe_of_cell();
  const Structure tf_structure = transfer_function(2.9), oe_structure = output_error(true);
  const auto u = pulses(3'600);
  const Data tf_data = data_of(tf, u, 0), oe_data = data_of(oe, u, 0);
  const VectorXd tf_start = to_unknowns(start_values(tf_data, tf_structure), tf_structure),
                 oe_start = to_unknowns(start_values(oe_data, oe_structure), oe_structure);
  expect_unknowns(search(simulation_error(tf_data, tf_structure, tf_start), tf_start), to_unknowns(tf, tf_structure),
                  1e-6, "TF");
  expect_unknowns(search(simulation_error(oe_data, oe_structure, oe_start), oe_start), to_unknowns(oe, oe_structure),
                  1e-6, "OE");
}

TEST(Identification, WithoutNoiseComesBackTo1e6FromAFarStart) {
  const DiscreteModel tf = tf_of_cell();
  const Structure structure = transfer_function(2.9);
  const Data data = data_of(tf, pulses(3'600), 0);
  VectorXd far = to_unknowns(tf, structure);
  far << 0.01, -0.015, 0.005, -1.9, 0.9, 0.3, 0.3;  // tau = 10 s
  expect_unknowns(search(simulation_error(data, structure, far), far), to_unknowns(tf, structure), 1e-6, "TF");
}

// Cut out of a longer run, the current on: what came before is in the offset and the free response.
TEST(Identification, OfARecordCutOutOfARunComesBackTo1e6) {
  DiscreteModel tf = tf_of_cell(), oe = tf;
  oe.nk = 1;
  const struct {
    const char* name;
    DiscreteModel model;
    Structure structure;
  } kinds[] = {{"TF", tf, transfer_function(2.9)}, {"OE", oe, output_error()}};
  for (const auto& [name, model, structure] : kinds) {
    Data data = data_of(model, pulses(4'000), 0);
    ASSERT_NE(data.current_a[399], 0);
    for (auto* column : {&data.time_s, &data.current_a, &data.voltage_v}) *column = column->part(400, column->size());
    const VectorXd start = to_unknowns(start_values(data, structure), structure),
                   x = search(simulation_error(data, structure, start), start);
    expect_unknowns(x.head(5), to_unknowns(model, structure).head(5), 1e-6, name);
  }
}

// The circuit to 0.1 % from data without noise.
TEST(Identification, LeadsBackToTheCircuit) {
  const Structure structure = transfer_function(2.9);
  const Data data = data_of(tf_of_cell(), pulses(3'600), 0);
  const VectorXd start = to_unknowns(start_values(data, structure), structure),
                 x = search(simulation_error(data, structure, start), start);
  const CircuitResult r = circuit_from_discrete({x[0], x[1], x[2], x[3], x[4]}, 1, capacity_c);
  EXPECT_TRUE(r.implausible.empty());
  EXPECT_LT(r.integrator_pole_error, 1e-7);
  EXPECT_NEAR(r.circuit.b1_v / cell.b1_v, 1, 1e-3);
  EXPECT_NEAR(r.circuit.r0_ohm / cell.r0_ohm, 1, 1e-3);
  EXPECT_NEAR(r.circuit.r1_ohm / cell.r1_ohm, 1, 1e-3);
  EXPECT_NEAR(r.circuit.c1_f / cell.c1_f, 1, 1e-3);
}

// 60 fits of each: no unknown further than three standard deviations more often than chance has it (0.27 % of 60 x 7:
// one or two; allow 6), and the root mean square of the normalised errors is 1 (chi square of 60: +-9 %, three of
// them).
TEST(Identification, HasErrorsOfTheSizeOfItsStandardDeviations) {
  const auto u = pulses(1'800);
  const struct {
    const char* name;
    DiscreteModel model;
    Structure structure;
  } kinds[] = {{"TF", tf_of_cell(), transfer_function(2.9)}, {"OE", oe_of_cell(), output_error(true)}};
  for (const auto& [name, model, structure] : kinds) {
    const VectorXd truth = to_unknowns(model, structure);
    VectorXd squares = VectorXd::Zero(truth.size());
    int beyond = 0;
    for (unsigned seed = 1; seed <= 60; ++seed) {
      const Data data = data_of(model, u, 0.001, seed);
      const VectorXd start = to_unknowns(start_values(data, structure), structure);
      VectorXd deviation;
      const VectorXd x = search(simulation_error(data, structure, start), start, &deviation),
                     normal = (x - truth).cwiseQuotient(deviation);
      squares += normal.cwiseAbs2();
      beyond += static_cast<int>((normal.array().abs() > 3).count());
    }
    EXPECT_LE(beyond, 6) << name;
    for (Eigen::Index k = 0; k < truth.size(); ++k)
      EXPECT_NEAR(std::sqrt(squares[k] / 60), 1, 0.28) << name << ", unknown " << k;
  }
}

TEST(StartValues, SimulateNearlyAsWellAsTheBestUnderNoise) {
  const struct {
    const char* name;
    DiscreteModel model;
    Structure structure;
  } kinds[] = {{"TF", tf_of_cell(), transfer_function(2.9)},
               {"OE", oe_of_cell(), output_error(true)},
               {"OE in motion", oe_of_cell(), output_error()}};
  for (const auto& [name, model, structure] : kinds) {
    for (unsigned seed = 1; seed <= 5; ++seed) {
      const Data data = data_of(model, pulses(3'600), 0.001, seed);
      const VectorXd start = to_unknowns(start_values(data, structure), structure);
      VectorXd r;
      ASSERT_TRUE(simulation_error(data, structure, start).evaluate(start, r, nullptr));
      EXPECT_LT(std::sqrt(r.squaredNorm() / 3'600), 0.0012) << name << ", seed " << seed;
    }
  }
}

TEST(StartValues, AreExactWithoutNoiseWhateverTheOrders) {
  for (const std::size_t nf : {1U, 2U, 3U}) {
    const std::vector<double> f[] = {{-0.9}, {-1.7, 0.72}, {-2.1, 1.46, -0.336}};  // 0.9; 0.8; 0.9, 0.8 and so on
    const DiscreteModel model{{0.5, 0.2}, f[nf - 1], 1, 3, {}};
    const Structure structure{
        .nb = 2, .nf = nf, .nk = 1, .offset_v = 0, .estimate_offset = true, .estimate_initial = false};
    const DiscreteModel start = start_values(data_of(model, pulses(500), 0), structure);
    expect_unknowns(to_unknowns(start, structure), to_unknowns(model, structure), 1e-8, std::to_string(nf));
  }
}

TEST(SimulationError, HasExactDerivativesInEveryStructure) {
  DiscreteModel oe = oe_of_cell();
  oe.initial_v = {0, 0.01};
  const struct {
    DiscreteModel model;
    Structure structure;
  } cases[] = {{tf_of_cell(), transfer_function(2.9)}, {oe, output_error()}, {oe_of_cell(), output_error(true)}};
  for (const auto& [model, structure] : cases) {
    Data data = data_of(model, pulses(200), 0.001);
    data.voltage_v.edit()[70] = std::nan("");
    const VectorXd x = to_unknowns(model, structure);
    const LeastSquares problem = simulation_error(data, structure, x);
    ASSERT_EQ(problem.scale.size(), x.size());
    EXPECT_GT(problem.scale.minCoeff(), 0);
    VectorXd r, up, down;
    Eigen::MatrixXd jacobian;
    ASSERT_TRUE(problem.evaluate(x, r, &jacobian));
    ASSERT_EQ(jacobian.cols(), x.size());
    EXPECT_EQ(r[70], 0);
    EXPECT_TRUE(jacobian.row(70).isZero(0));
    EXPECT_NEAR(r[5], simulate(model, data.current_a)[5] - data.voltage_v[5], 1e-15);
    for (Eigen::Index j = 0; j < x.size(); ++j) {
      VectorXd moved = x;
      const double h = 1e-7;
      moved[j] += h;
      ASSERT_TRUE(problem.evaluate(moved, up, nullptr));
      moved[j] -= 2 * h;
      ASSERT_TRUE(problem.evaluate(moved, down, nullptr));
      const VectorXd ours = jacobian.col(j);
      EXPECT_LT(((up - down) / (2 * h) - ours).cwiseAbs().maxCoeff(), 1e-6 * (1 + ours.cwiseAbs().maxCoeff())) << j;
    }
  }
}

TEST(SimulationError, IsNotDefinedForAnUnstableModelButForAnIntegrator) {
  const Structure structure = transfer_function(2.9);
  const Data data = data_of(tf_of_cell(), pulses(1'000), 0);
  VectorXd x = to_unknowns(tf_of_cell(), structure), r;
  const LeastSquares problem = simulation_error(data, structure, x);
  EXPECT_TRUE(problem.evaluate(x, r, nullptr));
  x[3] = -1.95;
  x[4] = 0.949;  // F(1) < 0: a pole beyond 1
  EXPECT_FALSE(problem.evaluate(x, r, nullptr));
  x[3] = std::nan("");
  EXPECT_FALSE(problem.evaluate(x, r, nullptr));
}

TEST(SimulationError, RejectsInvalidData) {
  const Structure structure = transfer_function(2.9);
  const Data good = data_of(tf_of_cell(), pulses(100), 0);
  const VectorXd x = to_unknowns(tf_of_cell(), structure);
  Data bad = good;
  bad.time_s.edit()[50] += 0.2;
  EXPECT_THROW(simulation_error(bad, structure, x), std::invalid_argument);
  EXPECT_THROW(start_values(bad, structure), std::invalid_argument);
  bad = good;
  bad.current_a.edit()[50] = std::nan("");
  EXPECT_THROW(simulation_error(bad, structure, x), std::invalid_argument);
  bad = good;
  for (std::size_t k = 5; k < 100; ++k) bad.voltage_v.edit()[k] = std::nan("");
  EXPECT_THROW(start_values(bad, structure), std::invalid_argument);
  bad = good;
  bad.current_a.edit().pop_back();
  EXPECT_THROW(simulation_error(bad, structure, x), std::invalid_argument);
  bad = good;
  bad.current_a = std::vector<double>(100, -2);
  EXPECT_THROW(start_values(bad, structure), std::invalid_argument) << "a current that never changes";
  EXPECT_THROW(simulation_error(good, structure, VectorXd::Zero(3)), std::invalid_argument);
}

}  // namespace
}  // namespace bms::identification
