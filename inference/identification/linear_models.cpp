#include "identification/linear_models.hpp"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/Dense>

#include "identification/circuit_from_discrete.hpp"
#include "identification/hammerstein_wiener_search.hpp"
#include "identification/prefilter.hpp"
#include "identification/resample.hpp"
#include "numerics/matrix_factors.hpp"

namespace bms::identification {

namespace {

Intersample input_of(LinearKind kind) {
  return kind == LinearKind::transfer_function ? Intersample::zero_order_hold : Intersample::first_order_hold;
}

/// The first measured voltage.
double first_voltage(const Data& data) {
  for (const double v : data.voltage_v) {
    if (std::isfinite(v)) return v;
  }
  throw std::invalid_argument("fewer measured voltages than unknowns of the discrete model");
}

/// The model of a circuit at rest at the first measured voltage.
DiscreteModel model_of(const CircuitParameters& circuit, LinearKind kind, const Structure& s, const Data& data) {
  const DiscreteCoefficients c =
      discrete_from_circuit(circuit, even_step_s(data.time_s), 3'600 * data.capacity_ah, input_of(kind));
  DiscreteModel m;
  m.nk = s.nk;
  m.b = {c.c0, c.c1, c.c2};
  m.f = {c.a1, c.a2};
  const double first_v = first_voltage(data);
  m.offset_v = s.estimate_offset ? first_v : s.offset_v;
  if (s.estimate_initial) m.initial_v.assign(s.nf, s.estimate_offset ? 0 : first_v - s.offset_v);
  return m;
}

/// The circuit parameters of the model and its polynomials, with their standard deviations and warnings.
void set_circuit(const LinearModel& m, const Data& data, double soc, const Uncertainty& u, Identification& found) {
  const double step_s = even_step_s(data.time_s), capacity_c = 3'600 * data.capacity_ah;
  const DiscreteModel& linear = m.blocks.linear;
  const DiscreteCoefficients c{linear.b[0], linear.b[1], linear.b[2], linear.f[0], linear.f[1]};
  const Intersample input = input_of(m.kind);
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
  const bool tf = m.kind == LinearKind::transfer_function;
  const char* const names[] = {tf ? "c0" : "b_1", tf ? "c1" : "b_2", tf ? "c2" : "b_3", tf ? "a1" : "f_1",
                               tf ? "a2" : "f_2"};
  const double values[] = {c.c0, c.c1, c.c2, c.a1, c.a2};
  for (Eigen::Index k = 0; k < 5; ++k)
    found.polynomials.push_back(
        {.name = names[k], .soc = soc, .value = values[k], .std = u.std(k), .std_white = u.std_white(k)});
  for (const std::string& what : reading.implausible)
    found.warnings.push_back("no_circuit: " + what +
                             "; the model follows the voltage, but it does not describe a circuit");
}

/// A search and its result.
struct Searched {
  HammersteinWiener blocks;
  LeastSquares problem;
  Optimum found;
};

/// The linear block, from its start.
Searched search_linear(LinearKind kind, const model::CellParameters<>& cell, const Data& data, double soc,
                       Method method, const LinearOptions& options) {
  Searched s;
  s.blocks.structure = kind == LinearKind::transfer_function
                           ? transfer_function(cell.ocv.b0_v[model::cell_detail::ocv_piece(cell.ocv, soc)])
                           : output_error();
  const DiscreteModel start =
      options.start ? model_of(*options.start, kind, s.blocks.structure, data) : start_values(data, s.blocks.structure);
  const Eigen::VectorXd x = to_unknowns(start, s.blocks.structure);
  s.problem = simulation_error(data, s.blocks.structure, x);
  s.found = minimise(s.problem, x, method, options.stopping);
  s.blocks.linear = to_model(s.found.x, s.blocks.structure);
  return s;
}

/// The model with the curves fitted around its linear block.
HammersteinWiener with_curves(HammersteinWiener m, const LeastSquares& problem, const Stopping& stopping) {
  Eigen::VectorXd x = to_unknowns(m);
  const auto first = static_cast<Eigen::Index>(m.structure.unknowns());
  x.tail(x.size() - first) =
      minimise(with_first_fixed(problem, x, first), x.tail(x.size() - first), Method::trust_region_reflective, stopping)
          .x;
  return with_unknowns(std::move(m), x);
}

/// Everything at once, and after the curves alone; the better of both ends.
Searched search_from(HammersteinWiener start, const Data& data, Method method, const Stopping& stopping) {
  Searched s;
  s.blocks = std::move(start);
  s.problem = simulation_error(data, s.blocks);
  s.found = minimise(s.problem, to_unknowns(s.blocks), method, stopping);
  const Eigen::VectorXd x = to_unknowns(with_curves(s.blocks, s.problem, stopping));
  Optimum staged = minimise(s.problem, x, method, stopping);
  if (staged.cost < s.found.cost) s.found = std::move(staged);
  s.blocks = with_unknowns(s.blocks, s.found.x);
  return s;
}

/// From the best place for the corners.
Searched search_from_best_place(const Searched& linear, const model::CellParameters<>& cell, const Data& data,
                                double soc, Method method, const Stopping& stopping) {
  Searched s;
  s.blocks = find_hammerstein_wiener(linear.blocks.linear, linear.blocks.structure, cell.ocv, data, soc);
  s.problem = simulation_error(data, s.blocks);
  s.found = minimise(s.problem, to_unknowns(s.blocks), method, stopping);
  s.blocks = with_unknowns(s.blocks, s.found.x);
  return s;
}

/// From a given start: without a search for the place of the corners.
Searched search_curves(const Searched& linear, const model::CellParameters<>& cell, const Data& data, double soc,
                       Method method, const LinearOptions& options) {
  if (!options.start) return search_from_best_place(linear, cell, data, soc, method, options.stopping);
  return search_from(begin_hammerstein_wiener(linear.blocks.linear, linear.blocks.structure, cell.ocv, data, soc), data,
                     method, options.stopping);
}

}  // namespace

LinearIdentification identify_linear(LinearKind kind, const model::CellParameters<>& cell, const Data& given,
                                     double soc, Method method, const LinearOptions& options) {
  const EvenData even = evenly_sampled(given);
  const Data& data = even.data;
  const bool hw = kind == LinearKind::hammerstein_wiener;
  Searched s = search_linear(kind, cell, data, soc, hw ? Method::trust_region_reflective : method, options);
  if (hw) s = search_curves(s, cell, data, soc, method, options);
  LinearIdentification out;
  LinearModel& m = out.model;
  Identification& found = out.identification;
  out.data = data;
  m.kind = kind;
  m.blocks = s.blocks;
  found.optimum = s.found;
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
  if (!s.problem.evaluate(s.found.x, residuals, &jacobian))
    throw std::invalid_argument("the simulation of the identified model is not finite");
  const auto samples = static_cast<Eigen::Index>(data.size());
  const Uncertainty u = uncertainty(residuals, jacobian, samples, found.optimum.at_bound, 0);
  found.correlation = u.correlation;
  found.correlation_length = u.correlation_length;
  found.fading = fading(residuals.head(samples));
  found.estimation = fit_of(data.voltage_v, simulate(m.blocks, data.current_a), data.current_a, found.fading);
  found.estimation.output_variance_v2 = u.output_variance_v2;
  set_circuit(m, data, soc, u, found);
  const std::vector<double>& f = m.blocks.linear.f;
  if (!stable(f)) found.warnings.push_back(fmt::format("unstable: the model has a pole at {:.6f}", largest_pole(f)));
  if (even.resampled) {
    found.warnings.push_back(
        fmt::format("resampled: the sampling is uneven, so this model uses the recording resampled to {:.3g} s; {} "
                    "samples lie in gaps",
                    even.step_s, even.gap_samples));
  }
  const Whiteness test = whiteness(residuals.head(samples));
  if (hw && !test.white()) {
    found.warnings.push_back(
        fmt::format("correlated_residuals: the residuals are not white noise (Ljung-Box {:.0f}, limit {:.0f}), so the "
                    "model lacks something or the search ended in another minimum; no confidence band is given",
                    test.statistic, test.limit));
  }
  if (!found.optimum.converged) found.warnings.push_back("not_converged: " + found.optimum.reason);
  return out;
}

FitStatistics validate(const LinearModel& model, const Data& given, double fading) {
  const Data data = evenly_sampled(given).data;
  HammersteinWiener m = model.blocks;
  m.linear.initial_v.assign(m.linear.f.size(), 0);
  Eigen::MatrixXd jacobian;
  const Eigen::VectorXd w = simulate(m.linear, m.input.through(data.current_a), &jacobian);
  const auto nf = static_cast<Eigen::Index>(m.linear.f.size());
  // The free response is linear in its start. Behind the curve it is fitted with the slope of the curve, in a few
  // iterations.
  Eigen::VectorXd initial = Eigen::VectorXd::Zero(nf);
  const auto free = jacobian.rightCols(nf);
  for (int pass = 0; pass < (m.output.y_v.empty() ? 1 : 10); ++pass) {
    const Eigen::VectorXd now = w + free * initial;
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(nf, nf);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(nf);
    for (Eigen::Index k = 0; k < now.size(); ++k) {
      const double measured_v = data.voltage_v[static_cast<std::size_t>(k)];
      if (!std::isfinite(measured_v) || !std::isfinite(now[k])) continue;
      const Eigen::VectorXd row = m.output.slope(now[k]) * free.row(k).transpose();
      normal += row * row.transpose();
      right += row * (measured_v - m.output.through(now[k]));
    }
    initial += numerics::shortest_least_squares(normal, right);
  }
  m.linear.initial_v.assign(initial.data(), initial.data() + nf);
  return fit_of(data.voltage_v, simulate(m, data.current_a), data.current_a, fading);
}

}  // namespace bms::identification
