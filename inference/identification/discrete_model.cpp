#include "identification/discrete_model.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <memory>
#include <optional>
#include <stdexcept>

#include <Eigen/Eigenvalues>

#include "identification/prefilter.hpp"
#include "numerics/matrix_factors.hpp"

namespace bms::identification {

namespace {

using Eigen::Index;
using Eigen::VectorXd;

Index at(std::size_t k) { return static_cast<Index>(k); }

/// v = 1/F u from rest.
template <class Values>
VectorXd through_f(const std::vector<double>& f, const Values& u) {
  VectorXd v(at(static_cast<std::size_t>(u.size())));
  for (Index k = 0; k < v.size(); ++k) {
    double sum = u[static_cast<decltype(u.size())>(k)];
    for (Index j = 0; j < std::min(k, at(f.size())); ++j) sum -= f[static_cast<std::size_t>(j)] * v[k - 1 - j];
    v[k] = sum;
  }
  return v;
}

/// v, delayed by `by` samples, with zeros before.
VectorXd later(const VectorXd& v, Index by) {
  VectorXd out = VectorXd::Zero(v.size());
  if (by < v.size()) out.tail(v.size() - by) = v.head(v.size() - by);
  return out;
}

/// F w = 0 from sample nf on, w = initial before.
VectorXd free_response(const std::vector<double>& f, const std::vector<double>& initial, Index n) {
  VectorXd w(n);
  const Index nf = at(f.size());
  for (Index k = 0; k < n; ++k) {
    w[k] = k < nf ? initial[static_cast<std::size_t>(k)] : 0;
    if (k < nf) continue;
    for (Index j = 0; j < nf; ++j) w[k] -= f[static_cast<std::size_t>(j)] * w[k - 1 - j];
  }
  return w;
}

std::vector<double> unit(std::size_t n, std::size_t one) {
  std::vector<double> e(n, 0);
  e[one] = 1;
  return e;
}

std::vector<std::complex<double>> roots(const std::vector<double>& f) {
  const Index n = at(f.size());
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(n, n);
  for (Index j = 0; j < n; ++j) companion(0, j) = -f[static_cast<std::size_t>(j)];
  for (Index j = 1; j < n; ++j) companion(j, j - 1) = 1;
  if (!companion.allFinite()) return {{INFINITY, 0}};
  const Eigen::VectorXcd values = companion.eigenvalues();
  return {values.begin(), values.end()};
}

std::vector<double> from_roots(const std::vector<std::complex<double>>& all) {
  std::vector<std::complex<double>> polynomial{1};
  for (const auto& root : all) {
    polynomial.push_back(0);
    for (std::size_t k = polynomial.size() - 1; k > 0; --k) polynomial[k] -= root * polynomial[k - 1];
  }
  std::vector<double> f;
  for (std::size_t k = 1; k < polynomial.size(); ++k) f.push_back(polynomial[k].real());
  return f;
}

/// First sample in which a free response can be exact.
std::size_t first_within_reach(const Structure& s) {
  return s.estimate_initial && s.nk + s.nb > s.nf + 1 ? s.nk + s.nb - 1 - s.nf : 0;
}

/// Rows with a measured voltage within reach of the free response.
std::vector<Index> measured(const Data& data, const Structure& s) {
  std::vector<Index> rows;
  for (std::size_t k = first_within_reach(s); k < data.size(); ++k) {
    if (std::isfinite(data.voltage_v[k])) rows.push_back(at(k));
  }
  return rows;
}

void require(const Data& data, const Structure& structure) {
  if (structure.nf == 0 || structure.nb == 0)
    throw std::invalid_argument("a discrete model needs at least one coefficient in numerator and denominator");
  if (data.current_a.size() != data.size() || data.voltage_v.size() != data.size())
    throw std::invalid_argument("time, current and voltage differ in length");
  even_step_s(data.time_s);
  if (!std::all_of(data.current_a.begin(), data.current_a.end(), [](double i) { return std::isfinite(i); }))
    throw std::invalid_argument("a current is not a finite number");
  if (measured(data, structure).size() <= structure.unknowns() + structure.nk)
    throw std::invalid_argument("fewer measured voltages than unknowns of the discrete model");
}

/// Least squares with columns scaled to one size.
VectorXd solve(Eigen::MatrixXd a, const VectorXd& y) {
  VectorXd size = a.colwise().norm();
  for (double& s : size) s = s > 0 && std::isfinite(s) ? s : 1;
  a *= size.cwiseInverse().asDiagonal();
  return size.cwiseInverse().cwiseProduct(numerics::solve_least_squares(a, y));
}

/// The output error is linear in all but F: those numbers by linear least squares, and the cost that remains.
struct Candidate {
  DiscreteModel model;
  double cost = INFINITY;
};

Candidate with_best_rest(const std::vector<double>& f, const Data& data, const Structure& s,
                         const std::vector<Index>& rows) {
  Candidate c;
  const Index n = at(data.size());
  const VectorXd charged = through_f(f, data.current_a);
  std::vector<VectorXd> columns;  // b, offset, initial
  for (std::size_t k = 0; k < s.nb; ++k) columns.push_back(later(charged, at(s.nk + k)));
  if (s.estimate_offset) columns.push_back(VectorXd::Ones(n));
  for (std::size_t k = s.nf - s.unknown_initial(); k < s.nf; ++k) columns.push_back(free_response(f, unit(s.nf, k), n));
  Eigen::MatrixXd a(at(rows.size()), at(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) a.col(at(k)) = columns[k](rows);
  if (!a.allFinite()) return c;

  VectorXd y(at(rows.size()));
  const double fixed_v = s.estimate_offset ? 0 : s.offset_v;
  for (Index k = 0; k < y.size(); ++k)
    y[k] = data.voltage_v[static_cast<std::size_t>(rows[static_cast<std::size_t>(k)])] - fixed_v;
  const VectorXd x = solve(a, y);
  if (!x.allFinite()) return c;
  c.cost = (a * x - y).squaredNorm() / 2;
  VectorXd unknowns(at(s.unknowns()));
  const Index nb = at(s.nb), nf = at(s.nf);
  unknowns << x.head(nb), Eigen::Map<const VectorXd>(f.data(), nf), x.tail(x.size() - nb);
  c.model = to_model(unknowns, s);
  return c;
}

/// About `count` of the rows at most: one of each stretch, at changing places, because evenly spaced rows might meet
/// the same phase of every pulse.
std::vector<Index> some_of(const std::vector<Index>& rows, std::size_t count) {
  const std::size_t stretch = rows.size() / count + 1;
  if (stretch == 1) return rows;
  std::vector<Index> some;
  for (std::size_t k = 0; k + stretch <= rows.size(); k += stretch)
    some.push_back(rows[k + k / stretch * 7'919 % stretch]);
  return some;
}

/// F of the equation error F y = B u + F(1) offset + start, both signals filtered by 1/filter before.
std::optional<std::vector<double>> equation_error(const Data& data, const Structure& s,
                                                  const std::vector<double>& filter) {
  // a missing voltage is replaced by the last one, which is sufficient for start values
  std::vector<double> y = data.voltage_v.copy();
  const auto first = std::find_if(y.begin(), y.end(), [](double v) { return std::isfinite(v); });
  double last = *first;
  const double level = s.estimate_offset ? *first : s.offset_v;
  for (double& v : y) {
    last = std::isfinite(v) ? v : last;
    v = last - level;
  }

  const VectorXd filtered_y = through_f(filter, y), filtered_u = through_f(filter, data.current_a);
  std::vector<VectorXd> columns;
  for (std::size_t j = 1; j <= s.nf; ++j) columns.push_back(-later(filtered_y, at(j)));
  for (std::size_t k = 0; k < s.nb; ++k) columns.push_back(later(filtered_u, at(s.nk + k)));
  if (s.estimate_offset) columns.push_back(through_f(filter, std::vector<double>(data.size(), 1)));
  if (s.estimate_initial) {
    for (std::size_t k = 0; k < s.nf; ++k) columns.push_back(through_f(filter, unit(data.size(), k)));
  }
  Eigen::MatrixXd a(at(data.size()), at(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) a.col(at(k)) = columns[k];
  if (!a.allFinite() || !filtered_y.allFinite()) return std::nullopt;
  const VectorXd x = solve(a, filtered_y);
  if (!x.allFinite()) return std::nullopt;
  return std::vector<double>(x.data(), x.data() + s.nf);
}

}  // namespace

Structure transfer_function(double b0_v) {
  return {.nb = 3, .nf = 2, .nk = 0, .offset_v = b0_v, .estimate_offset = false, .estimate_initial = true};
}

Structure output_error(bool from_rest) {
  return {.nb = 3, .nf = 2, .nk = 1, .offset_v = 0, .estimate_offset = true, .estimate_initial = !from_rest};
}

VectorXd to_unknowns(const DiscreteModel& model, const Structure& s) {
  if (model.b.size() != s.nb || model.f.size() != s.nf || model.nk != s.nk)
    throw std::invalid_argument("the model is not of the structure asked for");
  if (!model.initial_v.empty() && model.initial_v.size() != s.nf)
    throw std::invalid_argument("a free response needs as many values as the denominator has coefficients");
  std::vector<double> x = model.b;
  x.insert(x.end(), model.f.begin(), model.f.end());
  if (s.estimate_offset) x.push_back(model.offset_v);
  for (std::size_t k = s.nf - s.unknown_initial(); k < s.nf; ++k)
    x.push_back(model.initial_v.empty() ? 0 : model.initial_v[k]);
  return Eigen::Map<const VectorXd>(x.data(), at(x.size()));
}

DiscreteModel to_model(const VectorXd& unknowns, const Structure& s) {
  if (unknowns.size() != at(s.unknowns()))
    throw std::invalid_argument("the number of unknowns is not that of the structure");
  const double* x = unknowns.data();
  DiscreteModel model;
  model.nk = s.nk;
  model.b.assign(x, x + s.nb);
  model.f.assign(x + s.nb, x + s.nb + s.nf);
  x += s.nb + s.nf;
  model.offset_v = s.estimate_offset ? *x++ : s.offset_v;
  if (s.estimate_initial) {
    model.initial_v.assign(s.nf - s.unknown_initial(), 0);
    model.initial_v.insert(model.initial_v.end(), x, x + s.unknown_initial());
  }
  return model;
}

VectorXd simulate(const DiscreteModel& model, std::span<const double> input, Eigen::MatrixXd* jacobian) {
  const auto& [b, f, nk, offset_v, initial_v] = model;
  if (f.empty()) throw std::invalid_argument("a discrete model needs at least one coefficient in the denominator");
  if (!initial_v.empty() && initial_v.size() != f.size())
    throw std::invalid_argument("a free response needs as many values as the denominator has coefficients");
  const Index n = at(input.size());
  const VectorXd charged = through_f(f, input);  // 1/F u
  VectorXd forced = VectorXd::Zero(n);
  for (std::size_t i = 0; i < b.size(); ++i) {
    const Index by = std::min(at(nk + i), n);
    forced.tail(n - by) += b[i] * charged.head(n - by);
  }
  const bool freely = !initial_v.empty();
  const VectorXd free = freely ? free_response(f, initial_v, n) : VectorXd::Zero(n);

  if (jacobian != nullptr) {
    const Index nb = at(b.size()), nf = at(f.size());
    jacobian->resize(n, nb + 2 * nf + 1);
    for (Index i = 0; i < nb; ++i) jacobian->col(i) = later(charged, at(nk) + i);
    // F v = B u  =>  F dv/df_j = -v[k-1-j];  the same for the free response, but its first nf values do not depend on F
    const VectorXd sensitivity = through_f(f, VectorXd(-forced));
    for (Index j = 0; j < nf; ++j) {
      jacobian->col(nb + j) = later(sensitivity, j + 1);
      if (!freely) continue;
      VectorXd input_of_free = later(-free, j + 1);
      input_of_free.head(std::min(nf, n)).setZero();
      jacobian->col(nb + j) += through_f(f, input_of_free);
    }
    jacobian->col(nb + nf).setOnes();
    for (Index j = 0; j < nf; ++j)
      jacobian->col(nb + nf + 1 + j) = free_response(f, unit(f.size(), static_cast<std::size_t>(j)), n);
  }
  return (forced + free).array() + offset_v;
}

double largest_pole(const std::vector<double>& f) {
  double largest = 0;
  for (const auto& root : roots(f)) largest = std::max(largest, std::abs(root));
  return largest;
}

bool stable(const std::vector<double>& f, double margin) { return largest_pole(f) <= 1 + margin; }

std::vector<double> mirrored_inside(const std::vector<double>& f) {
  auto all = roots(f);
  if (std::all_of(all.begin(), all.end(), [](const auto& r) { return std::abs(r) <= 1; })) return f;
  for (auto& root : all) {
    if (std::abs(root) > 1) root = 1.0 / std::conj(root);
  }
  return from_roots(all);
}

LeastSquares simulation_error(const Data& data, const Structure& s, const VectorXd& start) {
  require(data, s);
  if (start.size() != at(s.unknowns()))
    throw std::invalid_argument("the number of unknowns is not that of the structure");
  LeastSquares problem;
  // all b have the same scale; poles have the scale 1
  VectorXd scale = start.cwiseAbs();
  const Index nb = at(s.nb), nf = at(s.nf);
  scale.head(nb).setConstant(std::max(scale.head(nb).maxCoeff(), 1e-6));
  scale.segment(nb, nf).setOnes();
  Index next = nb + nf;
  if (s.estimate_offset) scale[next++] = 1;
  scale.tail(scale.size() - next).setConstant(0.1);
  problem.scale = scale;

  const auto shared = std::make_shared<const Data>(data);
  problem.evaluate = [shared, s](const VectorXd& x, VectorXd& r, Eigen::MatrixXd* jacobian) {
    if (!x.allFinite()) return false;
    const DiscreteModel model = to_model(x, s);
    if (!stable(model.f, 1.0 / static_cast<double>(shared->size()))) return false;
    Eigen::MatrixXd all;
    r = simulate(model, shared->current_a, jacobian != nullptr ? &all : nullptr);
    if (jacobian != nullptr) {
      std::vector<Index> columns;
      for (std::size_t k = 0; k < s.nb + s.nf; ++k) columns.push_back(at(k));
      if (s.estimate_offset) columns.push_back(at(s.nb + s.nf));
      for (std::size_t k = s.nf - s.unknown_initial(); k < s.nf; ++k) columns.push_back(at(s.nb + s.nf + 1 + k));
      *jacobian = all(Eigen::all, columns);
    }
    const Index first = at(first_within_reach(s));
    for (Index k = 0; k < r.size(); ++k) {
      const double measured_v = shared->voltage_v[static_cast<std::size_t>(k)];
      if (k >= first && std::isfinite(measured_v)) {
        r[k] -= measured_v;
      } else {
        r[k] = 0;
        if (jacobian != nullptr) jacobian->row(k).setZero();
      }
    }
    return r.allFinite() && (jacobian == nullptr || jacobian->allFinite());
  };
  return problem;
}

DiscreteModel start_values(const Data& data, const Structure& s, int refinements) {
  require(data, s);
  const auto [least, most] = std::minmax_element(data.current_a.begin(), data.current_a.end());
  if (!(*most - *least > 0))
    throw std::invalid_argument(
        "the current never changes, so its effect cannot be identified; expected a step or pulses");
  const std::vector<Index> rows = measured(data, s), few = some_of(rows, 2'000);
  Candidate best;
  const auto consider = [&](const std::vector<double>& f) {
    const Candidate c = with_best_rest(f, data, s, few);
    if (c.cost < best.cost) best = c;
    return c.cost;
  };
  std::vector<double> filter(s.nf, 0);
  for (int k = 0; k <= refinements; ++k) {  // the first without filter: ARX
    const auto f = equation_error(data, s, filter);
    if (!f) break;
    filter = mirrored_inside(*f);
    consider(filter);
  }
  // With noise the equation error may lead to a fast second pole, near a minimum that is not the best.
  if (s.nf == 2) {
    double fast = 1, slow = INFINITY, least_cost = INFINITY;  // time constants in samples
    const auto try_poles = [&](double i, double j) {
      const double p = std::exp(-1 / i), q = std::exp(-1 / j), cost = consider({-(p + q), p * q});
      if (cost < least_cost) {
        least_cost = cost;
        fast = i;
        slow = j;
      }
    };
    const double n = static_cast<double>(data.size());
    for (double i = 1; i < n; i *= 4) {
      try_poles(i, INFINITY);
      for (double j = 4 * i; j < 4 * n; j *= 4) try_poles(i, j);
    }
    for (const double factor : {2.0, 1.41, 1.19, 1.09}) {  // to 5 % of either
      const double middle_fast = fast, middle_slow = slow;
      for (const double i : {middle_fast / factor, middle_fast, middle_fast * factor}) {
        for (const double j : {middle_slow / factor, middle_slow, middle_slow * factor}) {
          if (i < j && (i != middle_fast || j != middle_slow)) try_poles(i, j);
        }
      }
    }
  }
  if (std::isfinite(best.cost)) best = with_best_rest(best.model.f, data, s, rows);
  if (!std::isfinite(best.cost))
    throw std::invalid_argument("no start values for the discrete model: its linear least squares are not finite");
  return best.model;
}

}  // namespace bms::identification
