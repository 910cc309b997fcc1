#include "identification/decay_fit.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Dense>

#include "measurement/statistics.hpp"
#include "numerics/matrix_factors.hpp"

namespace bms::identification {

namespace {

/// A and B for a given tau.
Decay decay_of(const Trace& trace, double tau_s) {
  double s1 = 0, se = 0, see = 0, sv = 0, sev = 0;
  const double v0 = trace.v.front();  // offset that keeps the digits: voltages differ by millivolts
  for (std::size_t k = 0; k < trace.v.size(); ++k) {
    const double e = std::exp(-trace.t_s[k] / tau_s), v = trace.v[k] - v0;
    s1 += 1;
    se += e;
    see += e * e;
    sv += v;
    sev += e * v;
  }
  Decay d{0, 0, tau_s, INFINITY};
  const double determinant = s1 * see - se * se;
  if (!(determinant > 1e-12 * s1 * see)) return d;
  d.amplitude_v = (s1 * sev - se * sv) / determinant;
  d.level_v = v0 + (sv - d.amplitude_v * se) / s1;
  d.squares = 0;
  for (std::size_t k = 0; k < trace.v.size(); ++k) {
    const double residual_v = d.level_v + d.amplitude_v * std::exp(-trace.t_s[k] / tau_s) - trace.v[k];
    d.squares += residual_v * residual_v;
  }
  return d;
}

}  // namespace

Decay best_decay(const Trace& trace) {
  const double least = std::max(trace.t_s.back() / static_cast<double>(trace.t_s.size()) / 3, 1e-3),
               most = 10 * trace.t_s.back();
  // first on a grid, because a long flat tail makes further minima, then by golden section between grid points
  constexpr int taus = 40;
  const double ratio = std::pow(most / least, 1.0 / taus);
  Decay best;
  for (int k = 0; k <= taus; ++k) {
    const Decay d = decay_of(trace, least * std::pow(ratio, k));
    if (d.squares < best.squares) best = d;
  }
  if (!std::isfinite(best.squares)) return best;
  double low = std::log(best.tau_s / ratio), high = std::log(best.tau_s * ratio);
  for (int k = 0; k < 40; ++k) {
    const double part = (std::numbers::phi - 1) * (high - low);
    const Decay left = decay_of(trace, std::exp(high - part)), right = decay_of(trace, std::exp(low + part));
    if (left.squares < right.squares)
      high = low + part;
    else
      low = high - part;
    if (left.squares < best.squares) best = left;
    if (right.squares < best.squares) best = right;
  }
  return best;
}

Trace without_outliers(const Trace& trace, const Decay& decay) {
  std::vector<double> residual_v;
  for (std::size_t k = 0; k < trace.v.size(); ++k)
    residual_v.push_back(
        std::abs(decay.level_v + decay.amplitude_v * std::exp(-trace.t_s[k] / decay.tau_s) - trace.v[k]));
  const double bound = std::max(5 * 1.4826 * measurement::median(residual_v), 1e-9);
  Trace kept;
  for (std::size_t k = 0; k < trace.v.size(); ++k) {
    if (residual_v[k] > bound) continue;
    kept.t_s.push_back(trace.t_s[k]);
    kept.v.push_back(trace.v[k]);
  }
  return kept;
}

Eigen::Matrix3d covariance_of(const FittedDecay& fitted, double variance_v2) {
  const Decay& decay = fitted.decay;
  const std::size_t n = fitted.trace.v.size();
  Eigen::MatrixXd slope(static_cast<Eigen::Index>(n), 3);
  for (std::size_t k = 0; k < n; ++k) {
    const double t_s = fitted.trace.t_s[k], e = std::exp(-t_s / decay.tau_s);
    slope.row(static_cast<Eigen::Index>(k)) << 1, e, decay.amplitude_v * e * t_s / (decay.tau_s * decay.tau_s);
  }
  const Eigen::Vector3d size = slope.colwise().norm().cwiseMax(1e-300);
  slope *= size.cwiseInverse().asDiagonal();
  const Eigen::Matrix3d normal = slope.transpose() * slope;
  const Eigen::Matrix3d inverse = numerics::pseudo_inverse(normal);
  return variance_v2 * (size.cwiseInverse().asDiagonal() * inverse * size.cwiseInverse().asDiagonal());
}

FirstSamples first_samples(const FittedDecay& fitted) {
  const Trace& trace = fitted.trace;
  const Decay& decay = fitted.decay;
  FirstSamples first;
  while (first.count < trace.v.size() &&
         (first.count < 5 || trace.t_s[first.count] < trace.t_s[0] + 0.02 * decay.tau_s)) {
    first.residual_v +=
        trace.v[first.count] - decay.level_v - decay.amplitude_v * std::exp(-trace.t_s[first.count] / decay.tau_s);
    ++first.count;
  }
  first.residual_v /= static_cast<double>(first.count);
  return first;
}

}  // namespace bms::identification
