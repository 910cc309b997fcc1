#include "study/paper_fit.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include <Eigen/Dense>

namespace bms::study {

namespace {

constexpr double difference_step = 0.05;  // of a logarithm
constexpr double screened_range = 0.7;    // of a logarithm, on either side of the start
/// Differences that count as one standard deviation, by group: as large as those between two such experiments.
constexpr std::array<double, 5> expected_difference = {0.3, 0.6, 0.5, 0.3, 0.5};

std::array<double, 5> counts(const std::vector<Figure>& figures) {
  std::array<double, 5> n{};
  for (const Figure& f : figures) n[static_cast<std::size_t>(f.group)] += 1;
  return n;
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
  const std::array<double, 5> n = counts(published_);
  const std::vector<double> d = differences(simulated, published_);
  Eigen::VectorXd r(static_cast<Eigen::Index>(d.size()));
  for (std::size_t k = 0; k < d.size(); ++k) {
    const auto group = static_cast<std::size_t>(published_[k].group);
    const double weight = std::sqrt(independent_figures[group] / n[group]) / expected_difference[group];
    r[static_cast<Eigen::Index>(k)] = used[k] ? weight * d[k] : 0;
  }
  return r;
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
    r = weighted(simulate(x, *runs), used);
    if (jacobian == nullptr) return r.allFinite();
    jacobian->resize(r.size(), x.size());
    for (Eigen::Index k = 0; k < x.size(); ++k) {
      const double top = std::log(unknowns_[static_cast<std::size_t>(k)].high);
      const double step = x[k] + difference_step > top ? -difference_step : difference_step;
      Eigen::VectorXd moved = x;
      moved[k] += step;
      jacobian->col(k) = (weighted(simulate(moved, *runs), used) - r) / step;
    }
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

Eigen::VectorXd PaperFit::deviation(const Eigen::VectorXd& x) const {
  const std::vector<bool> all(published_.size(), true);
  Eigen::VectorXd r;
  Eigen::MatrixXd jacobian;
  problem(all).evaluate(x, r, &jacobian);
  double figures = 0;
  for (const double n : independent_figures) figures += n;
  const double variance = r.squaredNorm() / std::max(1.0, figures - static_cast<double>(x.size()));
  const Eigen::MatrixXd information = jacobian.transpose() * jacobian;
  const Eigen::MatrixXd covariance = variance * information.completeOrthogonalDecomposition().pseudoInverse();
  return covariance.diagonal().cwiseMax(0).cwiseSqrt();
}

double PaperFit::score(const std::vector<Figure>& simulated) const {
  const std::array<double, 5> n = counts(published_);
  const std::vector<double> d = differences(simulated, published_);
  std::array<double, 5> squares{};
  for (std::size_t k = 0; k < d.size(); ++k) squares[static_cast<std::size_t>(published_[k].group)] += d[k] * d[k];
  double score = 0, figures = 0;
  for (std::size_t g = 0; g < n.size(); ++g) {
    constexpr double least = 0.02;  // figures are printed with two to four digits
    score += independent_figures[g] * std::log(std::max(least, std::sqrt(squares[g] / n[g])));
    figures += independent_figures[g];
  }
  return score + 0.5 * static_cast<double>(unknowns_.size() + (effects_.other_ocv ? 1U : 0U)) * std::log(figures);
}

}  // namespace bms::study
