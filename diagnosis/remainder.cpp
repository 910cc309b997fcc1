#include "diagnosis/remainder.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "diagnosis/locate.hpp"

namespace bms::diagnosis {

namespace {

/// Weight of x at the knots of an even grid over low..high.
void hat(Eigen::Ref<Columns> row, Eigen::Index first, Eigen::Index knots, double low, double high, double x, double value) {
  const double at = std::clamp((x - low) / std::max(high - low, 1e-12) * static_cast<double>(knots - 1), 0.0, static_cast<double>(knots - 1) - 1e-9);
  const auto k = static_cast<Eigen::Index>(at);
  row(0, first + k) += value * (1 - (at - static_cast<double>(k)));
  row(0, first + k + 1) += value * (at - static_cast<double>(k));
}

constexpr double free_v = 0.02;  // prior deviation of a generic voltage

}  // namespace

Remainder what_remains(const Evidence& evidence, const Fit& fit) {
  const auto rows = static_cast<Eigen::Index>(evidence.samples());
  const double c_rate_a = evidence.cell().capacity_ah;
  constexpr Eigen::Index time_knots = 30, soc_knots = 8, fine_knots = 24, volt_knots = 30, current_knots = 7, memory = 6, soc_current = 4, time_current = 6;
  constexpr Eigen::Index per_record = time_knots + time_current;
  const Eigen::Index shared = 2 * soc_knots + fine_knots + volt_knots + current_knots + memory + soc_current + 1;
  const Eigen::Index generic = shared + per_record * static_cast<Eigen::Index>(evidence.records().size());
  Columns raw = Columns::Zero(rows, generic);
  double largest_a = 1e-9;
  for (const Record& r : evidence.records()) {
    for (const double a : r.current_a) {
      if (std::isfinite(a)) largest_a = std::max(largest_a, std::abs(a));
    }
  }
  Eigen::Index row = 0;
  for (std::size_t n = 0; n < evidence.records().size(); ++n) {
    const Record& r = evidence.records()[n];
    std::vector<double> soc;
    const std::vector<double> volts = evidence.voltage(fit.hypothesis, fit.calibration, n, &soc);
    const auto [lowest, highest] = std::minmax_element(soc.begin(), soc.end());
    const auto [lowest_v, highest_v] = std::minmax_element(volts.begin(), volts.end());
    std::array<double, memory> slow{};
    constexpr std::array<double, memory> tau_s = {4, 15, 60, 250, 1'000, 4'000};
    double known_a = 0, heading = 0, heat = 0;
    for (std::size_t k = 0; k < r.size(); ++k, ++row) {
      const double dt_s = k > 0 ? r.time_s[k] - r.time_s[k - 1] : 0;
      if (std::isfinite(r.current_a[k])) known_a = r.current_a[k];
      const double c = known_a / largest_a, moved = known_a * dt_s / (3'600 * c_rate_a);
      heading += (1 - std::exp(-std::abs(moved) / 0.02)) * ((moved > 0 ? 1 : -1) - heading);
      heat += (1 - std::exp(-dt_s / 1'500)) * (c * c - heat);
      auto here = raw.middleRows(row, 1);
      Eigen::Index at = 0;
      hat(here, at, soc_knots, *lowest, *highest, soc[k], free_v);
      hat(here, at + soc_knots, soc_knots, *lowest, *highest, soc[k], free_v * heading);
      at += 2 * soc_knots;
      hat(here, at, fine_knots, *lowest, *highest, soc[k], free_v / 4);
      at += fine_knots;
      hat(here, at, volt_knots, *lowest_v, *highest_v, volts[k], free_v / 4);
      at += volt_knots;
      hat(here, at, current_knots, -1, 1, c, free_v);
      at += current_knots;
      for (std::size_t t = 0; t < memory; ++t) {
        slow[t] += (1 - std::exp(-dt_s / tau_s[t])) * (c - slow[t]);
        here(0, at++) = free_v * slow[t];
      }
      hat(here, at, soc_current, *lowest, *highest, soc[k], free_v * c);
      at += soc_current;
      here(0, at++) = free_v * heat;
      at += static_cast<Eigen::Index>(n) * per_record;
      hat(here, at, time_knots, r.time_s.front(), r.time_s.back(), r.time_s[k], free_v);
      hat(here, at + time_knots, time_current, r.time_s.front(), r.time_s.back(), r.time_s[k], free_v * c);
    }
  }
  Columns white = raw;
  evidence.whiten(white);

  const std::vector<Sought> sought = fit.hypothesis.sought();
  const Columns base = evidence.calibration_derivatives(fit.hypothesis, fit.calibration), own = evidence.derivatives(fit.hypothesis, fit.calibration, sought);
  Columns known(rows, base.cols() + own.cols());
  known.leftCols(base.cols()) = base;
  if (own.cols() > 0) known.rightCols(own.cols()) = own;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(known.cols(), known.cols());
  normal.selfadjointView<Eigen::Lower>().rankUpdate(known.transpose());
  normal = Eigen::MatrixXd(normal.selfadjointView<Eigen::Lower>());
  for (Eigen::Index k = 0; k < normal.rows(); ++k) normal(k, k) += k < base.cols() ? 1 : 1e-9 * (1 + normal(k, k));
  const Eigen::LDLT<Eigen::MatrixXd> factor(normal);
  const Eigen::MatrixXd cross = known.transpose() * white;
  Eigen::VectorXd pull = known.transpose() * fit.residual;
  pull.head(base.cols()) -= fit.calibration;
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(generic, generic);
  gram.selfadjointView<Eigen::Lower>().rankUpdate(white.transpose());
  gram = Eigen::MatrixXd(gram.selfadjointView<Eigen::Lower>()) - cross.transpose() * factor.solve(cross);
  const Eigen::VectorXd toward = white.transpose() * fit.residual - cross.transpose() * factor.solve(pull);
  Eigen::MatrixXd regular = gram;
  regular.diagonal().array() += 1;
  const Eigen::LDLT<Eigen::MatrixXd> solver(regular);
  const Eigen::VectorXd x = solver.solve(toward);

  Remainder found;
  // what the columns gain on noise alone: the trace of what they can follow
  const double freedom = (solver.solve(gram)).trace();
  found.gain = std::max(0.0, toward.dot(x) - 1.6 * freedom);
  std::vector<double> squares;
  for (Eigen::Index k = 0; k < rows; ++k) {
    if (fit.residual[k] != 0) squares.push_back(fit.residual[k] * fit.residual[k]);
  }
  if (squares.size() > 100) {
    // winsorised at 4 deviations: a few bad samples are no excess
    double sum = 0;
    for (const double s : squares) sum += std::min(s, 16.0);
    found.fast_excess = sum / static_cast<double>(squares.size()) - 1;
  }
  const Eigen::VectorXd seen_v = raw * x;
  row = 0;
  for (const Record& r : evidence.records()) {
    std::vector<double>& e = found.energy.emplace_back(r.size());
    for (std::size_t k = 0; k < r.size(); ++k, ++row) e[k] = seen_v[row] * seen_v[row];
  }
  found.spans = strongest_spans(evidence.records().front(), found.energy.front());
  return found;
}

}  // namespace bms::diagnosis
