#include "identification/linear_models.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/Dense>

#include "identification/circuit_from_discrete.hpp"
#include "identification/prefilter.hpp"

namespace bms::identification {

namespace {

constexpr Eigen::Index pieces = 10;  // as many as the OCV of the paper has

/// Position of w on the curve.
struct Place {
  Eigen::Index below = 0;
  double weight_above = 0;
};

Place place(const StaticCurve& curve, double w_v) {
  const double at = (w_v - curve.w_from_v) / curve.w_step_v;
  const auto last = static_cast<double>(curve.y_v.size() - 2);
  const double below = std::clamp(std::floor(at), 0.0, last);
  return {static_cast<Eigen::Index>(below), at - below};
}

double through(const StaticCurve& curve, double w_v) {
  if (curve.y_v.empty()) return w_v;
  const Place p = place(curve, w_v);
  const auto k = static_cast<std::size_t>(p.below);
  return curve.y_v[k] + p.weight_above * (curve.y_v[k + 1] - curve.y_v[k]);
}

/// The problem of the linear block with the inner values of the curve as further unknowns. The ends of the curve are
/// fixed, because gain and offset are already unknowns of the linear block.
LeastSquares with_curve(const Data& data, const Structure& structure, const StaticCurve& start,
                        const Eigen::VectorXd& linear_start) {
  const LeastSquares linear = simulation_error(data, structure, linear_start);
  const Eigen::Index n = linear_start.size(), inner = pieces - 1;
  LeastSquares p;
  p.scale.resize(n + inner);
  p.scale << linear.scale, Eigen::VectorXd::Constant(inner, 0.01);
  p.evaluate = [=](const Eigen::VectorXd& x, Eigen::VectorXd& r, Eigen::MatrixXd* jacobian) {
    Eigen::MatrixXd of_linear;
    if (!linear.evaluate(x.head(n), r, jacobian != nullptr ? &of_linear : nullptr)) return false;
    StaticCurve curve = start;
    for (Eigen::Index k = 0; k < inner; ++k) curve.y_v[static_cast<std::size_t>(k + 1)] = x[n + k];
    if (jacobian != nullptr) jacobian->setZero(r.size(), n + inner);
    for (Eigen::Index k = 0; k < r.size(); ++k) {
      const double measured_v = data.voltage_v[static_cast<std::size_t>(k)];
      if (!std::isfinite(measured_v)) continue;
      const double w_v = r[k] + measured_v;
      const Place at = place(curve, w_v);
      r[k] = through(curve, w_v) - measured_v;
      if (jacobian == nullptr) continue;
      const auto below = static_cast<std::size_t>(at.below);
      jacobian->row(k).head(n) = of_linear.row(k) * ((curve.y_v[below + 1] - curve.y_v[below]) / curve.w_step_v);
      if (at.below > 0) (*jacobian)(k, n + at.below - 1) += 1 - at.weight_above;
      if (at.below < inner) (*jacobian)(k, n + at.below) += at.weight_above;
    }
    return true;
  };
  return p;
}

Eigen::VectorXd simulated(const LinearModel& m, const Data& data) {
  Eigen::VectorXd v = simulate(m.model, data.current_a);
  for (Eigen::Index k = 0; k < v.size(); ++k) v[k] = through(m.curve, v[k]);
  return v;
}

/// A curve y = w over the range of w, and its problem.
LeastSquares begin_curve(const Data& data, Eigen::VectorXd& start, const Stopping& stopping, LinearModel& m) {
  const Eigen::Index linear = start.size();
  const LeastSquares problem = simulation_error(data, m.structure, start);
  start = minimise(problem, start, Method::trust_region_reflective, stopping).x;
  const Eigen::VectorXd w = simulate(to_model(start, m.structure), data.current_a);
  m.curve.w_from_v = w.minCoeff();
  m.curve.w_step_v = std::max(1e-6, (w.maxCoeff() - w.minCoeff()) / static_cast<double>(pieces));
  for (Eigen::Index k = 0; k <= pieces; ++k)
    m.curve.y_v.push_back(m.curve.w_from_v + static_cast<double>(k) * m.curve.w_step_v);
  LeastSquares with = with_curve(data, m.structure, m.curve, start);
  start.conservativeResize(linear + pieces - 1);
  for (Eigen::Index k = 1; k < pieces; ++k) start[linear + k - 1] = m.curve.y_v[static_cast<std::size_t>(k)];
  return with;
}

/// The circuit parameters of the model and their standard deviations, with warnings.
void set_circuit(const LinearModel& m, const Data& data, double soc, const Uncertainty& u, Identification& found) {
  const double step_s = even_step_s(data.time_s), capacity_c = 3'600 * data.capacity_ah;
  const DiscreteCoefficients c{m.model.b[0], m.model.b[1], m.model.b[2], m.model.f[0], m.model.f[1]};
  const Intersample input =
      m.kind == LinearKind::transfer_function ? Intersample::zero_order_hold : Intersample::first_order_hold;
  const CircuitResult reading = circuit_from_discrete(c, step_s, capacity_c, input);
  const CircuitParameters std = circuit_std(c, u.covariance.topLeftCorner<5, 5>(), step_s, capacity_c, input);
  const CircuitParameters std_white =
      circuit_std(c, u.covariance_white.topLeftCorner<5, 5>(), step_s, capacity_c, input);
  const auto add = [&](const char* name, double CircuitParameters::*value) {
    found.parameters.push_back(
        {.name = name, .soc = soc, .value = reading.circuit.*value, .std = std.*value, .std_white = std_white.*value});
  };
  add("b1_v", &CircuitParameters::b1_v);
  add("r0_ohm", &CircuitParameters::r0_ohm);
  add("r1_ohm", &CircuitParameters::r1_ohm);
  add("c1_f", &CircuitParameters::c1_f);
  for (const std::string& what : reading.implausible)
    found.warnings.push_back("no_circuit: " + what +
                             "; the model follows the voltage, but it does not describe a circuit");
}

}  // namespace

LinearIdentification identify_linear(LinearKind kind, const model::CellParameters<>& cell, const Data& data, double soc,
                                     Method method, const Stopping& stopping) {
  LinearIdentification out;
  LinearModel& m = out.model;
  Identification& found = out.identification;
  m.kind = kind;
  m.structure = kind == LinearKind::transfer_function
                    ? transfer_function(cell.ocv.b0_v[model::cell_detail::ocv_piece(cell.ocv, soc)])
                    : output_error();
  Eigen::VectorXd start = to_unknowns(start_values(data, m.structure), m.structure);
  const Eigen::Index linear = start.size();
  const LeastSquares problem = kind == LinearKind::hammerstein_wiener ? begin_curve(data, start, stopping, m)
                                                                      : simulation_error(data, m.structure, start);
  found.optimum = minimise(problem, start, method, stopping);
  const Eigen::VectorXd& x = found.optimum.x;
  m.model = to_model(x.head(linear), m.structure);
  for (Eigen::Index k = linear; k < x.size(); ++k) m.curve.y_v[static_cast<std::size_t>(k - linear + 1)] = x[k];

  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
  if (!problem.evaluate(x, residuals, &jacobian))
    throw std::invalid_argument("the simulation of the identified model is not finite");
  const Uncertainty u = uncertainty(residuals, jacobian, residuals.size(), found.optimum.at_bound, 0);
  found.correlation = u.correlation;
  found.correlation_length = u.correlation_length;
  found.fading = fading(residuals);
  found.estimation = fit_of(data.voltage_v, simulated(m, data), data.current_a, found.fading);
  found.estimation.output_variance_v2 = u.output_variance_v2;
  set_circuit(m, data, soc, u, found);
  if (!stable(m.model.f))
    found.warnings.push_back(fmt::format("unstable: the model has a pole at {:.6f}", largest_pole(m.model.f)));
  if (!found.optimum.converged) found.warnings.push_back("not_converged: " + found.optimum.reason);
  return out;
}

FitStatistics validate(const LinearModel& model, const Data& data, double fading) {
  LinearModel m = model;
  m.model.initial_v.assign(m.model.f.size(), 0);
  Eigen::MatrixXd jacobian;
  const Eigen::VectorXd w = simulate(m.model, data.current_a, &jacobian);
  const auto nf = static_cast<Eigen::Index>(m.model.f.size());
  // The free response is linear in its start. Behind the curve it is fitted with the slope of the curve, in a few
  // iterations.
  Eigen::VectorXd initial = Eigen::VectorXd::Zero(nf);
  const auto free = jacobian.rightCols(nf);
  for (int pass = 0; pass < (m.curve.y_v.empty() ? 1 : 10); ++pass) {
    const Eigen::VectorXd now = w + free * initial;
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(nf, nf);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(nf);
    for (Eigen::Index k = 0; k < now.size(); ++k) {
      const double measured_v = data.voltage_v[static_cast<std::size_t>(k)];
      if (!std::isfinite(measured_v) || !std::isfinite(now[k])) continue;
      constexpr double h = 1e-6;
      const double slope =
          m.curve.y_v.empty() ? 1 : (through(m.curve, now[k] + h) - through(m.curve, now[k] - h)) / (2 * h);
      const Eigen::VectorXd row = slope * free.row(k).transpose();
      normal += row * row.transpose();
      right += row * (measured_v - through(m.curve, now[k]));
    }
    initial += normal.completeOrthogonalDecomposition().solve(right);
  }
  m.model.initial_v.assign(initial.data(), initial.data() + nf);
  return fit_of(data.voltage_v, simulated(m, data), data.current_a, fading);
}

}  // namespace bms::identification
