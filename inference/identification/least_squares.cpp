#include "identification/least_squares.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>

#include <Eigen/QR>

#include "identification/optimisers/optimisation.hpp"
#include "numerics/matrix_factors.hpp"

namespace bms::identification {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double epsilon = std::numeric_limits<double>::epsilon();
constexpr double rounding = 100 * epsilon;  // relative rounding error of a sum of squares
/// Pivot of a column of length 1 below which the column depends linearly on the others.
constexpr double dependent_columns = 1e-11;

void require(bool condition, const char* message) {
  if (!condition) throw std::invalid_argument(message);
}

VectorXd given_or(const VectorXd& values, Index n, double otherwise) {
  return values.size() == 0 ? VectorXd::Constant(n, otherwise) : values;
}

/// R of [J diag(scale), r]. Each round reduces the R so far and the next rows.
MatrixXd triangle(const MatrixXd& jacobian, const VectorXd& residuals, const VectorXd& scale) {
  const Index m = jacobian.rows(), n = jacobian.cols(), rows = std::max<Index>(256, 4 * n);
  MatrixXd block = MatrixXd::Zero(n + 1 + rows, n + 1);
  for (Index first = 0; first < m; first += rows) {
    const Index count = std::min(rows, m - first);
    block.block(n + 1, 0, count, n) = jacobian.middleRows(first, count) * scale.asDiagonal();
    block.col(n).segment(n + 1, count) = residuals.segment(first, count);
    block.bottomRows(rows - count).setZero();
    const Eigen::HouseholderQR<Eigen::Ref<MatrixXd>> in_place(block);
    for (Index k = 0; k < n; ++k) block.col(k).segment(k + 1, n - k).setZero();
  }
  return block.topRows(n + 1);
}

std::string sentence(const std::string& text, double value) {
  std::ostringstream out;
  out.precision(2);
  out << text << value << '.';
  return out.str();
}

}  // namespace

Optimisation::Optimisation(const LeastSquares& problem, const VectorXd& start, const Stopping& stopping)
    : problem_(problem), stopping_(stopping) {
  const Index n = start.size();
  require(n > 0, "least squares: no unknowns");
  require(start.allFinite(), "least squares: the start is not finite");
  require(static_cast<bool>(problem.evaluate), "least squares: no residuals");
  lower_ = given_or(problem.lower, n, -infinity);
  upper_ = given_or(problem.upper, n, infinity);
  scale_ = given_or(problem.scale, n, 1);
  require(lower_.size() == n && upper_.size() == n && scale_.size() == n,
          "least squares: start, bounds and scale differ in length");
  require((lower_.array() < upper_.array()).all(), "least squares: a lower bound is not below its upper bound");
  require(scale_.allFinite() && (scale_.array() > 0).all(), "least squares: a scale is not positive");
  column_norms_ = VectorXd::Zero(n);
  x_ = start.cwiseMax(lower_).cwiseMin(upper_);
  cost_ = infinity;
  if (!evaluate(x_, true) || !update_derivatives(x_))
    end(false, "The residuals or their derivatives are not defined at the start.");
}

bool Optimisation::evaluate(const VectorXd& x, bool derivatives) {
  ++evaluations_;
  const Index m = residuals_.size();
  if (!problem_.evaluate(x, residuals_, derivatives ? &jacobian_ : nullptr)) {
    residuals_.resize(m);  // its content is not used
    return false;
  }
  require(residuals_.size() > 0 && (m == 0 || residuals_.size() == m),
          "least squares: the number of residuals changes, or is 0");
  require(!derivatives || (jacobian_.rows() == residuals_.size() && jacobian_.cols() == x.size()),
          "least squares: J is not m by n");
  return std::isfinite(residuals_.squaredNorm());
}

double Optimisation::cost_at(const VectorXd& x) {
  return evaluate(x, false) ? 0.5 * residuals_.squaredNorm() : infinity;
}

bool Optimisation::move_to(const VectorXd& x) {
  const double before = cost_;
  if (!evaluate(x, true) || !(0.5 * residuals_.squaredNorm() <= before) || !update_derivatives(x)) return false;
  last_decrease_ = before > 0 ? (before - cost_) / before : 0;
  ++iterations_;
  return true;
}

bool Optimisation::update_derivatives(const VectorXd& x) {
  const Index n = x.size();
  const MatrixXd r = triangle(jacobian_, residuals_, scale_);
  if (!r.allFinite()) return false;
  x_ = x;
  cost_ = 0.5 * residuals_.squaredNorm();
  factor_ = r.topLeftCorner(n, n);
  rotated_ = r.col(n).head(n);
  gradient_ = factor_.transpose() * rotated_;
  below_ = (lower_ - x_).cwiseQuotient(scale_);
  above_ = (upper_ - x_).cwiseQuotient(scale_);
  column_norms_ = column_norms_.cwiseMax(factor_.colwise().norm().transpose());
  const double largest = column_norms_.maxCoeff();
  for (double& norm : column_norms_) {
    if (!(norm > 0)) norm = largest > 0 ? largest : 1;  // no information about this unknown yet
  }
  return true;
}

Indices Optimisation::free() const {
  Indices free;
  for (Index i = 0; i < size(); ++i) {
    const bool at_bound = (x_[i] <= lower_[i] && gradient_[i] >= 0) || (x_[i] >= upper_[i] && gradient_[i] <= 0);
    if (!at_bound) free.push_back(i);
  }
  return free;
}

double Optimisation::expected_change(const VectorXd& step) const {
  const VectorXd change = factor_ * step;
  return change.dot(rotated_) + 0.5 * change.squaredNorm();
}

double Optimisation::relative(const VectorXd& gradient) const {
  const double unit = std::sqrt(2 * cost_) * factor_.colwise().norm().maxCoeff();
  return unit > 0 && gradient.size() > 0 ? gradient.lpNorm<Eigen::Infinity>() / unit : 0;
}

bool Optimisation::is_short(const VectorXd& step, double tolerance) const {
  const auto is_short_times = [&](const VectorXd& weights) {
    const VectorXd size = x_.cwiseQuotient(scale_).cwiseAbs() +
                          VectorXd::Constant(x_.size(), tolerance);  // so that a search with its optimum at 0 ends
    return weights.cwiseProduct(step).norm() <= tolerance * weights.cwiseProduct(size).norm();
  };
  // also weighted by the effect on the residuals: without `scale` a large unknown would hide a small one
  return is_short_times(VectorXd::Ones(x_.size())) && is_short_times(column_norms_);
}

VectorXd Optimisation::after(const VectorXd& step) const {
  VectorXd x = x_ + scale_.cwiseProduct(step);
  for (Index i = 0; i < size(); ++i) {
    const double close = 8 * epsilon * std::max(std::abs(x_[i]), std::abs(x[i]));
    if (x[i] <= lower_[i] + close) x[i] = lower_[i];
    if (x[i] >= upper_[i] - close) x[i] = upper_[i];
  }
  return x;
}

/// The expected decrease of the cost by the undamped, complete Gauss-Newton step. It is the same for every method,
/// because the step of a method may be short only by damping, bisection or a radius.
Optimisation::Outlook Optimisation::outlook(const Indices& free) const {
  const VectorXd gradient = gradient_(free);
  MatrixXd a = factor_(Eigen::all, free);
  VectorXd norms = a.colwise().norm();
  for (double& norm : norms) norm = norm > 0 ? norm : 1;
  a = a * norms.cwiseInverse().asDiagonal();
  VectorXd step = VectorXd::Zero(size());
  if (!free.empty()) {
    const VectorXd p = numerics::solve_least_squares(a, -rotated_, dependent_columns);
    step(free) = p.cwiseQuotient(norms);
  }
  const double decrease = -expected_change(step);
  return {relative(gradient), cost_ > 0 ? decrease / cost_ : 0, is_short(step, stopping_.step)};
}

std::string Optimisation::convergence_reason(const Indices& free) const {
  if (!(cost_ > 0)) return "The residuals are zero.";
  const Outlook here = outlook(free);
  if (here.gradient <= stopping_.gradient)
    return sentence("The gradient is zero within its tolerance, relative value: ", here.gradient);
  if (here.short_step) return sentence("The step is shorter than its tolerance, relative value: ", stopping_.step);
  if (iterations_ > 0 && here.decrease <= stopping_.cost && last_decrease_ <= stopping_.cost) {
    return sentence("The cost does not decrease any more, expected relative decrease: ", here.decrease);
  }
  return "";
}

bool Optimisation::finished() {
  if (ended_) return true;
  const std::string why = convergence_reason(free());
  if (!why.empty()) {
    end(true, why);
  } else if (iterations_ >= stopping_.iterations) {
    end(false, sentence("Not converged in " + std::to_string(iterations_) + " iterations, expected relative decrease: ",
                        outlook(free()).decrease));
  }
  return ended_;
}

void Optimisation::no_decrease() {
  if (ended_) return;
  const Outlook here = outlook(free());
  const double decrease = here.decrease;
  if (decrease <= std::max(stopping_.cost, rounding)) {
    end(true, sentence("No smaller cost was found, and none is expected, expected relative decrease: ", decrease));
  } else if (here.gradient <= std::sqrt(rounding)) {
    // The cost is of second order in x, so it cannot show a smaller gradient. Where J loses rank at the optimum,
    // `decrease` cannot be used.
    end(true,
        sentence("No smaller cost was found, and the gradient is as small as the cost can resolve, relative value: ",
                 here.gradient));
  } else {
    end(false,
        sentence(
            "Not converged: no smaller cost was found, although the derivatives promise a decrease, relative value: ",
            decrease));
  }
}

void Optimisation::end(bool converged, const std::string& reason) {
  ended_ = true;
  converged_ = converged;
  reason_ = reason;
}

Optimum Optimisation::result() const {
  Optimum found;
  found.x = x_;
  found.cost = cost_;
  found.at_bound = Eigen::VectorXi::Zero(size());
  for (Index i = 0; i < size(); ++i) {
    if (x_[i] <= lower_[i])
      found.at_bound[i] = -1;
    else if (x_[i] >= upper_[i])
      found.at_bound[i] = 1;
  }
  if (gradient_.size() > 0) found.gradient = relative(gradient_(free()));
  found.iterations = iterations_;
  found.evaluations = evaluations_;
  found.converged = converged_;
  found.reason = reason_;
  return found;
}

VectorXd step_within_bounds(const Optimisation& run, const Solve& solve) {
  const MatrixXd& a = run.factor();
  const auto beyond = [&](Index i, double p) { return p < run.below()[i] || p > run.above()[i]; };

  VectorXd step = VectorXd::Zero(run.size()), b = run.rotated();
  Indices free = run.free();
  for (bool inside = false; !inside && !free.empty();) {
    const VectorXd p = solve(a(Eigen::all, free), b, free);
    Indices staying;
    for (std::size_t k = 0; k < free.size(); ++k) {
      const Index i = free[k];
      const double wanted = p[static_cast<Index>(k)];
      step[i] = std::clamp(wanted, run.below()[i], run.above()[i]);
      if (beyond(i, wanted)) {
        b += a.col(i) * step[i];
      } else {
        staying.push_back(i);
      }
    }
    inside = staying.size() == free.size();
    free = staying;
  }
  if (run.expected_change(step) < 0) return step;

  // Several bounds together made the step increase the cost: use the straight step up to the first bound instead.
  free = run.free();
  for (bool starts_inside = false; !starts_inside && !free.empty();) {
    const VectorXd p = solve(a(Eigen::all, free), run.rotated(), free);
    step.setZero();
    Indices staying;
    double length = 1;
    for (std::size_t k = 0; k < free.size(); ++k) {
      const Index i = free[k];
      step[i] = p[static_cast<Index>(k)];
      const double room = step[i] < 0 ? run.below()[i] : run.above()[i];
      if (room == 0 && step[i] != 0) continue;
      if (beyond(i, step[i])) length = std::min(length, room / step[i]);
      staying.push_back(i);
    }
    starts_inside = staying.size() == free.size();
    free = staying;
    if (starts_inside) return length * step;
  }
  return VectorXd::Zero(run.size());
}

Optimum minimise(const LeastSquares& problem, const VectorXd& start, Method method, const Stopping& stopping) {
  Optimisation run(problem, start, stopping);
  switch (method) {
    case Method::subspace_gauss_newton:
      search_gauss_newton(run);
      break;
    case Method::adaptive_subspace_gauss_newton:
      search_adaptive_gauss_newton(run);
      break;
    case Method::levenberg_marquardt:
      search_levenberg_marquardt(run);
      break;
    case Method::steepest_descent:
      search_steepest_descent(run);
      break;
    case Method::trust_region_reflective:
      search_trust_region_reflective(run);
      break;
  }
  return run.result();
}

LeastSquares with_first_fixed(const LeastSquares& whole, const Eigen::VectorXd& start, Eigen::Index first) {
  LeastSquares p;
  const Eigen::Index n = start.size() - first;
  const auto others = [n](const Eigen::VectorXd& v) { return Eigen::VectorXd(v.tail(std::min(n, v.size()))); };
  p.lower = others(whole.lower);
  p.upper = others(whole.upper);
  p.scale = others(whole.scale);
  p.evaluate = [evaluate = whole.evaluate, start, n](const Eigen::VectorXd& x, Eigen::VectorXd& r,
                                                     Eigen::MatrixXd* jacobian) {
    Eigen::VectorXd all = start;
    all.tail(n) = x;
    Eigen::MatrixXd of_all;
    if (!evaluate(all, r, jacobian != nullptr ? &of_all : nullptr)) return false;
    if (jacobian != nullptr) *jacobian = of_all.rightCols(n);
    return true;
  };
  return p;
}

const char* name_of(Method method) {
  switch (method) {
    case Method::subspace_gauss_newton:
      return "gn";
    case Method::adaptive_subspace_gauss_newton:
      return "agn";
    case Method::levenberg_marquardt:
      return "lm";
    case Method::steepest_descent:
      return "sd";
    case Method::trust_region_reflective:
      return "nls";
  }
  return "";
}

}  // namespace bms::identification
