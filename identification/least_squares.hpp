// Nonlinear least squares: minimise 1/2 |r(x)|^2, lower <= x <= upper. The problem, what came out, and the methods of
// the paper (Appendix B). Values of x of very different size (ohm and farad) are common: `scale` says what one is like.
#pragma once

#include <functional>
#include <string>

#include <Eigen/Core>

namespace bms::identification {

struct LeastSquares {
  /// r of length m, J = dr/dx (m by n) where it is asked for. False: not defined at x (a simulation that left the
  /// finite numbers).
  std::function<bool(const Eigen::VectorXd& x, Eigen::VectorXd& r, Eigen::MatrixXd* jacobian)> evaluate;
  Eigen::VectorXd lower, upper;  ///< of length n, or empty: none. Infinite entries: none on that side. lower < upper
  Eigen::VectorXd scale;         ///< typical size of each x, > 0, or empty: all 1
};

enum class Method {
  subspace_gauss_newton,           ///< `gn`
  adaptive_subspace_gauss_newton,  ///< `agn`
  levenberg_marquardt,             ///< `lm`
  steepest_descent,                ///< `sd`
  trust_region_reflective,         ///< `nls`
};

struct Stopping {
  double gradient =
      1e-10;            ///< largest scaled, projected gradient, relative to |r| times the largest scaled column of J
  double step = 1e-9;   ///< |scaled step| / |scaled x|
  double cost = 1e-12;  ///< relative decrease, expected and reached
  int iterations = 200;
};

struct Optimum {
  Eigen::VectorXd x;         ///< never outside the bounds, not even while searching
  double cost = 0;           ///< 1/2 |r(x)|^2
  double gradient = 0;       ///< at x, as Stopping::gradient measures it
  Eigen::VectorXi at_bound;  ///< -1 at the lower bound, 1 at the upper, 0 inside
  int iterations = 0;        ///< accepted steps
  int evaluations = 0;       ///< of r, with or without its derivatives
  bool converged = false;
  std::string reason;  ///< why it ended, for a person
};

/// Throws std::invalid_argument when sizes disagree, lower >= upper or the start is not finite. A start outside the
/// bounds is moved inside. A start where r is not defined: not converged, with that reason. The same arguments give the
/// same result, bit for bit.
Optimum minimise(const LeastSquares& problem, const Eigen::VectorXd& start, Method method,
                 const Stopping& stopping = {});

/// gn, agn, lm, sd, nls.
const char* name_of(Method method);

}  // namespace bms::identification
