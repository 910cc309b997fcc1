#include "study/paper_fit.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include <Eigen/Dense>

namespace bms::study {

namespace {

constexpr double difference_step = 0.05;  // of a logarithm
constexpr double screened_range = 0.7;    // of a logarithm, on either side of the start

/// The prior of a variance has the information of one figure, as the prior behind the penalty of Schwarz has.
constexpr double prior_freedom = 1;

std::size_t group_of(const Figure& f) { return static_cast<std::size_t>(f.group); }

/// The figures of a table that a fit uses.
struct UsedTable {
  double figures = 0;      ///< number of them
  double independent = 0;  ///< what they count as
  double mean_square = 0;  ///< of their differences
  double prior_v2 = 0;     ///< nu s^2

  double cost() const { return 0.5 * (prior_freedom + independent) * std::log1p(independent * mean_square / prior_v2); }
  /// Of a difference in a fit.
  double weight() const { return std::sqrt(prior_freedom / prior_v2 * independent / figures); }
  /// Of a difference, in standard deviations at the most likely variance.
  double per_sigma() const {
    return std::sqrt((prior_freedom + independent) / (prior_v2 + independent * mean_square) * independent / figures);
  }
};

using UsedTables = std::array<UsedTable, 5>;

UsedTables used_tables(const std::vector<double>& d, const std::vector<Figure>& figures,
                       const std::vector<bool>& used) {
  UsedTables tables;
  std::array<double, tables.size()> all{};
  for (std::size_t k = 0; k < d.size(); ++k) {
    all[group_of(figures[k])] += 1;
    if (!used[k]) continue;
    UsedTable& table = tables[group_of(figures[k])];
    table.figures += 1;
    table.mean_square += d[k] * d[k];
  }
  for (std::size_t g = 0; g < tables.size(); ++g) {
    UsedTable& table = tables[g];
    table.independent = independent_figures[g] * table.figures / all[g];
    table.mean_square /= std::max(1.0, table.figures);
    table.prior_v2 = prior_freedom * expected_difference[g] * expected_difference[g];
  }
  return tables;
}

/// Element `index` of the sequence of van der Corput in a base: evenly spread over 0..1.
double spread(int index, int base) {
  double value = 0, part = 1;
  for (; index > 0; index /= base) {
    part /= base;
    value += part * (index % base);
  }
  return value;
}

}  // namespace

PaperFit::PaperFit(const model::CellParameters<>& cell, const Effects& effects, std::vector<Figure> published)
    : cell_(cell), effects_(effects), published_(std::move(published)) {
  using C = PaperCandidate;
  unknowns_ = {{"pulse_c_rate", "C", 0.7, 0.1, 1, [](C& c, double v) { c.pulses.pulse_c_rate = v; }},
               {"pulse_s", "s", 20, 5, 60, [](C& c, double v) { c.pulses.pulse_s = v; }},
               {"high_c_rate", "C", 0.6, 0.1, 1, [](C& c, double v) { c.pulses.high_c_rate = v; }},
               {"swing", "of HIGH", 1.2, 0.2, 2, [](C& c, double v) { c.pulses.swing = v; }},
               {"duration_s", "s", 900, 300, 3'600, [](C& c, double v) { c.pulses.duration_s = v; }},
               {"ocv_test_c_rate", "C", 0.8, 0.1, 1, [](C& c, double v) { c.bench.ocv_c_rate = v; }},
               {"ocv_half_window", "of SOC", 0.35, 0.05, 0.4, [](C& c, double v) { c.ocv_half_window = v; }},
               {"voltage_noise_v", "V", 0.001, 1e-4, 0.01, [](C& c, double v) { c.bench.voltage_noise_v = v; }}};
  if (effects.hysteresis)
    unknowns_.push_back({"half_gap_v", "V", 0.01, 5e-4, 0.04, [](C& c, double v) { c.bench.left_out.half_gap_v = v; }});
  if (effects.slow_polarisation) {
    unknowns_.push_back(
        {"slow_resistance_ohm", "ohm", 0.008, 5e-4, 0.06, [](C& c, double v) { c.bench.left_out.slow_ohm = v; }});
    unknowns_.push_back(
        {"slow_time_constant_s", "s", 600, 60, 20'000, [](C& c, double v) { c.bench.left_out.slow_s = v; }});
  }
}

Eigen::VectorXd PaperFit::start() const {
  Eigen::VectorXd x(static_cast<Eigen::Index>(unknowns_.size()));
  for (Eigen::Index k = 0; k < x.size(); ++k) x[k] = std::log(unknowns_[static_cast<std::size_t>(k)].start);
  return x;
}

std::vector<Figure> PaperFit::simulate(const Eigen::VectorXd& x) const {
  PaperRuns runs;
  return simulate(x, runs);
}

std::vector<Figure> PaperFit::simulate(const Eigen::VectorXd& x, PaperRuns& runs) const {
  constexpr double ocv_step_s = 5;
  PaperCandidate candidate;
  candidate.other_ocv = effects_.other_ocv;
  candidate.whole_ocv = effects_.whole_ocv;
  candidate.bench.start_branch = -1;  // 40 % is reached by discharge
  candidate.bench.ocv_step_s = ocv_step_s;
  for (std::size_t k = 0; k < unknowns_.size(); ++k) {
    unknowns_[k].set(candidate, std::exp(x[static_cast<Eigen::Index>(k)]));
  }
  return figures_of(cell_, candidate, runs);
}

Eigen::VectorXd PaperFit::weighted(const std::vector<Figure>& simulated, const std::vector<bool>& used) const {
  const std::vector<double> d = differences(simulated, published_);
  const UsedTables tables = used_tables(d, published_, used);
  Eigen::VectorXd r = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(d.size()));
  for (std::size_t k = 0; k < d.size(); ++k) {
    if (used[k]) r[static_cast<Eigen::Index>(k)] = tables[group_of(published_[k])].weight() * d[k];
  }
  return r;
}

Eigen::MatrixXd PaperFit::derivatives(const Eigen::VectorXd& x, PaperRuns& runs,
                                      const std::function<Eigen::VectorXd(const std::vector<Figure>&)>& of) const {
  const Eigen::VectorXd here = of(simulate(x, runs));
  Eigen::MatrixXd jacobian(here.size(), x.size());
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const double top = std::log(unknowns_[static_cast<std::size_t>(k)].high);
    const double step = x[k] + difference_step > top ? -difference_step : difference_step;
    Eigen::VectorXd moved = x;
    moved[k] += step;
    jacobian.col(k) = (of(simulate(moved, runs)) - here) / step;
  }
  return jacobian;
}

id::LeastSquares PaperFit::problem(const std::vector<bool>& used) const {
  id::LeastSquares p;
  const auto n = static_cast<Eigen::Index>(unknowns_.size());
  p.lower.resize(n);
  p.upper.resize(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    p.lower[k] = std::log(unknowns_[static_cast<std::size_t>(k)].low);
    p.upper[k] = std::log(unknowns_[static_cast<std::size_t>(k)].high);
  }
  // the columns of the Jacobian share what their unknown does not change, and begin with the last point tried
  p.evaluate = [this, used, runs = std::make_shared<PaperRuns>()](const Eigen::VectorXd& x, Eigen::VectorXd& r,
                                                                  Eigen::MatrixXd* jacobian) {
    const auto residuals = [&](const std::vector<Figure>& simulated) { return weighted(simulated, used); };
    r = residuals(simulate(x, *runs));
    if (jacobian == nullptr) return r.allFinite();
    *jacobian = derivatives(x, *runs, residuals);
    *runs = {};
    return r.allFinite() && jacobian->allFinite();
  };
  return p;
}

Eigen::VectorXd PaperFit::screened(int points, const std::vector<bool>& used) const {
  constexpr std::array primes = {2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31};
  Eigen::VectorXd best = start();
  double least = INFINITY;  // the start is searched anyway
  for (int point = 1; point <= points; ++point) {
    Eigen::VectorXd x = best;
    for (Eigen::Index k = 0; k < x.size(); ++k) {
      const PaperUnknown& u = unknowns_[static_cast<std::size_t>(k)];
      const double part = 2 * spread(point, primes[static_cast<std::size_t>(k)]) - 1;
      x[k] = std::clamp(std::log(u.start) + part * screened_range, std::log(u.low), std::log(u.high));
    }
    const double squares = weighted(simulate(x), used).squaredNorm();
    if (squares >= least) continue;
    least = squares;
    best = x;
  }
  return best;
}

Eigen::VectorXd PaperFit::fit(const Eigen::VectorXd& from, const std::vector<bool>& used, int iterations) const {
  id::Stopping stopping;
  stopping.iterations = iterations;
  stopping.cost = 1e-3;
  stopping.step = 1e-2;
  return minimise(problem(used), from, id::Method::levenberg_marquardt, stopping).x;
}

Eigen::VectorXd PaperFit::searched(const std::vector<bool>& used, int points, int iterations) const {
  const auto squares = [&](const Eigen::VectorXd& x) { return weighted(simulate(x), used).squaredNorm(); };
  const Eigen::VectorXd one = fit(start(), used, iterations);
  if (points == 0) return one;
  const Eigen::VectorXd other = fit(screened(points, used), used, iterations);
  return squares(other) < squares(one) ? other : one;
}

Eigen::VectorXd PaperFit::deviation(const Eigen::VectorXd& x, const std::vector<bool>& used) const {
  PaperRuns runs;
  const UsedTables tables = used_tables(differences(simulate(x, runs), published_), published_, used);
  const Eigen::MatrixXd in_sigmas = derivatives(x, runs, [&](const std::vector<Figure>& simulated) {
    const std::vector<double> d = differences(simulated, published_);
    Eigen::VectorXd r = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(d.size()));
    for (std::size_t k = 0; k < d.size(); ++k) {
      if (used[k]) r[static_cast<Eigen::Index>(k)] = tables[group_of(published_[k])].per_sigma() * d[k];
    }
    return r;
  });
  // what the figures do not determine has the range of the search
  Eigen::MatrixXd information = in_sigmas.transpose() * in_sigmas;
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const PaperUnknown& u = unknowns_[static_cast<std::size_t>(k)];
    information(k, k) += 12 / std::pow(std::log(u.high / u.low), 2);
  }
  return information.inverse().diagonal().cwiseSqrt();
}

double PaperFit::score(const std::vector<Figure>& simulated) const {
  const std::vector<bool> all(published_.size(), true);
  const UsedTables tables = used_tables(differences(simulated, published_), published_, all);
  double cost = 0, figures = 0;
  for (const UsedTable& table : tables) {
    cost += table.cost();
    figures += table.independent;
  }
  return cost + 0.5 * static_cast<double>(unknowns_.size() + (effects_.other_ocv ? 1U : 0U)) * std::log(figures);
}

}  // namespace bms::study
