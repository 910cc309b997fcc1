// Trust region with affine scaling and reflections: Coleman & Li, "An interior trust region approach for nonlinear
// minimization subject to bounds", SIAM J. Optim. 6 (1996); Branch, Coleman & Li, SIAM J. Sci. Comput. 21 (1999).
//
//   v_i    distance to the bound in the direction of the negative gradient, at most 1 (a bound further away than the
//          size of x has no effect yet)
//   D      sqrt(v_i) / column norm i; steps p = D q
//   model  1/2 |R D q + Q'r|^2 + 1/2 q'Cq, C_i = |g_i| / column norm i^2 where v_i is a distance, otherwise 0
//
// Iterates stay off the bounds. If the optimum is at a bound, the last step goes onto it.
#include <algorithm>
#include <cmath>
#include <limits>

#include "identification/optimisers/optimisation.hpp"
#include "numerics/matrix_factors.hpp"

namespace bms::identification {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double infinity = std::numeric_limits<double>::infinity();

class ScaledModel {
 public:
  explicit ScaledModel(const Optimisation& run) : run_(run) {
    const Index n = run.size();
    scaling_.resize(n);
    curvature_ = VectorXd::Zero(n);
    VectorXd interior_gradient(n);
    for (Index i = 0; i < n; ++i) {
      const double g = run.gradient()[i], distance = g < 0 ? run.above()[i] : -run.below()[i];
      const double v = std::min(distance, 1.0), norm = run.column_norms()[i];
      scaling_[i] = std::sqrt(v) / norm;
      if (distance < 1) curvature_[i] = std::abs(g) / (norm * norm);
      interior_gradient[i] = v * g;
    }
    optimality_ = run.relative(interior_gradient);
    gradient_ = scaling_.cwiseProduct(run.gradient());
    MatrixXd both = MatrixXd::Zero(2 * n, n);
    both.topRows(n) = run.factor() * scaling_.asDiagonal();
    both.bottomRows(n).diagonal() = curvature_.cwiseSqrt();
    const numerics::ThinSvd svd = numerics::thin_svd(both);
    values_ = svd.values;
    vectors_ = svd.v;
    along_ = svd.u.topRows(n).transpose() * run.rotated();
  }

  const VectorXd& scaling() const { return scaling_; }
  const VectorXd& gradient() const { return gradient_; }
  double optimality() const { return optimality_; }  ///< v_i g_i, relative; 0 at an optimum, with or without bounds

  double curvature_term(const VectorXd& q) const { return 0.5 * curvature_.dot(q.cwiseAbs2()); }
  double change(const VectorXd& q) const { return run_.expected_change(scaling_.cwiseProduct(q)) + curvature_term(q); }

  /// The minimum of the model within the radius.
  VectorXd minimum(double radius) const {
    const double negligible = std::numeric_limits<double>::epsilon() * static_cast<double>(values_.size()) * values_[0];
    if (values_[values_.size() - 1] > negligible) {
      const VectorXd q = at(0);
      if (q.norm() <= radius) return q;
    }
    // |q(shift)| = radius: Newton's method for 1 / |q|, which is nearly linear in the shift, between bounds
    double low = 0, high = values_.cwiseProduct(along_).norm() / radius, shift = 1e-3 * high;
    for (int k = 0; k < 60; ++k) {
      const VectorXd q = at(shift);
      const double norm = q.norm();
      if (std::abs(norm - radius) <= 1e-3 * radius) break;
      (norm > radius ? low : high) = shift;
      double slope = 0;  // of |q|^2 / 2, negative
      for (Index i = 0; i < values_.size(); ++i) {
        const double denominator = values_[i] * values_[i] + shift;
        if (denominator > 0) slope -= std::pow(values_[i] * along_[i], 2) / std::pow(denominator, 3);
      }
      double next = slope < 0 ? shift - (norm - radius) / radius * norm * norm / slope : low;
      if (!(next > low && next < high)) next = low > 0 ? std::sqrt(low * high) : 1e-3 * high;
      if (high <= std::numeric_limits<double>::min()) break;
      shift = next;
    }
    const VectorXd q = at(shift);
    return q.norm() > radius ? VectorXd(q * (radius / q.norm())) : q;
  }

  /// `from` plus the best multiple of `direction` between `least` and `most`.
  VectorXd best_along(const VectorXd& from, const VectorXd& direction, double least, double most) const {
    const double at_0 = change(from), at_1 = change(from + direction);
    const double slope = (change(from + 0.5 * direction) - at_0) * 4 - (at_1 - at_0);  // exact: the model is a parabola
    const double curve = 2 * (at_1 - at_0 - slope);
    const double end = slope < 0 ? most : least;
    const double t = curve > 0 ? -slope / curve : end;
    return from + std::clamp(t, least, most) * direction;
  }

 private:
  VectorXd at(double shift) const {
    VectorXd weights(values_.size());
    for (Index i = 0; i < values_.size(); ++i) {
      const double denominator = values_[i] * values_[i] + shift;
      weights[i] = denominator > 0 ? -values_[i] * along_[i] / denominator : 0;
    }
    return vectors_ * weights;
  }

  const Optimisation& run_;
  VectorXd scaling_, curvature_, gradient_, values_, along_;
  MatrixXd vectors_;
  double optimality_ = 0;
};

/// Multiple of `direction` from `from` to the first bound.
double to_bound(const Optimisation& run, const VectorXd& from, const VectorXd& direction) {
  double length = infinity;
  for (Index i = 0; i < run.size(); ++i) {
    if (direction[i] > 0) length = std::min(length, (run.above()[i] - from[i]) / direction[i]);
    if (direction[i] < 0) length = std::min(length, (run.below()[i] - from[i]) / direction[i]);
  }
  return std::max(length, 0.0);
}

/// Multiple of `direction` from `from`, which is within the radius, to the radius.
double to_radius(const VectorXd& from, const VectorXd& direction, double radius) {
  const double a = direction.squaredNorm(), b = from.dot(direction),
               c = std::min(from.squaredNorm() - radius * radius, 0.0);
  if (!(a > 0)) return 0;
  const double root = std::sqrt(b * b - a * c);
  return b > 0 ? -c / (b + root) : (root - b) / a;
}

/// q of the best of three steps: that of the trust region up to the first bound, the same reflected there, and that
/// along the scaled gradient.
VectorXd best_step(const Optimisation& run, const ScaledModel& model, double radius) {
  const VectorXd zero = VectorXd::Zero(run.size()), &d = model.scaling();
  // part of the way to a bound; it tends to 1, otherwise the convergence would be linear
  const double keep_off = std::max(0.995, 1 - model.optimality());
  const VectorXd full = model.minimum(radius);
  const VectorXd step = d.cwiseProduct(full);
  const double hit = to_bound(run, zero, step);
  if (hit > 1) return full;

  VectorXd best = full * (hit * keep_off);
  const auto consider = [&](const VectorXd& q) {
    if (model.change(q) < model.change(best)) best = q;
  };

  VectorXd reflected = full;
  for (Index i = 0; i < run.size(); ++i) {
    const double room = step[i] < 0 ? run.below()[i] : run.above()[i];
    if (step[i] != 0 && room / step[i] <= hit) reflected[i] = -reflected[i];
  }
  const VectorXd corner = full * hit;
  const double next_hit = to_bound(run, step * hit, d.cwiseProduct(reflected));
  const double radius_hit = to_radius(corner, reflected, radius), most = std::min(next_hit * keep_off, radius_hit);
  if (most > 0) consider(model.best_along(corner, reflected, std::min((1 - keep_off) * hit, most), most));

  const VectorXd downhill = -model.gradient();
  const double gradient_hit =
      std::min(to_radius(zero, downhill, radius), keep_off * to_bound(run, zero, d.cwiseProduct(downhill)));
  if (gradient_hit > 0) consider(model.best_along(zero, downhill, 0, gradient_hit));
  return best;
}

/// A step onto the active bounds: those nearer than the minimum along their unknown.
struct Landing {
  VectorXd step;
  Indices elsewhere;  ///< the other unknowns
};

Landing landing(const Optimisation& run) {
  Landing landing{VectorXd::Zero(run.size()), {}};
  for (Index i = 0; i < run.size(); ++i) {
    const double g = run.gradient()[i], room = g < 0 ? run.above()[i] : run.below()[i], norm = run.column_norms()[i];
    if (g == 0 || std::abs(room) * norm * norm > std::abs(g)) {
      landing.elsewhere.push_back(i);
    } else {
      landing.step[i] = room;
    }
  }
  return landing;
}

void land(Optimisation& run, const Landing& landing) {
  if (!landing.step.isZero(0)) run.move_to(run.after(landing.step));
}

/// One step that decreases the cost, with smaller radii as necessary. Returns false if no step decreases it.
bool move(Optimisation& run, double& radius) {
  const ScaledModel model(run);
  for (;;) {
    const VectorXd q = best_step(run, model, radius), step = model.scaling().cwiseProduct(q);
    const VectorXd x = run.after(step);
    const double expected = model.change(q), before = run.cost();
    if (!(expected < 0) || x == run.x()) return false;
    const double cost = run.cost_at(x), size = q.norm();
    const double gain = (cost - before + model.curvature_term(q)) / expected;  // -infinity where not defined
    if (!(gain >= 0.25)) {
      radius = 0.25 * size;
    } else if (gain > 0.75 && size > 0.95 * radius) {
      radius *= 2;
    }
    if (cost < before) {
      if (run.move_to(x)) return true;
      radius = 0.25 * size;  // J is not defined there, although r is
    }
  }
}

}  // namespace

void search_trust_region_reflective(Optimisation& run) {
  if (run.ended()) return;
  double radius = run.x().cwiseQuotient(run.scale()).cwiseProduct(run.column_norms()).norm();
  if (!(radius > 0)) radius = run.column_norms().norm();
  for (;;) {
    const Landing approach = landing(run);
    if (run.would_converge(approach.elsewhere)) land(run, approach);
    if (run.finished()) return;
    if (move(run, radius)) continue;
    land(run, landing(run));
    if (!run.finished()) run.no_decrease();
    return;
  }
}

}  // namespace bms::identification
