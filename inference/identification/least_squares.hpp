// Nonlinear least squares: minimise 1/2 |r(x)|^2 with lower <= x <= upper. Problem, result, and the methods of the
// paper (Appendix B). The unknowns often differ greatly in size (ohm and farad): `scale` is the typical size of each.
#pragma once

#include <functional>
#include <string>

#include <Eigen/Core>

namespace bms::identification {

struct LeastSquares {
  /// Sets r (length m) and, unless null, J = dr/dx (m by n). Returns false if r is not defined at x, e.g. because a
  /// simulation is not finite.
  std::function<bool(const Eigen::VectorXd& x, Eigen::VectorXd& r, Eigen::MatrixXd* jacobian)> evaluate;
  Eigen::VectorXd lower, upper;  ///< of length n, or empty: no bounds. Infinite entries: no bound there. lower < upper
  Eigen::VectorXd scale;         ///< typical size of each unknown, > 0; empty: all 1
};

enum class Method {
  subspace_gauss_newton,           ///< `gn`
  adaptive_subspace_gauss_newton,  ///< `agn`
  levenberg_marquardt,             ///< `lm`
  steepest_descent,                ///< `sd`
  trust_region_reflective,         ///< `nls`
};

struct Stopping {
  /// Largest scaled, projected gradient, relative to |r| times the largest scaled column of J.
  double gradient = 1e-10;
  double step = 1e-9;   ///< |scaled step| / |scaled x|
  double cost = 1e-12;  ///< relative decrease of the cost, expected and reached
  int iterations = 200;
};

struct Optimum {
  Eigen::VectorXd x;         ///< never outside the bounds, not even during the search
  double cost = 0;           ///< 1/2 |r(x)|^2
  double gradient = 0;       ///< at x, as Stopping::gradient measures it
  Eigen::VectorXi at_bound;  ///< -1 at the lower bound, 1 at the upper, 0 inside
  int iterations = 0;        ///< accepted steps
  int evaluations = 0;       ///< of r, with or without its derivatives
  bool converged = false;
  std::string reason;  ///< why the search ended, a sentence for the user
};

/// Throws std::invalid_argument if sizes differ, lower >= upper or the start is not finite. A start outside the bounds
/// is clamped. If r is not defined at the start, the result is not converged, with that reason. The same arguments give
/// a bit-identical result.
Optimum minimise(const LeastSquares& problem, const Eigen::VectorXd& start, Method method,
                 const Stopping& stopping = {});

/// The problem with its first unknowns fixed at `start`, for the others.
LeastSquares with_first_fixed(const LeastSquares& whole, const Eigen::VectorXd& start, Eigen::Index first);

/// gn, agn, lm, sd, nls.
const char* name_of(Method method);

}  // namespace bms::identification
