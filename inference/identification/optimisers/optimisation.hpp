// What the five methods of least_squares.hpp share: the state of a search and its termination.
//
// Steps are in scaled unknowns z = x / scale. The m rows of J are read once per point and reduced to the n rows of R,
// J diag(scale) = Q R, and to Q'r; all methods work on these. R is used instead of J'J because its condition number is
// the square root of the other's. Cost per point: 2 m (n + 1)^2 operations, 256 rows at a time, without a copy of J or
// Q.
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "identification/least_squares.hpp"

namespace bms::identification {

/// Part of the linear decrease that a step must achieve (Armijo).
inline constexpr double sufficient_decrease = 1e-4;

using Indices = std::vector<Eigen::Index>;

class Optimisation {
 public:
  /// Throws as minimise() does, and evaluates the start.
  Optimisation(const LeastSquares& problem, const Eigen::VectorXd& start, const Stopping& stopping);

  // At the current x. The cost never increases.
  const Eigen::VectorXd& x() const { return x_; }
  double cost() const { return cost_; }
  const Eigen::MatrixXd& factor() const { return factor_; }              ///< R
  const Eigen::VectorXd& rotated() const { return rotated_; }            ///< the first n elements of Q'r
  const Eigen::VectorXd& gradient() const { return gradient_; }          ///< R'Q'r
  const Eigen::VectorXd& below() const { return below_; }                ///< smallest step within the bounds, <= 0
  const Eigen::VectorXd& above() const { return above_; }                ///< largest step within the bounds, >= 0
  const Eigen::VectorXd& column_norms() const { return column_norms_; }  ///< of R, largest so far, > 0 (More 1978)
  const Eigen::VectorXd& scale() const { return scale_; }
  Eigen::Index size() const { return x_.size(); }
  Eigen::Index rows() const { return residuals_.size(); }
  const Stopping& stopping() const { return stopping_; }

  /// All unknowns except those that the gradient keeps at a bound.
  Indices free() const;
  /// Change of the cost by a step, for a linear r.
  double expected_change(const Eigen::VectorXd& step) const;
  /// Largest entry of a gradient as Stopping::gradient measures it.
  double relative(const Eigen::VectorXd& gradient) const;
  bool is_short(const Eigen::VectorXd& step, double tolerance) const;

  /// x after a step, within the bounds. A value that misses a bound only by rounding is set to the bound.
  Eigen::VectorXd after(const Eigen::VectorXd& step) const;
  /// Infinite if r is not defined there.
  double cost_at(const Eigen::VectorXd& x);
  /// Moves to x and evaluates the derivatives. Returns false, and stays, if r or J is not defined or the cost
  /// increases.
  bool move_to(const Eigen::VectorXd& x);

  bool ended() const { return ended_; }
  /// Ends the search if the criteria are met at x or the iterations are used up. Every method calls it before each
  /// step.
  bool finished();
  /// Returns true if the criteria would be met with only these unknowns free.
  bool would_converge(const Indices& free) const { return !convergence_reason(free).empty(); }
  /// Ends the search because no smaller cost was found; converged if none was expected.
  void no_decrease();

  Optimum result() const;

 private:
  struct Outlook {
    double gradient, decrease;  // relative
    bool short_step;
  };
  bool evaluate(const Eigen::VectorXd& x, bool derivatives);
  bool update_derivatives(const Eigen::VectorXd& x);
  Outlook outlook(const Indices& free) const;
  std::string convergence_reason(const Indices& free) const;
  void end(bool converged, const std::string& reason);

  const LeastSquares& problem_;
  const Stopping stopping_;
  Eigen::VectorXd lower_, upper_, scale_;
  Eigen::VectorXd x_, residuals_, rotated_, gradient_, below_, above_, column_norms_;
  Eigen::MatrixXd jacobian_, factor_;
  double cost_ = 0, last_decrease_ = 0;  // the decrease is relative
  int iterations_ = 0, evaluations_ = 0;
  bool ended_ = false, converged_ = false;
  std::string reason_;
};

/// Minimises |A p + b|^2, with the damping of the method, over the free unknowns.
using Solve = std::function<Eigen::VectorXd(const Eigen::MatrixXd& a, const Eigen::VectorXd& b, const Indices& free)>;

/// The step of `solve` within the bounds: unknowns that would leave are set to their bound and the others are solved
/// again. The step is zero or decreases the cost.
Eigen::VectorXd step_within_bounds(const Optimisation& run, const Solve& solve);

/// One complete Gauss-Newton step, shortened until the cost decreases. It leads along the edge of a region where r is
/// not defined (an unstable model), at which damped steps and steps in a small subspace end. Returns false if no length
/// decreases the cost.
bool move_undamped(Optimisation& run);

/// Step in the subspace of the singular values above tolerance * largest, bisected until the cost decreases.
void search_gauss_newton(Optimisation& run);

/// The same with a tolerance that grows after bisections and shrinks otherwise (Wills & Ninness 2008).
void search_adaptive_gauss_newton(Optimisation& run);

/// Damped in proportion to the largest columns of J so far (More 1978); damping updated after Nielsen (1999).
void search_levenberg_marquardt(Optimisation& run);

/// Along the negative gradient of the scaled unknowns; length halved or doubled, Armijo's condition.
void search_steepest_descent(Optimisation& run);

/// Interior points, affine scaling, steps reflected at the bounds (Coleman & Li 1996; Branch, Coleman & Li 1999).
void search_trust_region_reflective(Optimisation& run);

}  // namespace bms::identification
