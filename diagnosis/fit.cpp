// Maximum a posteriori of a hypothesis: damped Gauss-Newton over the mechanisms' parameters, the base parameters
// eliminated at every step (variable projection), bounds kept by an active set.
#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include <Eigen/Cholesky>

#include "diagnosis/hypothesis.hpp"

namespace bms::diagnosis {

struct LikelihoodModel::Linear {
  Columns columns;                     ///< white
  Eigen::LLT<Eigen::MatrixXd> normal;  ///< columns' columns + 1
};

namespace {

using model::catalogue;

constexpr double rarity = 0.5;         // of a strength: what is beyond the common, over this share of it, in deviations
constexpr double log_prior_width = 1;  // of a shape: a factor of e between its usual and an unusual value

/// How far a parameter is from what is known of most cells, in deviations, and what a deviation is; 0: nothing is
/// known.
struct Known {
  double away = 0, deviation = 0;
};

/// The sought parameters of a hypothesis as a fit moves them: shapes by their logarithm, all others linearly.
class Unknowns {
 public:
  Unknowns(const model::CellParameters<>& cell, const Hypothesis& start)
      : capacity_ah_(cell.capacity_ah), sought_(start.sought()) {
    // what is neither faster nor slower than R1 C1 is R1 C1
    const double rc_s = model::cell_detail::rc_value(cell.rc, cell.rc.r1_ohm, 0.5) *
                        model::cell_detail::rc_value(cell.rc, cell.rc.c1_f, 0.5);
    for (const ParameterRef& s : sought_) {
      const model::MechanismInfo& info = catalogue[start.settings[s.setting].index];
      const model::Parameter& p = info.parameter[s.parameter];
      const bool time = p.name == "time_constant_s";
      const double low = p.lower(capacity_ah_), high = p.upper(capacity_ah_);
      of_.push_back({&p, time && info.id == "slow_polarisation" ? std::clamp(2 * rc_s, low, 600.0) : low,
                     time && info.id == "fast_polarisation" ? std::clamp(rc_s / 3, 1.0, high) : high});
    }
  }

  Eigen::Index size() const { return static_cast<Eigen::Index>(of_.size()); }
  const std::vector<ParameterRef>& sought() const { return sought_; }
  double& of(Hypothesis& h, Eigen::Index j) const {
    const ParameterRef& s = sought_[static_cast<std::size_t>(j)];
    return h.settings[s.setting].value[s.parameter];
  }

  bool is_shape(Eigen::Index j) const { return at(j).parameter->role == model::Role::shape; }
  double held(Eigen::Index j, double v) const { return std::clamp(v, at(j).low, at(j).high); }
  /// d v / d step.
  double natural(Eigen::Index j, double v) const { return is_shape(j) ? v : (at(j).high - at(j).low) / 100; }
  double moved(Eigen::Index j, double v, double step) const {
    return held(j, is_shape(j) ? v * std::exp(step) : v + natural(j, v) * step);
  }
  /// Steps to the bounds; a shape goes no farther than 1.5 at once.
  std::pair<double, double> room(Eigen::Index j, double v) const {
    const auto [low, high] = std::pair(at(j).low, at(j).high);
    if (is_shape(j)) return {std::max(std::log(low / v), -1.5), std::min(std::log(high / v), 1.5)};
    return {(low - v) / natural(j, v), (high - v) / natural(j, v)};
  }
  bool at_bound(Eigen::Index j, double v) const {
    const double reach = 1e-9 * (at(j).high - at(j).low);
    return v <= at(j).low + reach || v >= at(j).high - reach;
  }

  /// Of a shape by its logarithm.
  Known known(Eigen::Index j, double v) const {
    const model::Parameter& p = *at(j).parameter;
    if (is_shape(j)) return {std::log(v / p.default_value(capacity_ah_)) / log_prior_width, log_prior_width};
    if (p.spread > 0) return {(v - p.typical) / p.spread, p.spread};
    const double common = p.common(capacity_ah_);
    if (common <= 0 || std::abs(v) <= common) return {};
    return {(v - std::copysign(common, v)) / (rarity * common), rarity * common};
  }
  double prior(Hypothesis& h) const {
    double sum = 0;
    for (Eigen::Index j = 0; j < size(); ++j) sum += std::pow(known(j, of(h, j)).away, 2);
    return sum;
  }

 private:
  struct One {
    const model::Parameter* parameter;
    double low, high;
  };
  const One& at(Eigen::Index j) const { return of_[static_cast<std::size_t>(j)]; }

  double capacity_ah_;
  std::vector<ParameterRef> sought_;
  std::vector<One> of_;
};

/// Step of damped normal equations. Those unknowns that would leave their room go to its end and no farther, and the
/// others' steps are those beside that; one round after the other.
Eigen::VectorXd bounded_step(const Eigen::MatrixXd& normal, const Eigen::VectorXd& rhs, double damping,
                             const Eigen::VectorXd& to_low, const Eigen::VectorXd& to_high) {
  const Eigen::Index m = rhs.size();
  std::vector<char> held(static_cast<std::size_t>(m), 0);
  const auto is_held = [&](Eigen::Index j) { return held[static_cast<std::size_t>(j)] != 0; };
  Eigen::VectorXd step = Eigen::VectorXd::Zero(m), reach(m);
  for (Eigen::Index round = 0; round <= m; ++round) {
    Eigen::MatrixXd s = normal;
    Eigen::VectorXd b = rhs;
    for (Eigen::Index j = 0; j < m; ++j)
      s(j, j) += damping * normal(j, j) + 1e-9 + 1e-12 * normal.diagonal().maxCoeff();
    for (Eigen::Index j = 0; j < m; ++j) {
      if (is_held(j)) b -= normal.col(j) * reach[j];
    }
    for (Eigen::Index j = 0; j < m; ++j) {
      if (!is_held(j)) continue;
      s.row(j).setZero();
      s.col(j).setZero();
      s(j, j) = 1;
      b[j] = reach[j];
    }
    step = s.ldlt().solve(b);
    bool more = false;
    for (Eigen::Index j = 0; j < m; ++j) {
      if (is_held(j) || (step[j] >= to_low[j] && step[j] <= to_high[j])) continue;
      held[static_cast<std::size_t>(j)] = 1;
      reach[j] = std::clamp(step[j], to_low[j], to_high[j]);
      more = true;
    }
    if (!more) break;
  }
  return step;
}

}  // namespace

std::shared_ptr<const LikelihoodModel::Linear> LikelihoodModel::linear(const Hypothesis& h,
                                                                       const Eigen::VectorXd& u) const {
  auto made = std::make_shared<Linear>();
  made->columns = calibration_derivatives(h, u);
  Eigen::MatrixXd normal = Eigen::MatrixXd::Identity(made->columns.cols(), made->columns.cols());
  normal.selfadjointView<Eigen::Lower>().rankUpdate(made->columns.transpose());
  made->normal.compute(normal);
  return made;
}

void LikelihoodModel::linearise(const Hypothesis& h, const Eigen::VectorXd& u) const { nearby_ = linear(h, u); }

HypothesisFit LikelihoodModel::fit(const Hypothesis& start, int iterations) const {
  return fit(start, unchanged(), iterations);
}

HypothesisFit LikelihoodModel::fit(const Hypothesis& start, const Eigen::VectorXd& calibration, int iterations,
                                   double hopeless) const {
  const Unknowns unknowns(cell_, start);
  const Eigen::Index m = unknowns.size();
  HypothesisFit fit{start, calibration, {}, 0, noise_, {}, std::vector<char>(static_cast<std::size_t>(m), 0), false};
  for (Eigen::Index j = 0; j < m; ++j)
    unknowns.of(fit.hypothesis, j) = unknowns.held(j, unknowns.of(fit.hypothesis, j));
  const auto cost_of = [&](Hypothesis& h, const Eigen::VectorXd& u, const Eigen::VectorXd& r) {
    return r.squaredNorm() + u.squaredNorm() + unknowns.prior(h);
  };
  fit.residual = residual(fit.hypothesis, fit.calibration);
  fit.cost = cost_of(fit.hypothesis, fit.calibration, fit.residual);
  const double cost_at_start = fit.cost;

  if (!nearby_) linearise(base(), unchanged());
  std::shared_ptr<const Linear> around = nearby_;
  int renewals = 0;
  constexpr int most_renewals = 6;
  double damping = 1e-3;
  Eigen::MatrixXd schur;
  Eigen::VectorXd natural = Eigen::VectorXd::Ones(m);  // d parameter / d internal
  int quiet = 0;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    Columns j_theta = derivatives(fit.hypothesis, fit.calibration, unknowns.sought());  // of nothing sought: no columns
    for (Eigen::Index j = 0; j < m; ++j) {
      natural[j] = unknowns.natural(j, unknowns.of(fit.hypothesis, j));
      j_theta.col(j) *= natural[j];
    }
    const Columns& j_u = around->columns;
    const Eigen::VectorXd g_u = j_u.transpose() * fit.residual - fit.calibration;
    const Eigen::VectorXd u_alone = around->normal.solve(g_u);
    Eigen::VectorXd g(m), rhs(m);
    Eigen::MatrixXd a(m, m), cross, solved;
    if (m > 0) {
      g = j_theta.transpose() * fit.residual;
      a = j_theta.transpose() * j_theta;
    }
    for (Eigen::Index j = 0; j < m; ++j) {
      const Known k = unknowns.known(j, unknowns.of(fit.hypothesis, j));
      if (k.deviation == 0) continue;
      const double per = unknowns.is_shape(j) ? 1 / k.deviation : natural[j] / k.deviation;
      g[j] -= k.away * per;
      a(j, j) += per * per;
    }
    // what a step could gain at most, were all linear and no bound in the way
    double within_reach = g_u.dot(u_alone);
    if (m > 0) {
      cross = j_u.transpose() * j_theta;
      solved = around->normal.solve(cross);
      schur = a - cross.transpose() * solved;
      rhs = g - cross.transpose() * u_alone;
      Eigen::MatrixXd regular = schur;
      for (Eigen::Index j = 0; j < m; ++j) regular(j, j) += 1e-6 * schur(j, j) + 1e-9;
      within_reach += rhs.dot(regular.ldlt().solve(rhs));
    }
    if (within_reach < 0.2) {
      fit.converged = true;
      break;
    }
    if (iteration >= 3 && fit.cost - 2 * within_reach > hopeless) break;

    Eigen::VectorXd to_low(m), to_high(m);
    for (Eigen::Index j = 0; j < m; ++j)
      std::tie(to_low[j], to_high[j]) = unknowns.room(j, unknowns.of(fit.hypothesis, j));
    bool better = false, astray = false;
    for (int attempt = 0; attempt < 8 && !better; ++attempt) {
      const Eigen::VectorXd step = m > 0 ? bounded_step(schur, rhs, damping, to_low, to_high) : Eigen::VectorXd();
      Hypothesis trial = fit.hypothesis;
      for (Eigen::Index j = 0; j < m; ++j)
        unknowns.of(trial, j) = unknowns.moved(j, unknowns.of(fit.hypothesis, j), step[j]);
      // where the base parameters' derivatives are stale, a shorter way is taken with theirs too
      const double way = 1 / (1 + 0.02 * damping);
      Eigen::VectorXd toward = u_alone;
      if (m > 0) toward -= solved * step;
      const Eigen::VectorXd u = fit.calibration + way * toward;
      const Eigen::VectorXd r = residual(trial, u);
      const double cost = cost_of(trial, u, r);
      double promised = g_u.dot(u_alone);
      if (m > 0) promised += 2 * rhs.dot(step) - step.dot(schur * step);
      if (fit.cost - cost < 0.3 * promised && promised > 2 + 1e-3 * fit.cost) astray = true;
      if (cost < fit.cost) {
        better = true;
        quiet = fit.cost - cost < 0.05 + 1e-5 * fit.cost ? quiet + 1 : 0;
        fit.hypothesis = trial;
        fit.calibration = u;
        fit.residual = r;
        fit.cost = cost;
        damping = std::max(damping / 5, 1e-9);
      } else {
        damping *= 8;
      }
    }
    if (better && quiet == 0 && !(astray && renewals < most_renewals)) continue;
    // far from where the base parameters were linearised, or not what was promised: once more from here
    if (renewals < (astray ? most_renewals : 2) && (astray || !better || cost_at_start - fit.cost > 50)) {
      ++renewals;
      quiet = 0;
      damping = astray ? std::max(1e-3, damping / 64) : 1e-3;
      around = linear(fit.hypothesis, fit.calibration);
      iterations = std::max(iterations, iteration + 5);
      continue;
    }
    fit.converged = true;
    break;
  }

  for (Eigen::Index j = 0; j < m; ++j)
    fit.at_bound[static_cast<std::size_t>(j)] = unknowns.at_bound(j, unknowns.of(fit.hypothesis, j)) ? 1 : 0;
  fit.covariance = Eigen::MatrixXd::Zero(m, m);
  if (m > 0) {
    Eigen::MatrixXd s = schur;
    for (Eigen::Index j = 0; j < m; ++j) s(j, j) += 1e-12 * schur.diagonal().maxCoeff() + 1e-12;
    const Eigen::MatrixXd inverse = s.ldlt().solve(Eigen::MatrixXd::Identity(m, m));
    fit.covariance = natural.asDiagonal() * inverse * natural.asDiagonal();
    for (Eigen::Index j = 0; j < m; ++j) {
      const ParameterRef& s_j = unknowns.sought()[static_cast<std::size_t>(j)];
      fit.hypothesis.settings[s_j.setting].deviation[s_j.parameter] = std::sqrt(std::max(fit.covariance(j, j), 0.0));
    }
  }
  return fit;
}

}  // namespace bms::diagnosis
