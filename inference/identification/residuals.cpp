#include "identification/residuals.hpp"

#include <algorithm>
#include <cmath>

namespace bms::identification {

namespace {

/// sum a[k] b[k + lag]
double product(const Eigen::VectorXd& a, const Eigen::VectorXd& b, Eigen::Index lag) {
  const Eigen::Index n = a.size() - lag;
  return n > 0 ? a.head(n).dot(b.tail(n)) : 0;
}

}  // namespace

Eigen::VectorXd without_missing(const Eigen::VectorXd& values) {
  std::vector<double> kept;
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    if (std::isfinite(values[k])) kept.push_back(values[k]);
  }
  return Eigen::Map<const Eigen::VectorXd>(kept.data(), static_cast<Eigen::Index>(kept.size()));
}

double correlation_length(const Eigen::VectorXd& residuals) {
  const double power = residuals.squaredNorm();
  if (!(power > 0)) return 1;
  const double white_band = 2 / std::sqrt(static_cast<double>(residuals.size()));
  double length = 1;
  // at growing lags, each of which stands for those since the one before, so that long runs cost little
  Eigen::Index before = 0;
  for (Eigen::Index lag = 1; lag < residuals.size() / 2; lag = std::max(lag + 1, lag + lag / 8)) {
    const double correlation = product(residuals, residuals, lag) / power;
    if (correlation < white_band) break;
    length += 2 * correlation * static_cast<double>(lag - before);
    before = lag;
  }
  return length;
}

Whiteness whiteness(const Eigen::VectorXd& residuals) {
  constexpr Eigen::Index lags = 20;
  Whiteness test{0, 37.566};  // chi-squared of 20 degrees of freedom, 99 %
  const double power = residuals.squaredNorm();
  const Eigen::Index n = residuals.size();
  if (!(power > 0) || n <= lags) return test;
  for (Eigen::Index lag = 1; lag <= lags; ++lag)
    test.statistic += std::pow(product(residuals, residuals, lag) / power, 2) / static_cast<double>(n - lag);
  test.statistic *= static_cast<double>(n * (n + 2));
  return test;
}

ResidualAnalysis analyse(const Eigen::VectorXd& residuals, const Eigen::VectorXd& current, int lags) {
  ResidualAnalysis a;
  const auto n = static_cast<double>(residuals.size());
  if (residuals.size() < 2) return a;
  a.mean_v = residuals.mean();
  const Eigen::VectorXd r = residuals.array() - a.mean_v, u = current.array() - current.mean();
  a.correlation_length = correlation_length(r);
  a.mean_band_v = 2 * std::sqrt(r.squaredNorm() / n / (n / a.correlation_length));
  a.white_band = 2 / std::sqrt(n);
  const double power = r.squaredNorm(), input_power = std::sqrt(power * u.squaredNorm());
  const auto outside = [&](double correlation) { return std::abs(correlation) > a.white_band; };
  for (Eigen::Index lag = 0; lag <= lags; ++lag) {
    if (lag > 0) a.autocorrelation.push_back(power > 0 ? product(r, r, lag) / power : 0);
    a.input_correlation.push_back(input_power > 0 ? product(u, r, lag) / input_power : 0);
  }
  a.autocorrelated =
      static_cast<double>(std::count_if(a.autocorrelation.begin(), a.autocorrelation.end(), outside)) / lags;
  a.input_correlated =
      static_cast<double>(std::count_if(a.input_correlation.begin(), a.input_correlation.end(), outside)) / (lags + 1);
  return a;
}

Eigen::VectorXd prediction_error(const Eigen::VectorXd& residuals, int k, double fading_per_step) {
  const Eigen::Index n = residuals.size() - k;
  if (n <= 0) return {};
  return residuals.tail(n) - std::pow(fading_per_step, k) * residuals.head(n);
}

double fading(const Eigen::VectorXd& residuals) {
  const double power = residuals.squaredNorm();
  return power > 0 ? std::clamp(product(residuals, residuals, 1) / power, 0.0, 1.0) : 0;
}

}  // namespace bms::identification
