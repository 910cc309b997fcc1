// Problems of More, Garbow & Hillstrom, "Testing Unconstrained Optimization Software", ACM TOMS 7 (1981): residuals,
// the starts and the sums of squares printed there.
#pragma once

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <vector>

#include <ceres/jet.h>
#include <Eigen/Core>

namespace bms::identification {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

inline constexpr double infinity = std::numeric_limits<double>::infinity();

using Jet = ceres::Jet<double, 5>;
using Jets = std::vector<Jet>;
using Residuals = Jets (*)(const Jets& x);

inline VectorXd vector_of(const std::vector<double>& values) {
  return Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(values.size()));
}

inline std::function<bool(const VectorXd&, VectorXd&, MatrixXd*)> differentiated(
    std::function<Jets(const Jets&)> residuals) {
  return [residuals](const VectorXd& x, VectorXd& r, MatrixXd* jacobian) {
    Jets at;
    for (Index i = 0; i < x.size(); ++i) at.emplace_back(x[i], static_cast<int>(i));
    const Jets values = residuals(at);
    const auto m = static_cast<Index>(values.size());
    r.resize(m);
    if (jacobian != nullptr) jacobian->resize(m, x.size());
    for (Index k = 0; k < m; ++k) {
      r[k] = values[static_cast<std::size_t>(k)].a;
      if (jacobian != nullptr) jacobian->row(k) = values[static_cast<std::size_t>(k)].v.head(x.size()).transpose();
    }
    return r.allFinite();
  };
}

inline Jets rosenbrock(const Jets& x) { return {10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]}; }

inline Jets freudenstein_roth(const Jets& x) {
  return {-13.0 + x[0] + ((5.0 - x[1]) * x[1] - 2.0) * x[1], -29.0 + x[0] + ((x[1] + 1.0) * x[1] - 14.0) * x[1]};
}

inline Jets powell_singular(const Jets& x) {
  const Jet a = x[1] - 2.0 * x[2], b = x[0] - x[3];
  return {x[0] + 10.0 * x[1], std::sqrt(5.0) * (x[2] - x[3]), a * a, std::sqrt(10.0) * b * b};
}

inline Jets wood(const Jets& x) {
  return {10.0 * (x[1] - x[0] * x[0]),
          1.0 - x[0],
          std::sqrt(90.0) * (x[3] - x[2] * x[2]),
          1.0 - x[2],
          std::sqrt(10.0) * (x[1] + x[3] - 2.0),
          (x[1] - x[3]) / std::sqrt(10.0)};
}

inline Jets helical_valley(const Jets& x) {
  Jet turns = atan(x[1] / x[0]) / (2 * std::numbers::pi);
  if (x[0].a < 0) turns += Jet(0.5);
  return {10.0 * (x[2] - 10.0 * turns), 10.0 * (sqrt(x[0] * x[0] + x[1] * x[1]) - 1.0), x[2]};
}

inline Jets brown_badly_scaled(const Jets& x) { return {x[0] - 1e6, x[1] - 2e-6, x[0] * x[1] - 2.0}; }

inline Jets beale(const Jets& x) {
  return {1.5 - x[0] * (1.0 - x[1]), 2.25 - x[0] * (1.0 - x[1] * x[1]), 2.625 - x[0] * (1.0 - x[1] * x[1] * x[1])};
}

inline Jets box_3d(const Jets& x) {
  Jets r;
  for (int i = 1; i <= 10; ++i) {
    const double t = 0.1 * i;
    r.push_back(exp(-t * x[0]) - exp(-t * x[1]) - x[2] * (std::exp(-t) - std::exp(-10 * t)));
  }
  return r;
}

inline Jets bard(const Jets& x) {
  constexpr double y[] = {0.14, 0.18, 0.22, 0.25, 0.29, 0.32, 0.35, 0.39, 0.37, 0.58, 0.73, 0.96, 1.34, 2.10, 4.39};
  Jets r;
  for (int i = 1; i <= 15; ++i) {
    const double u = i, v = 16 - i, w = std::min(u, v);
    r.push_back(y[i - 1] - (x[0] + u / (v * x[1] + w * x[2])));
  }
  return r;
}

inline Jets kowalik_osborne(const Jets& x) {
  constexpr double y[] = {0.1957, 0.1947, 0.1735, 0.1600, 0.0844, 0.0627, 0.0456, 0.0342, 0.0323, 0.0235, 0.0246};
  constexpr double u[] = {4, 2, 1, 0.5, 0.25, 0.167, 0.125, 0.1, 0.0833, 0.0714, 0.0625};
  Jets r;
  for (int i = 0; i < 11; ++i)
    r.push_back(y[i] - x[0] * (u[i] * u[i] + u[i] * x[1]) / (u[i] * u[i] + u[i] * x[2] + x[3]));
  return r;
}

inline Jets meyer(const Jets& x) {
  constexpr double y[] = {34780, 28610, 23650, 19630, 16370, 13720, 11540, 9744,
                          8261,  7030,  6005,  5147,  4427,  3820,  3307,  2872};
  Jets r;
  for (int i = 1; i <= 16; ++i) r.push_back(x[0] * exp(x[1] / (45.0 + 5.0 * i + x[2])) - y[i - 1]);
  return r;
}

inline Jets jennrich_sampson(const Jets& x) {
  Jets r;
  for (int i = 1; i <= 10; ++i)
    r.push_back(2.0 + 2.0 * i - (exp(static_cast<double>(i) * x[0]) + exp(static_cast<double>(i) * x[1])));
  return r;
}

inline Jets brown_dennis(const Jets& x) {
  Jets r;
  for (int i = 1; i <= 20; ++i) {
    const double t = i / 5.0;
    const Jet a = x[0] + t * x[1] - std::exp(t), b = x[2] + std::sin(t) * x[3] - std::cos(t);
    r.push_back(a * a + b * b);
  }
  return r;
}

inline Jets osborne_1(const Jets& x) {
  constexpr double y[] = {0.844, 0.908, 0.932, 0.936, 0.925, 0.908, 0.881, 0.850, 0.818, 0.784, 0.751,
                          0.718, 0.685, 0.658, 0.628, 0.603, 0.580, 0.558, 0.538, 0.522, 0.506, 0.490,
                          0.478, 0.467, 0.457, 0.448, 0.438, 0.431, 0.424, 0.420, 0.414, 0.411, 0.406};
  Jets r;
  for (int i = 0; i < 33; ++i) r.push_back(y[i] - (x[0] + x[1] * exp(-10.0 * i * x[3]) + x[2] * exp(-10.0 * i * x[4])));
  return r;
}

struct Published {
  const char* name;
  Residuals residuals;
  std::vector<double> start;
  double sum_of_squares;
  double local_sum_of_squares = infinity;  ///< of another minimum that the paper names
  double zero = 1e-11;                     ///< what counts as a sum of squares of 0
};

inline const std::vector<Published>& published() {
  static const std::vector<Published> problems = {
      {"Rosenbrock", rosenbrock, {-1.2, 1}, 0},
      {"Freudenstein-Roth", freudenstein_roth, {0.5, -2}, 0, 48.9842},
      {"Powell singular", powell_singular, {3, -1, 0, 1}, 0},
      {"Wood", wood, {-3, -1, -3, -1}, 0},
      {"helical valley", helical_valley, {-1, 0, 0}, 0},
      {"Brown badly scaled", brown_badly_scaled, {1, 1}, 0, infinity, 1e-5},  // 1e-9 of its x0 = 1e6, Stopping::step,
                                                                              // squared
      {"Beale", beale, {1, 1}, 0},
      {"Box 3D", box_3d, {0, 10, 20}, 0},
      {"Bard", bard, {1, 1, 1}, 8.21487e-3},
      {"Kowalik-Osborne", kowalik_osborne, {0.25, 0.39, 0.415, 0.39}, 3.07505e-4},
      {"Meyer", meyer, {0.02, 4000, 250}, 87.9458},
      {"Jennrich-Sampson", jennrich_sampson, {0.3, 0.4}, 124.362},
      {"Brown-Dennis", brown_dennis, {25, 5, -5, -1}, 85822.2},
      {"Osborne 1", osborne_1, {0.5, 1.5, -1, 0.01, 0.02}, 5.46489e-5},
  };
  return problems;
}

}  // namespace bms::identification
