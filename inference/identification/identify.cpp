#include "identification/identify.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "identification/between_nodes.hpp"
#include "identification/goodness_of_fit.hpp"
#include "identification/grey_box_search.hpp"
#include "identification/ocv_curve.hpp"
#include "identification/rest_reading.hpp"

namespace bms::identification {

namespace {

constexpr std::size_t fewest_samples = 10;
constexpr double least_excitation_c_rate = 0.02;  // step of the current from sample to sample
constexpr double uncertain_fraction = 0.5;        // standard deviation over value that gives a warning

/// Standard deviation of a state of charge of which nothing is known: uniform over 0..1.
constexpr double unknown_soc_std = 0.29;

/// The elements of `values` at which `by` is finite.
Eigen::VectorXd where(const Eigen::VectorXd& values, const Eigen::VectorXd& by) {
  std::vector<double> kept;
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    if (std::isfinite(by[k])) kept.push_back(values[k]);
  }
  return Eigen::Map<const Eigen::VectorXd>(kept.data(), static_cast<Eigen::Index>(kept.size()));
}

bool measured(const Data& data, std::size_t k) { return std::isfinite(data.voltage_v[k]); }

/// Rejects data from which nothing can be identified.
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
  if (samples < fewest_samples)
    throw std::invalid_argument("fewer than 10 samples in the window, expected a longer recording");
  if (largest_step_a < least_excitation_c_rate * capacity_ah) {
    throw std::invalid_argument(
        "the current hardly changes, so r0_ohm, r1_ohm and c1_f cannot be identified, expected current pulses as in "
        "the "
        "experiment high_1m_low_30s");
  }
}

const char* experiment_that_shows(Quantity quantity) {
  switch (quantity) {
    case Quantity::initial_soc:
      return "a rest of one hour before or after it (experiment ocv_1h_rest) determines it";
    case Quantity::ocv_branch:
      return "a recording that both charges and discharges over the same state of charge determines it";
    default:
      return "pulses of 1 min with rests of 30 s (experiment high_1m_low_30s) at that state of charge determine it";
  }
}

enum class Doubt { none, not_seen, at_bound, uncertain };

/// Parameters of one name with the same doubt, at neighbouring nodes.
struct Doubtful {
  Doubt doubt = Doubt::none;
  Quantity quantity{};
  std::vector<Parameter> nodes;
};

Doubt doubt_about(const Parameter& p, Quantity quantity) {
  if (!p.identifiable) return Doubt::not_seen;
  if (p.at_bound) return Doubt::at_bound;
  const bool uncertain = p.std > uncertain_fraction * std::abs(p.value) && quantity != Quantity::ocv_branch;
  return uncertain ? Doubt::uncertain : Doubt::none;
}

std::string warning_of(const Doubtful& d) {
  const Parameter &first = d.nodes.front(), &last = d.nodes.back();
  const bool one = d.nodes.size() == 1;
  const std::string where = one ? fmt::format("{} at {:.0f} %", first.name, 100 * first.soc)
                                : fmt::format("{} at {:.0f} to {:.0f} % ({} points)", first.name, 100 * first.soc,
                                              100 * last.soc, d.nodes.size());
  const char* experiment = experiment_that_shows(d.quantity);
  switch (d.doubt) {
    case Doubt::not_seen:
      return fmt::format("not_seen: this recording does not determine {}; {}", where, experiment);
    case Doubt::at_bound:
      return one ? fmt::format("at_bound: {} ended at its bound of {:g}; {}", where, first.value, experiment)
                 : fmt::format("at_bound: {} ended at a bound; {}", where, experiment);
    default:
      break;
  }
  if (one)
    return fmt::format("uncertain: {} is {:.3g} with a standard deviation of {:.2g}; {}", where, first.value, first.std,
                       experiment);
  double most = 0;
  for (const Parameter& p : d.nodes) most = std::max(most, p.std / std::abs(p.value));
  return fmt::format("uncertain: {} has standard deviations of up to {:.0f} % of its values; {}", where, 100 * most,
                     experiment);
}

void warn_of_search(Identification& result) {
  for (const InitialState& state : result.initial) {
    if (state.observable) continue;
    result.warnings.push_back(fmt::format(
        "initial_soc_not_observable: the state of charge at the start has a standard deviation of {:.0f} %; {}",
        100 * state.soc_std, experiment_that_shows(Quantity::initial_soc)));
  }
  if (!result.optimum.converged) result.warnings.push_back("not_converged: " + result.optimum.reason);
  if (result.starts > 1 && result.agreeing == 1) {
    result.warnings.push_back(
        fmt::format("several_minima: {} start values led to different results, the best one was used", result.starts));
  }
}

/// Uncertainty at the optimum. Rows without a measured voltage are left out.
Uncertainty uncertainty_at(const GreyBox& grey_box, const Optimum& optimum, double ocv_tolerance_v) {
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
  if (!grey_box.problem().evaluate(optimum.x, residuals, &jacobian))
    throw std::invalid_argument("the simulation is not finite, expected a start nearer to the cell");
  Eigen::MatrixXd unmodelled;  // the priors are those of curves; the paper's procedure has none
  if (grey_box.options().tie_v > 0) unmodelled = changes_between_nodes(grey_box, optimum.x);
  const auto samples = static_cast<Eigen::Index>(grey_box.samples());
  Eigen::Index rows = 0, sampled = 0;
  for (Eigen::Index k = 0; k < residuals.size(); ++k) {
    if (k == samples) sampled = rows;
    if (residuals[k] == 0 && jacobian.row(k).isZero(0)) continue;
    residuals[rows] = residuals[k];
    if (unmodelled.size() > 0) unmodelled.row(rows) = unmodelled.row(k);
    jacobian.row(rows++) = jacobian.row(k);
  }
  if (residuals.size() == samples) sampled = rows;
  residuals.conservativeResize(rows);
  jacobian.conservativeResize(rows, Eigen::NoChange);
  if (unmodelled.size() > 0) unmodelled.conservativeResize(rows, Eigen::NoChange);
  return uncertainty(residuals, jacobian, sampled, optimum.at_bound, ocv_tolerance_v, unmodelled);
}

/// Parameters, initial states and their warnings from the unknowns at the optimum.
void set_parameters(const GreyBox& grey_box, const Uncertainty& u, Identification& result) {
  const Eigen::VectorXd& x = result.optimum.x;
  std::vector<Doubtful> doubtful;  // neighbouring nodes of a parameter with the same doubt share a warning
  for (const DataSet& record : grey_box.records()) result.initial.push_back({record.initial_soc, 0, 0, true});
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const Unknown& unknown = grey_box.unknowns()[static_cast<std::size_t>(k)];
    const bool at_bound = result.optimum.at_bound[k] != 0, identifiable = u.identifiable[k] != 0;
    if (unknown.quantity == Quantity::initial_v_rc) {
      result.initial[unknown.record].v_rc_v = x[k];
    } else if (unknown.quantity == Quantity::initial_soc) {
      InitialState& state = result.initial[unknown.record];
      state.soc = x[k];
      state.soc_std = identifiable && !at_bound ? std::min(unknown_soc_std, u.std_with_offset(k)) : unknown_soc_std;
      state.observable = state.soc_std <= observable_soc_std;
    } else {
      result.parameters.push_back({.name = unknown.name(),
                                   .soc = unknown.soc,
                                   .value = x[k],
                                   .std = u.std(k),
                                   .std_white = u.std_white(k),
                                   .by_ocv_tolerance = std::abs(u.offset[k]),
                                   .at_bound = at_bound,
                                   .identifiable = at_bound || identifiable});
      const Parameter& p = result.parameters.back();
      const Doubt doubt = doubt_about(p, unknown.quantity);
      const bool alike =
          !doubtful.empty() && doubtful.back().doubt == doubt && doubtful.back().nodes.back().name == p.name;
      if (!alike) doubtful.push_back({doubt, unknown.quantity, {}});
      doubtful.back().nodes.push_back(p);
    }
  }
  for (const Doubtful& d : doubtful) {
    if (d.doubt != Doubt::none) result.warnings.push_back(warning_of(d));
  }
}

/// The identified cell, with the standard deviations of its RC table.
model::CellParameters<> identified_cell(const GreyBox& grey_box, const Eigen::VectorXd& x, const Uncertainty& u) {
  const std::size_t nodes = grey_box.options().soc_nodes.size();
  model::CellParameters<> cell = grey_box.cell_with(x);
  for (std::size_t k = 0; k < nodes; ++k) {
    const auto std_of = [&](std::size_t column) { return u.std(static_cast<Eigen::Index>(column * nodes + k)); };
    cell.rc.r0_std_ohm.push_back(std_of(0));
    cell.rc.r1_std_ohm.push_back(std_of(1));
    cell.rc.c1_std_f.push_back(std_of(2));
  }
  return cell;
}

/// Statistics of the first recording, with the fit and errors over all recordings.
void set_estimation(const GreyBox& grey_box, const Uncertainty& u, Identification& result) {
  FitFigure open_loop, one_step;
  ErrorFigure error;
  for (std::size_t r = 0; r < grey_box.records().size(); ++r) {
    const Data& data = grey_box.records()[r].data;
    Eigen::VectorXd simulated(static_cast<Eigen::Index>(data.size()));
    grey_box.simulate(result.optimum.x, r, simulated, nullptr);
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
  result.estimation.one_step_fit_percent = open_loop.percent();
  result.estimation.corrected_one_step_fit_percent = one_step.percent();
  result.estimation.rmse_v = error.rms();
  result.estimation.largest_v = error.max();
  result.estimation.samples = error.count();
  result.estimation.output_variance_v2 = u.output_variance_v2;
}

Identification described(const GreyBox& grey_box, const Search& found) {
  Identification result;
  result.optimum = found.optimum;
  result.starts = found.starts;
  result.agreeing = found.agreeing;
  result.options = grey_box.options();
  const Uncertainty u = uncertainty_at(grey_box, result.optimum, grey_box.cell_with(result.optimum.x).tolerance.ocv_v);
  result.correlation = u.correlation;
  result.correlation_length = u.correlation_length;
  set_parameters(grey_box, u, result);
  result.cell = identified_cell(grey_box, result.optimum.x, u);
  set_estimation(grey_box, u, result);
  warn_of_search(result);
  return result;
}

/// With an error of the OCV the branch position is free to be anywhere. It becomes the one with which the cell, which
/// has no such error, follows the recordings best. The voltage is linear in it.
void set_ocv_branch(const GreyBox& grey_box, Eigen::VectorXd& x) {
  if (!grey_box.options().estimate_ocv_branch || grey_box.options().ocv_sigma_v == 0) return;
  GreyBoxOptions exact = grey_box.options();
  exact.ocv_sigma_v = 0;
  const GreyBox cell(grey_box.cell_with(x), grey_box.records(), exact);
  const LeastSquares problem = cell.problem();
  const auto branch = static_cast<Eigen::Index>(3 * exact.soc_nodes.size());
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
  if (!problem.evaluate(x, residuals, &jacobian)) return;
  const Eigen::VectorXd soc = cell.counted_soc(x);
  for (Eigen::Index k = 0; k < soc.size(); ++k) {
    if (exact.ocv_ends_unmeasured && (soc[k] < unmeasured_end || soc[k] > 1 - unmeasured_end)) jacobian(k, branch) = 0;
  }
  const auto column = jacobian.col(branch);
  if (!(column.squaredNorm() > 0)) return;
  x[branch] = std::clamp(x[branch] - column.dot(residuals) / column.squaredNorm(), problem.lower[branch],
                         problem.upper[branch]);
}

}  // namespace

void reject_without_excitation(const DataSet& record) { require_excitation({record}); }

FitStatistics fit_of(std::span<const double> measured_v, const Eigen::VectorXd& simulated_v,
                     std::span<const double> current_a, double fading) {
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
  fit.one_step_fit_percent = open_loop.percent();
  fit.corrected_one_step_fit_percent = one_step.percent();
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
  GreyBoxOptions constant = options;
  if (options.soc_nodes.size() > 1) constant.soc_nodes = {0.5};
  const GreyBox one_node(start, records, constant);
  if (options.soc_nodes.size() < 2 && options.ocv_sigma_v > 0) {
    Search found = search_with_prior(start, records, constant, starts_of(one_node), method, stopping);
    constant.tie_v = found.tie_v;
    const GreyBox with_prior(start, records, constant);
    set_ocv_branch(with_prior, found.optimum.x);
    return described(with_prior, found);
  }
  const Search first = best_optimum(one_node, starts_of(one_node), method, stopping);
  if (options.soc_nodes.size() < 2) return described(one_node, first);
  // the nodes begin at the constant parameters, and at those of the start cell
  const model::CellParameters<> cell = one_node.cell_with(first.optimum.x);
  GreyBoxOptions tied = options;
  const GreyBox nodes(cell, records, tied);
  std::vector<Eigen::VectorXd> starts = starts_of(nodes);
  starts.push_back(GreyBox(start, records, tied).start());
  const Eigen::Index states = first.optimum.x.size() - 3;  // the branch position and the initial states
  for (Eigen::VectorXd& x : starts) x.tail(states) = first.optimum.x.tail(states);
  Search found = search_with_prior(cell, records, tied, starts, method, stopping);
  found.optimum.iterations += first.optimum.iterations;
  found.optimum.evaluations += first.optimum.evaluations;
  tied.tie_v = found.tie_v;
  const GreyBox with_prior(cell, records, tied);
  set_ocv_branch(with_prior, found.optimum.x);
  return described(with_prior, found);
}

model::CellParameters<> started_from_rests(const model::CellParameters<>& cell, const Data& data,
                                           const CircuitBounds& b) {
  model::CellParameters<> started = cell;
  RestReadings readings;
  try {
    readings = read_rests(data);
  } catch (const std::invalid_argument&) {
    return started;  // invalid times or currents; the fit reports what is wrong with them
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
    // the voltage is linear in v_rc at the start, so one Gauss-Newton step is exact
    x[3 * nodes] = 0;
    Eigen::VectorXd residuals;
    Eigen::MatrixXd jacobian;
    if (problem.evaluate(x, residuals, &jacobian)) {
      const auto column = jacobian.col(3 * nodes);
      if (column.squaredNorm() > 0) x[3 * nodes] = -column.dot(residuals) / column.squaredNorm();
    }
  }
  Eigen::VectorXd simulated(static_cast<Eigen::Index>(record.data.size()));
  if (!grey_box.simulate(x, 0, simulated, nullptr)) throw std::invalid_argument("the simulation is not finite");
  return fit_of(record.data.voltage_v, simulated, record.data.current_a, fading);
}

}  // namespace bms::identification
