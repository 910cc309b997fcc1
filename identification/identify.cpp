#include "identification/identify.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "identification/goodness_of_fit.hpp"
#include "identification/rest_reading.hpp"

namespace bms::identification {

namespace {

/// Those of `values` where `by` is a number.
Eigen::VectorXd where(const Eigen::VectorXd& values, const Eigen::VectorXd& by) {
  std::vector<double> kept;
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    if (std::isfinite(by[k])) kept.push_back(values[k]);
  }
  return Eigen::Map<const Eigen::VectorXd>(kept.data(), static_cast<Eigen::Index>(kept.size()));
}

bool measured(const Data& data, std::size_t k) { return std::isfinite(data.voltage_v[k]); }

/// Refuses what no search could find anything in.
void require_excitation(const std::vector<DataSet>& records) {
  double largest_step_a = 0, capacity_ah = 0;
  std::size_t samples = 0;
  for (const DataSet& r : records) {
    capacity_ah = std::max(capacity_ah, r.data.capacity_ah);
    for (std::size_t k = 0; k < r.data.size(); ++k) {
      samples += measured(r.data, k) ? 1 : 0;
      if (k > 0 && measured(r.data, k))
        largest_step_a = std::max(largest_step_a, std::abs(r.data.current_a[k] - r.data.current_a[k - 1]));
    }
  }
  if (samples < 10) throw std::invalid_argument("less than 10 samples in the window, expected data to identify from");
  if (largest_step_a < 0.02 * capacity_ah) {
    throw std::invalid_argument(
        "the current hardly changes: r0_ohm, r1_ohm and c1_f cannot be seen, expected current pulses as of the "
        "experiment high_1m_low_30s");
  }
}

const char* experiment_that_shows(const std::string& name) {
  if (name == "initial_soc") return "a rest of an hour before or after (ocv_1h_rest) would show it";
  if (name == "ocv_lean")
    return "a recording that both charges and discharges over the same state of charge would show it";
  return "pulses of 1 min with rests of 30 s (experiment high_1m_low_30s) at that state of charge would show it";
}

void warn(Identification& result) {
  for (const Parameter& p : result.parameters) {
    const std::string where = fmt::format("{} at {:.0f} %", p.name, 100 * p.soc);
    if (!p.identifiable)
      result.warnings.push_back(
          fmt::format("not_seen: {} cannot be seen in this data; {}", where, experiment_that_shows(p.name)));
    else if (p.at_bound)
      result.warnings.push_back(
          fmt::format("at_bound: {} ended at its bound of {:g}; {}", where, p.value, experiment_that_shows(p.name)));
    else if (p.std > 0.5 * std::abs(p.value) && p.name != "ocv_lean") {
      result.warnings.push_back(fmt::format("uncertain: {} is {:.3g} with a standard deviation of {:.2g}; {}", where,
                                            p.value, p.std, experiment_that_shows(p.name)));
    }
  }
  for (const InitialState& state : result.initial) {
    if (!state.observable) {
      result.warnings.push_back(
          fmt::format("initial_soc_not_observable: the state of charge at the start may be off by {:.0f} % (standard "
                      "deviation); {}",
                      100 * state.soc_std, experiment_that_shows("initial_soc")));
    }
  }
  if (!result.optimum.converged) result.warnings.push_back("not_converged: " + result.optimum.reason);
  if (result.starts > 1 && result.agreeing == 1) {
    result.warnings.push_back(
        fmt::format("several_minima: {} starts ended at different places, the best was taken", result.starts));
  }
}

/// Time constants the search begins with, as multiples of the start's: C1 decides which of several minima is found.
constexpr double time_constants[] = {1, 0.2, 5};

Identification identified(const model::CellParameters<>& start, const std::vector<DataSet>& records,
                          const GreyBoxOptions& options, Method method, const Stopping& stopping) {
  const GreyBox grey_box(start, records, options);
  const LeastSquares problem = grey_box.problem();
  const auto nodes = static_cast<Eigen::Index>(options.soc_nodes.size());

  Identification result;
  std::vector<double> costs;
  int evaluations = 0;
  for (const double times : time_constants) {
    Eigen::VectorXd x = grey_box.start();
    x.segment(2 * nodes, nodes) *= times;
    Optimum found = minimise(problem, x, method, stopping);
    costs.push_back(found.cost);
    evaluations += found.evaluations;
    if (costs.size() == 1 || found.cost < result.optimum.cost) result.optimum = std::move(found);
  }
  result.optimum.evaluations = evaluations;
  result.starts = static_cast<int>(costs.size());
  result.agreeing = static_cast<int>(std::count_if(
      costs.begin(), costs.end(), [&](double c) { return c <= result.optimum.cost * (1 + 1e-4) + 1e-18; }));

  const Eigen::VectorXd& x = result.optimum.x;
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
  if (!problem.evaluate(x, residuals, &jacobian))
    throw std::invalid_argument("the simulation leaves all bounds, expected a start nearer to the cell");
  // rows that were not measured are not data
  Eigen::Index rows = 0, sampled = 0;
  for (Eigen::Index k = 0; k < residuals.size(); ++k) {
    if (k == static_cast<Eigen::Index>(grey_box.samples())) sampled = rows;
    if (residuals[k] == 0 && jacobian.row(k).isZero(0)) continue;
    residuals[rows] = residuals[k];
    jacobian.row(rows++) = jacobian.row(k);
  }
  if (residuals.size() == static_cast<Eigen::Index>(grey_box.samples())) sampled = rows;
  residuals.conservativeResize(rows);
  jacobian.conservativeResize(rows, Eigen::NoChange);
  const Uncertainty u = uncertainty(residuals, jacobian, sampled, result.optimum.at_bound, start.tolerance.ocv_v);
  result.correlation = u.correlation;
  result.correlation_length = u.correlation_length;
  result.cell = grey_box.cell_with(x);
  for (std::size_t r = 0; r < records.size(); ++r) result.initial.push_back({records[r].initial_soc, 0, 0, true});
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const Unknown& unknown = grey_box.unknowns()[static_cast<std::size_t>(k)];
    const bool at_bound = result.optimum.at_bound[k] != 0;
    if (unknown.name == "initial_v_rc_v") {
      result.initial[unknown.record].v_rc_v = x[k];
    } else if (unknown.name == "initial_soc") {
      InitialState& state = result.initial[unknown.record];
      constexpr double uniform = 0.29;  // standard deviation of a state of charge of which nothing is known
      state.soc = x[k];
      state.soc_std = u.identifiable[k] != 0 && !at_bound ? std::min(uniform, u.std_with_offset(k)) : uniform;
      state.observable = state.soc_std <= observable_soc_std;
    } else {
      result.parameters.push_back({unknown.name, unknown.soc, x[k], u.std(k), u.std_white(k), std::abs(u.offset[k]),
                                   at_bound, at_bound || u.identifiable[k] != 0});
    }
  }
  for (std::size_t k = 0; k < options.soc_nodes.size(); ++k) {
    const auto deviation = [&](Eigen::Index column) { return u.std(column * nodes + static_cast<Eigen::Index>(k)); };
    result.cell.rc.r0_std_ohm.push_back(deviation(0));
    result.cell.rc.r1_std_ohm.push_back(deviation(1));
    result.cell.rc.c1_std_f.push_back(deviation(2));
  }

  FitFigure open_loop, one_step;
  ErrorFigure error;
  for (std::size_t r = 0; r < records.size(); ++r) {
    const Data& data = records[r].data;
    Eigen::VectorXd simulated(static_cast<Eigen::Index>(data.size()));
    grey_box.simulate(x, r, simulated, nullptr);
    if (r == 0) {
      result.fading = fading(without_missing(fit_of(data.voltage_v, simulated, data.current_a, 0).error_v));
      result.estimation = fit_of(data.voltage_v, simulated, data.current_a, result.fading);
    }
    double last_error = std::numeric_limits<double>::quiet_NaN();
    for (std::size_t k = 0; k < data.size(); ++k) {
      const double v = data.voltage_v[k], s = simulated[static_cast<Eigen::Index>(k)];
      open_loop.add(v, s);
      error.add(v - s);
      if (std::isfinite(last_error)) one_step.add(v, s + result.fading * last_error);
      last_error = v - s;
    }
  }
  result.estimation.fit_percent = open_loop.percent();
  result.estimation.one_step_fit_percent = one_step.percent();
  result.estimation.rmse_v = error.rms();
  result.estimation.largest_v = error.max();
  result.estimation.samples = error.count();
  result.estimation.output_variance_v2 = u.output_variance_v2;
  warn(result);
  return result;
}

}  // namespace

FitStatistics fit_of(const std::vector<double>& measured_v, const Eigen::VectorXd& simulated_v,
                     const std::vector<double>& current_a, double fading) {
  FitStatistics fit;
  FitFigure open_loop, one_step;
  ErrorFigure error;
  fit.error_v.resize(simulated_v.size());
  for (Eigen::Index k = 0; k < simulated_v.size(); ++k) {
    const double v = measured_v[static_cast<std::size_t>(k)];
    fit.error_v[k] = v - simulated_v[k];
    open_loop.add(v, simulated_v[k]);
    error.add(fit.error_v[k]);
    if (k > 0 && std::isfinite(fit.error_v[k - 1])) one_step.add(v, simulated_v[k] + fading * fit.error_v[k - 1]);
  }
  fit.fit_percent = open_loop.percent();
  fit.one_step_fit_percent = one_step.percent();
  fit.rmse_v = error.rms();
  fit.largest_v = error.max();
  fit.samples = error.count();
  fit.output_variance_v2 = fit.rmse_v * fit.rmse_v;
  for (const int steps : {1, 10, 60}) {
    ErrorFigure prediction;
    const Eigen::VectorXd e = prediction_error(fit.error_v, steps, fading);
    for (Eigen::Index k = 0; k < e.size(); ++k) prediction.add(e[k]);
    if (prediction.count() > 0) fit.ahead.push_back({steps, prediction.rms()});
  }
  fit.residuals = analyse(without_missing(fit.error_v),
                          where(Eigen::Map<const Eigen::VectorXd>(current_a.data(), simulated_v.size()), fit.error_v));
  return fit;
}

Identification identify_grey_box(const model::CellParameters<>& start, const std::vector<DataSet>& records,
                                 const GreyBoxOptions& options, Method method, const Stopping& stopping) {
  require_excitation(records);
  if (options.soc_nodes.size() < 2) return identified(start, records, options, method, stopping);
  // First as if nothing depended on soc: where the search for the nodes begins, and a measure of how far neighbours may
  // differ before the residuals, which come in runs, say so.
  GreyBoxOptions constant = options;
  constant.soc_nodes = {0.5};
  const Identification first = identified(start, records, constant, method, stopping);
  GreyBoxOptions tied = options;
  tied.tie_v = first.estimation.rmse_v * std::sqrt(first.correlation_length);
  Identification result = identified(first.cell, records, tied, method, stopping);
  result.optimum.iterations += first.optimum.iterations;
  result.optimum.evaluations += first.optimum.evaluations;
  return result;
}

model::CellParameters<> started_from_rests(const model::CellParameters<>& cell, const Data& data,
                                           const CircuitBounds& b) {
  model::CellParameters<> started = cell;
  RestReadings readings;
  try {
    readings = read_rests(data);
  } catch (const std::invalid_argument&) {
    return started;  // times or currents that it cannot read; the fit says what is wrong with them
  }
  for (std::size_t k = 0; k < started.rc.soc.size; ++k) {
    if (std::isfinite(readings.r0_ohm)) started.rc.r0_ohm[k] = std::clamp(readings.r0_ohm, b.r0_min_ohm, b.r0_max_ohm);
    if (std::isfinite(readings.r1_ohm)) started.rc.r1_ohm[k] = std::clamp(readings.r1_ohm, b.r1_min_ohm, b.r1_max_ohm);
    if (std::isfinite(readings.c1_f)) started.rc.c1_f[k] = std::clamp(readings.c1_f, b.c1_min_f, b.c1_max_f);
  }
  return started;
}

FitStatistics validate(const model::CellParameters<>& cell, const DataSet& record, double fading) {
  DataSet fixed_start = record;
  fixed_start.estimate_initial_soc = false;
  GreyBoxOptions options;
  for (std::size_t k = 0; k < cell.rc.soc.size; ++k) options.soc_nodes.push_back(cell.rc.soc[k]);
  const GreyBox grey_box(cell, {fixed_start}, options);
  LeastSquares problem = grey_box.problem();
  Eigen::VectorXd x(static_cast<Eigen::Index>(grey_box.unknowns().size()));
  const auto nodes = static_cast<Eigen::Index>(cell.rc.soc.size);
  for (Eigen::Index k = 0; k < nodes; ++k) {
    const auto node = static_cast<std::size_t>(k);
    x[k] = cell.rc.r0_ohm[node];
    x[nodes + k] = cell.rc.r1_ohm[node];
    x[2 * nodes + k] = cell.rc.c1_f[node];
  }
  if (fixed_start.estimate_initial_v_rc) {
    // the voltage is linear in v_rc at the start: one step of Gauss and Newton is exact
    x[3 * nodes] = 0;
    Eigen::VectorXd residuals;
    Eigen::MatrixXd jacobian;
    if (problem.evaluate(x, residuals, &jacobian)) {
      const auto column = jacobian.col(3 * nodes);
      if (column.squaredNorm() > 0) x[3 * nodes] = -column.dot(residuals) / column.squaredNorm();
    }
  }
  Eigen::VectorXd simulated(static_cast<Eigen::Index>(record.data.size()));
  if (!grey_box.simulate(x, 0, simulated, nullptr)) throw std::invalid_argument("the simulation leaves all bounds");
  return fit_of(record.data.voltage_v, simulated, record.data.current_a, fading);
}

}  // namespace bms::identification
