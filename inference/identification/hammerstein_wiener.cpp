#include "identification/hammerstein_wiener.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <random>
#include <stdexcept>

#include "identification/residuals.hpp"

namespace bms::identification {

namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr std::size_t pieces = 10;  // as many as the OCV of the paper has
constexpr std::size_t corners = pieces + 1;
constexpr double rounded_part = 0.25;  // of a piece, on each side of a corner
constexpr double soft_c_rate = 0.05;   // below it s(i) is rounded

/// Standard deviations of the priors, for residuals of a millivolt.
constexpr double residual_v = 0.001, corner_prior_v = 0.1, input_prior = 0.3;

/// max(0, x), rounded within +-1.
double ramp(double x) {
  if (x <= -1) return 0;
  return x >= 1 ? x : (x + 1) * (x + 1) / 4;
}
double ramp_slope(double x) { return std::clamp((x + 1) / 2, 0.0, 1.0); }

/// A rounded ramp, or its slope, from every inner corner.
class Bends {
 public:
  /// at: in pieces from the first of `count` corners.
  template <class Basis>
  Bends(double at, std::size_t count, const Basis& basis) : last_(count - 1) {
    for (std::size_t k = 1; k < last_; ++k) bend_[k] = basis((at - static_cast<double>(k)) / rounded_part);
  }

  /// Straight-line basis: corner k as a sum of ramps.
  double weight(std::size_t k) const {
    double weight = 0;
    // second differences of the corners are the changes of slope at the inner corners
    if (k >= 2) weight += bend_[k - 1];
    if (k >= 1 && k < last_) weight -= 2 * bend_[k];
    if (k + 2 <= last_) weight += bend_[k + 1];
    return weight;
  }

 private:
  std::size_t last_;
  std::array<double, corners> bend_{};
};

/// Weight of corner k in the curve.
double corner_weight(const Bends& ramps, double at, std::size_t k) {
  double weight = rounded_part * ramps.weight(k);
  if (k == 0) weight += 1 - at;  // the line through the first two corners
  if (k == 1) weight += at;
  return weight;
}

/// Free parameters of the model behind `simulation_error` that are no corners and not of the linear block.
constexpr Index input_unknowns = 2;

struct Problem {
  Data data;
  HammersteinWiener start;
  VectorXd unknowns;
  std::size_t every = 1;

  Index sample_rows() const { return static_cast<Index>((data.size() + every - 1) / every); }
};

Index linear_size(const HammersteinWiener& m) { return static_cast<Index>(m.structure.unknowns()); }

/// dw / d linear unknowns, in the order of the structure.
Eigen::MatrixXd of_linear_unknowns(const Eigen::MatrixXd& all, const Structure& s) {
  std::vector<Index> columns;
  const auto at = [](std::size_t k) { return static_cast<Index>(k); };
  for (std::size_t k = 0; k < s.nb + s.nf; ++k) columns.push_back(at(k));
  if (s.estimate_offset) columns.push_back(at(s.nb + s.nf));
  for (std::size_t k = s.nf - s.unknown_initial(); k < s.nf; ++k) columns.push_back(at(s.nb + s.nf + 1 + k));
  return all(Eigen::all, columns);
}

/// The rows of the samples.
void add_samples(const Problem& p, const HammersteinWiener& m, VectorXd& r, Eigen::MatrixXd* jacobian) {
  Eigen::MatrixXd all;
  const VectorXd w = simulate(m.linear, m.input.through(p.data.current_a), jacobian != nullptr ? &all : nullptr);
  Eigen::MatrixXd by_linear;
  VectorXd by_direction, by_growth;
  if (jacobian != nullptr) {
    by_linear = of_linear_unknowns(all, m.structure);
    DiscreteModel forced = m.linear;
    forced.offset_v = 0;
    forced.initial_v.clear();
    std::vector<double> size, grown;
    for (const double i : p.data.current_a) {
      size.push_back(m.input.size(i));
      grown.push_back(i * size.back() / m.input.one_c_a);
    }
    by_direction = simulate(forced, size);
    by_growth = simulate(forced, grown);
  }
  const Index first = linear_size(m), every = static_cast<Index>(p.every);
  for (Index row = 0; row < p.sample_rows(); ++row) {
    const Index k = row * every;
    const double measured_v = p.data.voltage_v[static_cast<std::size_t>(k)];
    if (!std::isfinite(measured_v)) continue;
    r[row] = m.output.through(w[k]) - measured_v;
    if (jacobian == nullptr) continue;
    const double slope = m.output.slope(w[k]);
    jacobian->row(row).head(first) = slope * by_linear.row(k);
    (*jacobian)(row, first) = slope * by_direction[k];
    (*jacobian)(row, first + 1) = slope * by_growth[k];
    const double at = (w[k] - m.output.w_from_v) / m.output.w_step_v;
    const Bends ramps(at, corners, ramp);
    for (std::size_t c = 0; c < corners; ++c)
      (*jacobian)(row, first + input_unknowns + static_cast<Index>(c)) = corner_weight(ramps, at, c);
  }
}

/// The rows of the priors on input curve and corners.
void add_priors(const Problem& p, const VectorXd& x, VectorXd& r, Eigen::MatrixXd* jacobian) {
  const Index first = linear_size(p.start);
  for (Index k = first; k < x.size(); ++k) {
    const double weight = residual_v / (k < first + input_unknowns ? input_prior : corner_prior_v);
    const Index row = p.sample_rows() + k - first;
    r[row] = weight * (x[k] - p.unknowns[k]);
    if (jacobian != nullptr) (*jacobian)(row, k) = weight;
  }
}

}  // namespace

double InputCurve::size(double current_a) const {
  const double soft_a = soft_c_rate * one_c_a;
  return std::hypot(current_a, soft_a) - soft_a;
}

std::vector<double> InputCurve::through(std::span<const double> current_a) const {
  std::vector<double> u;
  u.reserve(current_a.size());
  for (const double i : current_a) u.push_back(i + size(i) * (direction + growth * i / one_c_a));
  return u;
}

double OutputCurve::through(double w_v) const {
  if (y_v.empty()) return w_v;
  const double at = (w_v - w_from_v) / w_step_v;
  const Bends ramps(at, y_v.size(), ramp);
  double y = 0;
  for (std::size_t k = 0; k < y_v.size(); ++k) y += y_v[k] * corner_weight(ramps, at, k);
  return y;
}

double OutputCurve::slope(double w_v) const {
  if (y_v.empty()) return 1;
  const Bends slopes((w_v - w_from_v) / w_step_v, y_v.size(), ramp_slope);
  double slope = y_v[1] - y_v[0];
  for (std::size_t k = 0; k < y_v.size(); ++k) slope += y_v[k] * slopes.weight(k);
  return slope / w_step_v;
}

VectorXd simulate(const HammersteinWiener& m, std::span<const double> current_a) {
  VectorXd v = simulate(m.linear, m.input.through(current_a));
  for (double& w : v) w = m.output.through(w);
  return v;
}

VectorXd to_unknowns(const HammersteinWiener& m) {
  const Index first = linear_size(m);
  VectorXd x(first + input_unknowns + static_cast<Index>(corners));
  x.head(first) = to_unknowns(m.linear, m.structure);
  x[first] = m.input.direction;
  x[first + 1] = m.input.growth;
  for (std::size_t c = 0; c < corners; ++c) x[first + input_unknowns + static_cast<Index>(c)] = m.output.y_v[c];
  return x;
}

HammersteinWiener with_unknowns(HammersteinWiener m, const VectorXd& x) {
  const Index first = linear_size(m);
  m.linear = to_model(x.head(first), m.structure);
  m.input.direction = x[first];
  m.input.growth = x[first + 1];
  for (std::size_t c = 0; c < corners; ++c) m.output.y_v[c] = x[first + input_unknowns + static_cast<Index>(c)];
  return m;
}

Index unknowns_before_corners(const HammersteinWiener& m) { return linear_size(m) + input_unknowns; }

HammersteinWiener begin_hammerstein_wiener(const DiscreteModel& linear, const Structure& structure,
                                           const model::OcvTable<double>& ocv, const Data& data, double soc,
                                           const BeyondData& beyond) {
  HammersteinWiener m{structure, linear, {}, {}};
  m.input.one_c_a = data.capacity_ah;
  const VectorXd w = simulate(linear, data.current_a);
  // only where the voltage counts: elsewhere the linear block may be anywhere
  double w_low = INFINITY, w_high = -INFINITY, counted = 0, lowest = INFINITY, highest = -INFINITY;
  for (std::size_t k = 0; k < data.size(); ++k) {
    if (k > 0) counted += data.current_a[k] * (data.time_s[k] - data.time_s[k - 1]) / (3'600 * data.capacity_ah);
    if (!std::isfinite(data.voltage_v[k])) continue;
    w_low = std::min(w_low, w[static_cast<Index>(k)]);
    w_high = std::max(w_high, w[static_cast<Index>(k)]);
    lowest = std::min(lowest, counted);
    highest = std::max(highest, counted);
  }
  m.output.w_step_v = std::max(1e-6, (w_high - w_low) / (static_cast<double>(pieces) - beyond.below - beyond.above));
  m.output.w_from_v = w_low - beyond.below * m.output.w_step_v;
  const double half = (highest - lowest) / 2;
  const auto ocv_v = [&](double at) {
    const double inside = std::clamp(at, 0.0, 1.0);
    const std::size_t k = model::cell_detail::ocv_piece(ocv, inside);
    return ocv.b0_v[k] + ocv.b1_v[k] * inside;
  };
  const double from_v = ocv_v(soc - half), range_v = ocv_v(soc + half) - from_v;
  for (std::size_t k = 0; k < corners; ++k) {
    const double part = static_cast<double>(k) / static_cast<double>(pieces);
    const double shape = range_v > 0 ? (ocv_v(soc - half + 2 * part * half) - from_v) / range_v : part;
    m.output.y_v.push_back(m.output.w_from_v + shape * m.output.w_step_v * static_cast<double>(pieces));
  }
  return m;
}

LeastSquares simulation_error(const Data& data, const HammersteinWiener& start, std::size_t every) {
  const auto shared = std::make_shared<Problem>();
  shared->data = data;
  shared->start = start;
  shared->unknowns = to_unknowns(start);
  shared->every = every;
  const Index first = linear_size(start);
  LeastSquares problem;
  problem.scale = VectorXd::Constant(shared->unknowns.size(), 0.01);
  problem.scale.head(first) = simulation_error(data, start.structure, shared->unknowns.head(first)).scale;
  problem.scale.segment(first, input_unknowns).setConstant(0.1);
  problem.evaluate = [shared, first](const VectorXd& x, VectorXd& r, Eigen::MatrixXd* jacobian) {
    if (!x.allFinite()) return false;
    const HammersteinWiener m = with_unknowns(shared->start, x);
    if (!stable(m.linear.f, 1.0 / static_cast<double>(shared->data.size()))) return false;
    const Index rows = shared->sample_rows() + x.size() - first;
    r = VectorXd::Zero(rows);
    if (jacobian != nullptr) *jacobian = Eigen::MatrixXd::Zero(rows, x.size());
    add_samples(*shared, m, r, jacobian);
    add_priors(*shared, x, r, jacobian);
    return r.allFinite() && (jacobian == nullptr || jacobian->allFinite());
  };
  return problem;
}

VectorXd residuals_of(const HammersteinWiener& model, const Data& data) {
  VectorXd residuals = -simulate(model, data.current_a);
  for (Index k = 0; k < residuals.size(); ++k) residuals[k] += data.voltage_v[static_cast<std::size_t>(k)];
  return without_missing(residuals);
}

std::vector<HammersteinWiener> resampled(const HammersteinWiener& model, const Data& data, std::size_t count,
                                         std::uint64_t seed) {
  const VectorXd simulated = simulate(model, data.current_a), residuals = residuals_of(model, data);
  const auto n = static_cast<double>(residuals.size());
  const auto unknowns = static_cast<double>(to_unknowns(model).size());
  if (n <= unknowns) throw std::invalid_argument("fewer measured voltages than unknowns of the model");
  const double enlarged = std::sqrt(n / (n - unknowns));
  const auto block = static_cast<std::size_t>(std::clamp(std::ceil(correlation_length(residuals)), 1.0, n / 4));
  std::mt19937_64 random(seed);
  std::vector<HammersteinWiener> models;
  Stopping few;
  few.iterations = 20;
  while (models.size() < count) {
    Data drawn = data;
    std::vector<double>& v = drawn.voltage_v.edit();
    std::size_t source = 0;
    for (std::size_t k = 0; k < v.size(); ++k) {
      if (k % block == 0)
        source = static_cast<std::size_t>(random() % (static_cast<std::size_t>(residuals.size()) - block + 1));
      if (!std::isfinite(v[k])) continue;
      v[k] = simulated[static_cast<Index>(k)] + enlarged * residuals[static_cast<Index>(source + k % block)];
    }
    const Optimum found =
        minimise(simulation_error(drawn, model), to_unknowns(model), Method::trust_region_reflective, few);
    models.push_back(with_unknowns(model, found.x));
  }
  return models;
}

Band band_of(const HammersteinWiener& model, const std::vector<HammersteinWiener>& resampled,
             std::span<const double> current_a) {
  constexpr double z = 1.959964;  // 95 %
  const auto count = static_cast<double>(resampled.size());
  const double t = z + (z * z * z + z) / (4 * (count - 1));  // Student's, for the spread of few models
  const auto n = static_cast<Index>(current_a.size());
  VectorXd sum = VectorXd::Zero(n), squares = VectorXd::Zero(n);
  for (const HammersteinWiener& m : resampled) {
    const VectorXd v = simulate(m, current_a) - simulate(model, current_a);
    sum += v;
    squares += v.cwiseAbs2();
  }
  const VectorXd variance = (squares - sum.cwiseAbs2() / count) / (count - 1);
  const VectorXd half = t * variance.cwiseMax(0).cwiseSqrt(), middle = simulate(model, current_a);
  return {middle - half, middle + half};
}

std::optional<Band> confidence_band(const HammersteinWiener& model, const Data& data, std::size_t count,
                                    std::uint64_t seed) {
  if (!whiteness(residuals_of(model, data)).white()) return std::nullopt;
  return band_of(model, resampled(model, data, count, seed), data.current_a);
}

}  // namespace bms::identification
