#include "benchmark/truth/detection_scale.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>

namespace bms::benchmark::truth {

namespace {

/// Innovations of the Kalman filter of both drifts, each divided by its standard deviation.
class Whitener {
 public:
  Whitener(double white_v, double step_s, std::size_t count) {
    for (std::size_t n = 0; n < 2; ++n) kept_[n] = std::exp(-step_s / correlation_s[n]);
    const double white = white_v * white_v;
    double p00 = sigma_v[0] * sigma_v[0], p11 = sigma_v[1] * sigma_v[1], p01 = 0;
    gains_.reserve(count);
    for (std::size_t k = 0; k < count; ++k) {
      const double s = p00 + 2 * p01 + p11 + white;
      const double g0 = (p00 + p01) / s, g1 = (p01 + p11) / s;
      gains_.push_back({kept_[0] * g0, kept_[1] * g1, 1 / std::sqrt(s)});
      const double a00 = p00 - g0 * (p00 + p01), a01 = p01 - g0 * (p01 + p11), a11 = p11 - g1 * (p01 + p11);
      p00 = kept_[0] * kept_[0] * a00 + (1 - kept_[0] * kept_[0]) * sigma_v[0] * sigma_v[0];
      p11 = kept_[1] * kept_[1] * a11 + (1 - kept_[1] * kept_[1]) * sigma_v[1] * sigma_v[1];
      p01 = kept_[0] * kept_[1] * a01;
    }
  }

  Eigen::VectorXd white(const std::vector<double>& values) const {
    Eigen::VectorXd out(static_cast<Eigen::Index>(values.size()));
    double x0 = 0, x1 = 0;
    for (std::size_t k = 0; k < values.size(); ++k) {
      const double innovation = values[k] - x0 - x1;
      out[static_cast<Eigen::Index>(k)] = innovation * gains_[k].scale;
      x0 = kept_[0] * x0 + gains_[k].to_fast * innovation;
      x1 = kept_[1] * x1 + gains_[k].to_slow * innovation;
    }
    return out;
  }

 private:
  static constexpr double sigma_v[2] = {0.0015, 0.001}, correlation_s[2] = {60, 3'600};
  struct Gain {
    double to_fast, to_slow, scale;
  };
  double kept_[2]{};
  std::vector<Gain> gains_;
};

double hat(double soc, double centre, double spacing) { return std::max(0.0, 1 - std::abs(soc - centre) / spacing); }

}  // namespace

struct DetectionScale::Columns {
  Whitener whitener;
  Eigen::MatrixXd nuisance;  ///< whitened columns, each scaled by its sigma
  std::optional<Eigen::LDLT<Eigen::MatrixXd>> gram;
};

DetectionScale::~DetectionScale() = default;

DetectionScale::DetectionScale(const HealthyCell& cell, const Stimulus& stimulus, const CellTrace& healthy,
                               double white_v) {
  const std::size_t count = stimulus.current_a.size();
  columns_ = std::make_unique<Columns>(Columns{Whitener(white_v, stimulus.step_s, count), {}, {}});

  std::vector<std::vector<double>> columns;
  const auto add = [&](double sigma, const auto& value) {
    std::vector<double> column(count);
    bool any = false;
    for (std::size_t k = 0; k < count; ++k) any = (column[k] = sigma * value(k)) != 0 || any;
    if (any) columns.push_back(std::move(column));
  };
  for (int n = 0; n <= 20; ++n) add(0.0015, [&](std::size_t k) { return hat(healthy.soc[k], 0.05 * n, 0.05); });
  for (int n = 0; n <= 5; ++n)
    add(0.02, [&](std::size_t k) {
      return hat(healthy.soc[k], 0.2 * n, 0.2) * cell.r0_ohm.at(healthy.soc[k]) * stimulus.current_a[k];
    });
  add(0.05, [&](std::size_t k) { return healthy.v1_v[k]; });
  // a change of SOC also changes the overvoltages, so the cell is simulated again
  const auto add_change = [&](const CellEffects& effects, const Stimulus& other_stimulus, double start_soc) {
    const CellTrace other = run_cell(cell, effects, other_stimulus, start_soc);
    add(1, [&](std::size_t k) { return other.voltage_v[k] - healthy.voltage_v[k]; });
  };
  const double start_soc = healthy.soc.front();
  add_change({}, stimulus, start_soc - std::copysign(0.005, start_soc - 0.5));
  CellEffects larger;
  larger.capacity_factor = 1.002;
  add_change(larger, stimulus, start_soc);
  Stimulus offset = stimulus;
  for (double& i : offset.current_a) i += 0.0003 * cell.capacity_ah;
  add_change({}, offset, start_soc);

  Eigen::MatrixXd& nuisance = columns_->nuisance;
  nuisance.resize(static_cast<Eigen::Index>(count), static_cast<Eigen::Index>(columns.size()));
  for (std::size_t n = 0; n < columns.size(); ++n)
    nuisance.col(static_cast<Eigen::Index>(n)) = columns_->whitener.white(columns[n]);
  Eigen::MatrixXd gram = nuisance.transpose() * nuisance;
  gram.diagonal().array() += 1;
  columns_->gram.emplace(gram);
}

double DetectionScale::overlap_root(const std::vector<double>& a_v, const std::vector<double>& b_v) const {
  const Eigen::VectorXd a = columns_->whitener.white(a_v), b = columns_->whitener.white(b_v);
  const Eigen::VectorXd to_a = columns_->nuisance.transpose() * a, to_b = columns_->nuisance.transpose() * b;
  const double lambda = a.dot(b) - to_a.dot(columns_->gram->solve(to_b));
  constexpr double detection_limit_sigmas = 4.76;  // see the header
  return std::copysign(std::sqrt(std::abs(lambda)), lambda) / detection_limit_sigmas;
}

double DetectionScale::cosine_similarity(const std::vector<double>& a_v, const std::vector<double>& b_v) const {
  const double ab = overlap_root(a_v, b_v), a = overlap_root(a_v, a_v), b = overlap_root(b_v, b_v);
  return a > 0 && b > 0 ? std::copysign(ab * ab, ab) / (a * b) : 0;
}

}  // namespace bms::benchmark::truth
