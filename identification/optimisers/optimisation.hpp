// What the five methods of least_squares.hpp share: where a search stands, and when it ends.
//
// Steps are in scaled unknowns z = x / scale. The m rows of J are looked at once per point and reduced to the n rows of
// R, J diag(scale) = Q R, and to Q'r; all methods work on these. R rather than J'J: its condition is the root of the
// other's. Cost per point: 2 m (n + 1)^2 operations, 256 rows at a time. No copy of J, no Q.
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "identification/least_squares.hpp"

namespace bms::identification {

/// Part of the linear decrease that a step must reach (Armijo).
inline constexpr double sufficient_decrease = 1e-4;

using Indices = std::vector<Eigen::Index>;

class Optimisation {
 public:
  /// Throws as minimise() does, and evaluates the start.
  Optimisation(const LeastSquares& problem, const Eigen::VectorXd& start, const Stopping& stopping);

  // At the present x. Cost never rises.
  const Eigen::VectorXd& x() const { return x_; }
  double cost() const { return cost_; }
  const Eigen::MatrixXd& factor() const { return factor_; }              ///< R
  const Eigen::VectorXd& rotated() const { return rotated_; }            ///< Q'r, its first n
  const Eigen::VectorXd& gradient() const { return gradient_; }          ///< R'Q'r
  const Eigen::VectorXd& below() const { return below_; }                ///< smallest step that stays inside, <= 0
  const Eigen::VectorXd& above() const { return above_; }                ///< largest step that stays inside, >= 0
  const Eigen::VectorXd& column_norms() const { return column_norms_; }  ///< of R, the largest so far, > 0 (More 1978)
  const Eigen::VectorXd& scale() const { return scale_; }
  Eigen::Index size() const { return x_.size(); }
  Eigen::Index rows() const { return residuals_.size(); }
  const Stopping& stopping() const { return stopping_; }

  /// All but those at a bound that the gradient holds there.
  Indices free() const;
  /// Change of the cost by a step if r were linear.
  double expected_change(const Eigen::VectorXd& step) const;
  /// Largest entry of a gradient as Stopping::gradient measures it.
  double relative(const Eigen::VectorXd& gradient) const;
  bool is_short(const Eigen::VectorXd& step, double tolerance) const;

  /// x after a step, inside the bounds; on a bound exactly where the rounding alone would keep it off.
  Eigen::VectorXd after(const Eigen::VectorXd& step) const;
  /// Infinite where r is not defined.
  double cost_at(const Eigen::VectorXd& x);
  /// Derivatives there too. False, and the search stays: not defined there, or no smaller cost.
  bool move_to(const Eigen::VectorXd& x);

  bool ended() const { return ended_; }
  /// Ends the search if the criteria are met at x, or the iterations are used up. Every method asks so before each
  /// step.
  bool finished();
  /// Would the criteria be met if only these unknowns could move?
  bool would_converge(const Indices& free) const { return !convergence_reason(free).empty(); }
  /// No smaller cost was found. Converged after all where none was to be expected.
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
  double cost_ = 0, last_decrease_ = 0;  // the latter relative
  int iterations_ = 0, evaluations_ = 0;
  bool ended_ = false, converged_ = false;
  std::string reason_;
};

/// Minimises |A p + b|^2, and what the method adds to it, over the free unknowns.
using Solve = std::function<Eigen::VectorXd(const Eigen::MatrixXd& a, const Eigen::VectorXd& b, const Indices& free)>;

/// The step that `solve` gives, within the bounds: what would leave goes onto its bound and the others are solved
/// again. Zero, or downhill.
Eigen::VectorXd step_within_bounds(const Optimisation& run, const Solve& solve);

/// In the subspace of the singular values above tolerance * largest; bisected until the cost falls.
void search_gauss_newton(Optimisation& run);

/// The same, with a tolerance that grows when bisections were needed and shrinks when none was (Wills & Ninness 2008).
void search_adaptive_gauss_newton(Optimisation& run);

/// Damped in proportion to the largest columns of J so far (More 1978); damping updated after Nielsen (1999).
void search_levenberg_marquardt(Optimisation& run);

/// Along the negative gradient of the scaled unknowns; length halved or doubled, Armijo's condition.
void search_steepest_descent(Optimisation& run);

/// Interior points, affine scaling, steps reflected at the bounds (Coleman & Li 1996; Branch, Coleman & Li 1999).
void search_trust_region_reflective(Optimisation& run);

}  // namespace bms::identification
