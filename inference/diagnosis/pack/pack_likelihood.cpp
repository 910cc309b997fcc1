#include "diagnosis/pack/pack_likelihood.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "diagnosis/pack/pack_thresholds.hpp"
#include "measurement/normal_distribution.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis::pack {

namespace {

Vector from_limits(double r0_ohm, double Spread::*which) {
  Vector v;
  for (std::size_t p = 0; p < parameter_count; ++p)
    v[static_cast<Eigen::Index>(p)] = (p == joint ? r0_ohm : 1) * limits.spread[p].*which;
  return v;
}

bool only_positive(Cause cause) {
  return cause == Cause::capacity || cause == Cause::leakage || cause == Cause::resistance || cause == Cause::joint;
}

/// Share of the cells that are taken for healthy. A median would overlook channels that are read in two groups, and
/// heavy tails. In a small pack it is the median: if most cells were faulty, nothing would show what is healthy.
double usual_share(std::size_t cells) {
  constexpr double most = 0.5;
  return 1 - std::min(most, std::max(limits.outlying_share, limits.outlying_cells / static_cast<double>(cells)));
}

/// The square of the quantile of |x|, x standard normal.
double square_of_quantile(double share) {
  const double quantile = measurement::normal_quantile((1 + share) / 2);
  return quantile * quantile;
}

}  // namespace

Vector least_spread(double r0_ohm) { return from_limits(r0_ohm, &Spread::healthy); }
Vector fault_spread(double r0_ohm) { return from_limits(r0_ohm, &Spread::fault); }

double log_marginal(const Eigen::MatrixXd& information, const Eigen::VectorXd& with_data,
                    const Eigen::VectorXd& prior) {
  Eigen::MatrixXd m = prior.asDiagonal() * information * prior.asDiagonal();
  m.diagonal().array() += 1;
  const Eigen::LLT<Eigen::MatrixXd> factor(m);
  const Eigen::VectorXd scaled = prior.asDiagonal() * with_data;
  const double log_determinant = 2 * factor.matrixLLT().diagonal().array().log().sum();
  return (scaled.dot(factor.solve(scaled)) - log_determinant) / 2;
}

void widen_for(Cause cause, const Vector& healthy, double r0_ohm, double unseen_share,
               Eigen::Ref<Eigen::VectorXd> prior) {
  const auto p = static_cast<Eigen::Index>(parameter_of(cause));
  prior[p] = std::hypot(healthy[p], fault_spread(r0_ohm)[p]);
  const bool moved = cause == Cause::imbalance || cause == Cause::capacity || cause == Cause::leakage;
  for (Eigen::Index k = 0; k < width; ++k) {
    const Spread& spread = limits.spread[static_cast<std::size_t>(k)];
    if (cause == Cause::resistance) prior[k] = std::hypot(prior[k], spread.aged);
    if (moved) prior[k] = std::hypot(prior[k], spread.moved);
    if (cause == Cause::late) prior[k] = std::hypot(prior[k], spread.late);
  }
  if (cause == Cause::resistance || cause == Cause::joint)
    prior[blur] = std::hypot(prior[blur], unseen_share * limits.spread[joint].fault);
}

PackLikelihood::PackLikelihood(const std::vector<CellFit>& fits, const Vector& healthy, double r0_ohm, double days,
                               double step_s, double unseen_share)
    : fits_(fits),
      r0_ohm_(r0_ohm),
      unseen_share_(unseen_share),
      healthy_(healthy),
      least_(from_limits(r0_ohm, &Spread::least)) {
  least_[delay] = std::max(least_[delay], limits.channels.least_rows_late * step_s);
  // a leak must have moved the charge by what is worth a visit
  least_[leak] = std::max(least_[leak], least_[charge] / std::max(days, std::numeric_limits<double>::epsilon()));
}

PackLikelihood::System PackLikelihood::system_of(const std::vector<Accusation>& accusations,
                                                 const std::vector<std::size_t>& cells, std::size_t checkpoint) const {
  std::vector<Accusation> wires;
  for (const Accusation& a : accusations) {
    if (a.cause == Cause::sense_wire) wires.push_back(a);
  }
  std::erase_if(wires, [&](const Accusation& w) {
    return std::none_of(cells.begin(), cells.end(), [&](std::size_t c) { return w.touches(c); });
  });
  const auto of_cells = static_cast<Eigen::Index>(cells.size()) * width;
  const auto size = of_cells + static_cast<Eigen::Index>(wires.size());
  System s{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size), Eigen::VectorXd::Zero(size)};
  // columns: those of each cell, then a wire each; `into` maps the parameters of all to those of one cell
  for (std::size_t k = 0; k < cells.size(); ++k) {
    Eigen::MatrixXd into = Eigen::MatrixXd::Zero(width, size);
    const auto at = static_cast<Eigen::Index>(k) * width;
    into.middleCols(at, width).setIdentity();
    for (std::size_t w = 0; w < wires.size(); ++w) {
      if (!wires[w].touches(cells[k])) continue;
      into(offset, of_cells + static_cast<Eigen::Index>(w)) = wires[w].cell == cells[k] ? 1 : -1;
    }
    const Information& data = fits_[cells[k]].until[checkpoint];
    s.information += into.transpose() * data.of_parameters * into;
    s.with_data += into.transpose() * data.with_data;
    s.prior.segment(at, width) = healthy_;
    for (const Accusation& a : accusations) {
      if (a.cause == Cause::sense_wire || a.cell != cells[k]) continue;
      widen_for(a.cause, healthy_, r0_ohm_, unseen_share_, s.prior.segment(at, width));
    }
  }
  s.prior.tail(static_cast<Eigen::Index>(wires.size())).setConstant(limits.spread[offset].fault);
  return s;
}

double PackLikelihood::of(const std::vector<Accusation>& accusations, const std::vector<std::size_t>& cells,
                          std::size_t checkpoint) const {
  const System s = system_of(accusations, cells, checkpoint);
  return log_marginal(s.information, s.with_data, s.prior);
}

std::vector<std::size_t> PackLikelihood::cells_of(const std::vector<Accusation>& accusations,
                                                  const Accusation& around) const {
  std::vector<std::size_t> cells = {around.cell};
  if (around.cause == Cause::sense_wire) cells.push_back(around.cell + 1);
  // sense wires connect cells to chains
  for (bool grown = true; grown;) {
    grown = false;
    for (const Accusation& a : accusations) {
      if (a.cause != Cause::sense_wire) continue;
      const auto has = [&](std::size_t c) { return std::find(cells.begin(), cells.end(), c) != cells.end(); };
      if (has(a.cell) == has(a.cell + 1)) continue;
      cells.push_back(has(a.cell) ? a.cell + 1 : a.cell);
      grown = true;
    }
  }
  std::sort(cells.begin(), cells.end());
  return cells;
}

double PackLikelihood::gain(const std::vector<Accusation>& others, const Accusation& added,
                            std::size_t checkpoint) const {
  std::vector<Accusation> all = others;
  all.push_back(added);
  const std::vector<std::size_t> cells = cells_of(all, added);
  return of(all, cells, checkpoint) - of(others, cells, checkpoint);
}

Estimated PackLikelihood::size(const std::vector<Accusation>& accusations, const Accusation& wanted,
                               std::size_t checkpoint) const {
  const std::vector<std::size_t> cells = cells_of(accusations, wanted);
  const System s = system_of(accusations, cells, checkpoint);
  Eigen::MatrixXd normal = s.information;
  normal.diagonal() += s.prior.array().square().inverse().matrix();
  const Eigen::LDLT<Eigen::MatrixXd> factor(normal);
  Eigen::Index at = static_cast<Eigen::Index>(cells.size()) * width;
  if (wanted.cause == Cause::sense_wire) {
    for (const Accusation& a : accusations) {
      if (a == wanted) break;
      const bool inside = std::any_of(cells.begin(), cells.end(), [&](std::size_t c) { return a.touches(c); });
      if (a.cause == Cause::sense_wire && inside) ++at;
    }
  } else {
    const auto place = std::find(cells.begin(), cells.end(), wanted.cell) - cells.begin();
    at = place * width + static_cast<Eigen::Index>(parameter_of(wanted.cause));
  }
  Eigen::VectorXd unit = Eigen::VectorXd::Zero(normal.rows());
  unit[at] = 1;
  const Eigen::VectorXd column = factor.solve(unit);
  const double value = column.dot(s.with_data);
  // what the fault adds: how much of the difference the cell had before is not known
  const Parameter p = parameter_of(wanted.cause);
  const double own = wanted.cause == Cause::sense_wire ? 0 : healthy_[static_cast<Eigen::Index>(p)];
  return {value, std::hypot(std::sqrt(std::max(0.0, column[at])), own, limits.spread[p].scale * value)};
}

std::vector<Accusation> PackLikelihood::candidates_at(std::size_t cell) const {
  std::vector<Accusation> list;
  for (const Cause cause : cell_causes) {
    if (cause != Cause::sense_wire || cell + 1 < cells()) list.push_back({cause, cell});
  }
  return list;
}

std::vector<Accusation> PackLikelihood::rivals_of(const Accusation& a) const {
  std::vector<Accusation> list = candidates_at(a.cell);
  if (a.cell > 0) list.push_back({Cause::sense_wire, a.cell - 1});
  if (a.cause == Cause::sense_wire) {
    for (const Accusation& next : candidates_at(a.cell + 1)) list.push_back(next);
  }
  std::erase(list, a);
  return list;
}

double PackLikelihood::least_gain() const {
  return std::log(static_cast<double>(cells() * cell_causes.size()) / limits.fault_prior) + limits.least_odds;
}

bool PackLikelihood::is_possible(const Accusation& a, const Estimated& size) const {
  const auto p = static_cast<Eigen::Index>(parameter_of(a.cause));
  if (only_positive(a.cause) && size.value < 0) return false;
  // less than the least delay is how the channels are sampled: no lateness at all, so it must lie beyond for certain
  const double sampling = a.cause == Cause::late ? least_[p] : 0;
  return std::abs(size.value) > least_[p] && std::abs(size.value) - sampling > limits.least_sigmas * size.sigma;
}

Vector healthy_spread(const std::vector<CellFit>& fits, double r0_ohm) {
  const Vector least = least_spread(r0_ohm);
  Vector spread = least;
  for (int round = 0; round < limits.fit.scale_rounds; ++round) {
    std::vector<std::vector<double>> values(parameter_count), variances(parameter_count);
    for (const CellFit& fit : fits) {
      Matrix normal = fit.all().of_parameters;
      normal.diagonal() += spread.array().square().inverse().matrix();
      const Matrix covariance = normal.inverse();
      const Vector theta = covariance * fit.all().with_data;
      for (Eigen::Index p = 0; p < width; ++p) {
        values[static_cast<std::size_t>(p)].push_back(theta[p]);
        variances[static_cast<std::size_t>(p)].push_back(covariance(p, p));
      }
    }
    for (Eigen::Index p = 0; p < width; ++p) {
      const auto k = static_cast<std::size_t>(p);
      // a fault among the neighbours shifts all cells alike
      const double common = measurement::median(values[k]);
      for (double& v : values[k]) v = (v - common) * (v - common);
      const double of_estimates =
          measurement::quantile(values[k], usual_share(fits.size())) / square_of_quantile(usual_share(fits.size()));
      spread[p] = std::clamp(std::sqrt(of_estimates + measurement::median(variances[k])), least[p],
                             limits.spread[k].most * least[p]);
    }
  }
  return spread;
}

}  // namespace bms::diagnosis::pack
