// Hammerstein-Wiener on an exact system, in the arithmetic of the test: pole by pole, corner by corner.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "files/cell_file.hpp"
#include "identification/linear_models.hpp"
#include "identification/resample.hpp"
#include "tests/inference/identification/exact_systems.hpp"

namespace bms::identification {
namespace {

model::CellParameters<> table9() { return files::read_cell("table9").parameters; }

/// Straight pieces, without rounding: max() of lines is how a kink is made.
double kinked(double w_v) {
  return 3.0 + 0.6 * w_v + 0.5 * std::max(0.0, w_v - 0.10) - 0.7 * std::max(0.0, w_v - 0.22);
}

struct System {
  double direction = 0.06;          ///< relative difference of charge and discharge, halved
  double slow = 0.92, gain = 5e-3;  ///< pole, and ohm per sample
  double per_as = 1.2e-5, direct_ohm = 0.012;
};

/// Voltage of the system under a current, without noise.
std::vector<double> voltage_of(const System& s, const std::vector<double>& current_a) {
  std::vector<double> v;
  double relaxing = 0, counted = 0.15, before_a = 0;
  for (const double now_a : current_a) {
    const double i = before_a;  // the output error model has a delay of one sample
    before_a = now_a;
    const double u = i + s.direction * (std::hypot(i, 0.3) - 0.3);
    relaxing = s.slow * relaxing + s.gain * (1 - s.slow) * u;
    counted += s.per_as * u;
    v.push_back(kinked(counted + s.direct_ohm * u + relaxing));
  }
  return v;
}

Data pulses(std::uint64_t seed, std::size_t count) {
  Data data = random_pulses(seed, count);
  data.voltage_v = voltage_of({}, data.current_a.copy());
  return data;
}

LinearIdentification identified(const Data& data, Method method) {
  return identify_linear(LinearKind::hammerstein_wiener, table9(), data, 0.5, method);
}

// The corners of the model do not lie at the kinks of the system, so several minima lie close together.
TEST(HammersteinWiener, NoFastOptimiserStopsAtAKink) {
  const Data data = with_noise(pulses(1, 1'000), 2, 0.0005);
  double best = 0;
  std::array<double, 4> fits{};
  constexpr std::array fast = {Method::subspace_gauss_newton, Method::adaptive_subspace_gauss_newton,
                               Method::levenberg_marquardt, Method::trust_region_reflective};
  std::array<std::string, 4> ends;
  for (std::size_t k = 0; k < fast.size(); ++k) {
    const Identification found = identified(data, fast[k]).identification;
    fits[k] = found.estimation.fit_percent;
    ends[k] = std::to_string(found.optimum.iterations) + " iterations: " + found.optimum.reason;
    best = std::max(best, fits[k]);
  }
  EXPECT_GT(best, 97);
  for (std::size_t k = 0; k < fast.size(); ++k) EXPECT_GT(fits[k], best - 0.5) << name_of(fast[k]) << ", " << ends[k];
  // steepest descent goes as far as it comes
  EXPECT_LE(identified(data, Method::steepest_descent).identification.estimation.fit_percent, best + 0.1);
}

TEST(HammersteinWiener, FindsTheDirectionOfTheInputCurve) {
  const Data data = with_noise(pulses(3, 1'000), 4, 0.0005);
  const LinearIdentification found = identified(data, Method::trust_region_reflective);
  EXPECT_NEAR(found.model.blocks.input.direction, System{}.direction, 0.02);
}

TEST(HammersteinWiener, DerivativesAreThoseOfTheResiduals) {
  const Data data = pulses(5, 200);
  HammersteinWiener start =
      begin_hammerstein_wiener(start_values(data, output_error()), output_error(), table9().ocv, data, 0.5);
  const LeastSquares problem = simulation_error(data, start);
  const Eigen::VectorXd x = to_unknowns(start);
  Eigen::VectorXd r, above, below;
  Eigen::MatrixXd jacobian;
  ASSERT_TRUE(problem.evaluate(x, r, &jacobian));
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const double h = 1e-6 * problem.scale[k];
    Eigen::VectorXd moved = x;
    moved[k] = x[k] + h;
    ASSERT_TRUE(problem.evaluate(moved, above, nullptr));
    moved[k] = x[k] - h;
    ASSERT_TRUE(problem.evaluate(moved, below, nullptr));
    const Eigen::VectorXd difference = (above - below) / (2 * h);
    EXPECT_LT((difference - jacobian.col(k)).norm(), 2e-3 * (1e-6 + difference.norm())) << k;
  }
}

TEST(HammersteinWiener, TheOutputCurveIsStraightBetweenRoundedCorners) {
  const OutputCurve curve{0, 1, {0, 0.8, 2.1, 2.9, 4.3, 5.0, 5.8, 7.2, 8.1, 8.8, 10}};
  for (const double w : {-0.7, 0.5, 1.9, 2.0, 2.1, 5.26, 9.5, 10.4})
    EXPECT_NEAR(curve.slope(w), (curve.through(w + 1e-6) - curve.through(w - 1e-6)) / 2e-6, 1e-6) << w;
  EXPECT_NEAR(curve.through(2.5), 2.5, 1e-12);  // (2.1 + 2.9) / 2
  EXPECT_NEAR(curve.through(-1), -0.8, 1e-12);  // the first piece continues
}

TEST(HammersteinWiener, EveryFastOptimiserFindsAnExactSystem) {
  const Data data = with_noise(exact_system(9, 1'000, table9().ocv).data, 1, 0.0005);
  double least = 100, most = 0;
  std::string ends;
  for (const Method method : {Method::subspace_gauss_newton, Method::adaptive_subspace_gauss_newton,
                              Method::levenberg_marquardt, Method::trust_region_reflective}) {
    const Identification found = identified(data, method).identification;
    least = std::min(least, found.estimation.fit_percent);
    most = std::max(most, found.estimation.fit_percent);
    ends += std::string(name_of(method)) + " " + std::to_string(found.estimation.fit_percent) + " after " +
            std::to_string(found.optimum.iterations) + " iterations: " + found.optimum.reason + "\n";
  }
  EXPECT_GT(most, 98);
  EXPECT_GT(least, most - 0.1) << ends;
}

/// The end of a search that begins at the truth.
double best_rmse_v(const ExactSystem& system, const Data& data) {
  const LeastSquares problem = simulation_error(data, system.model);
  const Optimum best = minimise(problem, to_unknowns(system.model), Method::trust_region_reflective);
  const Eigen::VectorXd left = residuals_of(with_unknowns(system.model, best.x), data);
  return std::sqrt(left.squaredNorm() / static_cast<double>(left.size()));
}

// Wherever the corners of the system lie: curves with fixed ends, or a search from one place, do not reach it.
TEST(HammersteinWiener, EndsWhereASearchFromTheTruthEnds) {
  for (const std::uint64_t seed : {401U, 405U, 408U, 410U}) {
    const ExactSystem system = exact_system(seed, 500, table9().ocv);
    const Data data = with_noise(system.data, seed, 0.001);
    const Identification found = identified(data, Method::trust_region_reflective).identification;
    EXPECT_LT(found.estimation.rmse_v, 1.003 * best_rmse_v(system, data)) << seed;
  }
}

// The truth is the voltage of an exact system without noise.
TEST(HammersteinWiener, BandsFromResamplingContainTheTruth) {
  constexpr std::size_t trials = 10, models = 30, count = 500;
  const ExactSystem system = exact_system(7, count, table9().ocv);
  std::size_t inside = 0, all = 0, bands = 0;
  std::string by_trial;
  for (std::uint64_t trial = 0; trial < trials; ++trial) {
    const Data data = with_noise(system.data, 10 + trial, 0.001);
    const LinearIdentification found = identified(data, Method::trust_region_reflective);
    const std::optional<Band> band = confidence_band(found.model.blocks, data, models, trial);
    if (!band) continue;
    ++bands;
    for (Eigen::Index k = 0; k < band->low_v.size(); ++k) {
      const double v = system.data.voltage_v[static_cast<std::size_t>(k)];
      inside += v >= band->low_v[k] && v <= band->high_v[k] ? 1U : 0U;
      ++all;
    }
    by_trial += std::to_string(static_cast<double>(inside) / static_cast<double>(all)) + " " +
                std::to_string(1e3 * found.identification.estimation.rmse_v) + " mV\n";
  }
  const double coverage = static_cast<double>(inside) / static_cast<double>(all);
  EXPECT_GE(bands, trials - 1);  // the test of whiteness refuses one of a hundred
  EXPECT_GT(coverage, 0.90) << by_trial;
  EXPECT_LT(coverage, 0.99);
}

// A second time constant, which the model does not have, leaves correlated residuals.
TEST(HammersteinWiener, GivesNoBandWhereTheModelLacksSomething) {
  ExactSystem system = exact_system(8, 500, table9().ocv);
  double slow_v = 0;
  for (std::size_t k = 0; k < system.data.size(); ++k) {
    system.data.voltage_v.edit()[k] += slow_v;
    slow_v = 0.995 * slow_v + 0.005 * 0.010 * system.data.current_a[k];
  }
  const Data data = with_noise(system.data, 3, 0.0005);
  const LinearIdentification found = identified(data, Method::trust_region_reflective);
  EXPECT_FALSE(confidence_band(found.model.blocks, data, 5, 1));
  const std::vector<std::string>& warnings = found.identification.warnings;
  EXPECT_TRUE(std::any_of(warnings.begin(), warnings.end(),
                          [](const std::string& w) { return w.starts_with("correlated_residuals"); }));
}

TEST(Resample, KeepsChargeAndMarksGaps) {
  Data data;
  data.capacity_ah = 6;
  double t = 0, charge_as = 0;
  for (int k = 0; k < 300; ++k) {
    const double usual_s = k % 3 == 0 ? 1.3 : 1;
    const double step_s = k == 150 ? 40 : usual_s;
    t += k == 0 ? 0 : step_s;
    const double current_a = 2 * std::sin(0.05 * t);
    if (k > 0) charge_as += current_a * step_s;
    data.time_s.edit().push_back(t);
    data.current_a.edit().push_back(current_a);
    data.voltage_v.edit().push_back(3.2 + 0.001 * t);
  }
  const EvenData even = evenly_sampled(data);
  EXPECT_TRUE(even.resampled);
  EXPECT_EQ(even.step_s, 1);
  EXPECT_NEAR(static_cast<double>(even.gap_samples), 39, 1);
  double resampled_as = 0;
  for (std::size_t k = 1; k < even.data.size(); ++k) {
    resampled_as += even.data.current_a[k] * even.step_s;
    if (!std::isfinite(even.data.voltage_v[k])) continue;
    EXPECT_NEAR(even.data.voltage_v[k], 3.2 + 0.001 * even.data.time_s[k], 1e-9) << k;
  }
  EXPECT_NEAR(resampled_as, charge_as, 2);  // the last part of a step is left out
  EXPECT_FALSE(evenly_sampled(pulses(1, 50)).resampled);
}

}  // namespace
}  // namespace bms::identification
