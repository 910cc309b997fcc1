#include "identification/grey_box_search.hpp"

#include <algorithm>
#include <cmath>

#include "identification/residuals.hpp"

namespace bms::identification {

namespace {

/// Start values of the time constant, as multiples of the given one.
constexpr double time_constants[] = {1, 0.2, 5};
constexpr double same_cost = 1e-4;  // relative difference of two optima that count as the same

constexpr int most_passes = 20;
constexpr double agreement = 0.01;     // relative change of tie_v from pass to pass
constexpr double resolution_v = 1e-6;  // of readings; the noise of a recording without any

/// Residuals at x of the rows with a measured voltage.
Eigen::VectorXd measured_residuals(const GreyBox& grey_box, const Eigen::VectorXd& x) {
  Eigen::VectorXd residuals;
  if (!grey_box.problem().evaluate(x, residuals, nullptr)) return {};
  std::vector<double> kept;
  Eigen::Index row = 0;
  for (const DataSet& record : grey_box.records()) {
    for (const double measured_v : record.data.voltage_v) {
      if (std::isfinite(measured_v)) kept.push_back(residuals[row]);
      ++row;
    }
  }
  return Eigen::Map<const Eigen::VectorXd>(kept.data(), static_cast<Eigen::Index>(kept.size()));
}

/// Of the residuals from sample to sample: what runs of them have in common is not in it.
double noise_v(const Eigen::VectorXd& residuals) {
  const Eigen::Index n = residuals.size();
  if (n < 2) return resolution_v;
  const double squares = (residuals.tail(n - 1) - residuals.head(n - 1)).squaredNorm();
  return std::max(resolution_v, std::sqrt(squares / (2 * static_cast<double>(n - 1))));
}

/// A run of residuals as one: s sqrt(L). hidden_v: what they do not show.
double run_v(const Eigen::VectorXd& residuals, Eigen::Index unknowns, double hidden_v) {
  const auto freedom = static_cast<double>(std::max<Eigen::Index>(1, residuals.size() - unknowns));
  const double variance_v2 = residuals.squaredNorm() / freedom + hidden_v * hidden_v;
  return std::max(resolution_v, std::sqrt(variance_v2 * correlation_length(residuals)));
}

/// One fit: the best optimum of the given starts, with the given ties.
Search fit_with(const model::CellParameters<>& cell, const std::vector<DataSet>& records, const GreyBoxOptions& options,
                std::span<const Eigen::VectorXd> starts, Method method, const Stopping& stopping, double& own_tie_v) {
  const GreyBox grey_box(cell, records, options);
  Search found = best_optimum(grey_box, starts, method, stopping);
  found.tie_v = options.tie_v;
  own_tie_v = run_v(measured_residuals(grey_box, found.optimum.x), found.optimum.x.size(), options.ocv_hidden_v);
  return found;
}

}  // namespace

std::vector<Eigen::VectorXd> starts_of(const GreyBox& grey_box) {
  const auto nodes = static_cast<Eigen::Index>(grey_box.options().soc_nodes.size());
  std::vector<Eigen::VectorXd> starts;
  for (const double factor : time_constants) {
    starts.push_back(grey_box.start());
    starts.back().segment(2 * nodes, nodes) *= factor;
    if (grey_box.options().one_start) break;
  }
  return starts;
}

Search best_optimum(const GreyBox& grey_box, std::span<const Eigen::VectorXd> starts, Method method,
                    const Stopping& stopping) {
  const LeastSquares problem = grey_box.problem();
  Search best;
  std::vector<double> costs;
  int evaluations = 0;
  for (const Eigen::VectorXd& start : starts) {
    Optimum found = minimise(problem, start, method, stopping);
    costs.push_back(found.cost);
    evaluations += found.evaluations;
    if (costs.size() == 1 || found.cost < best.optimum.cost) best.optimum = std::move(found);
  }
  best.optimum.evaluations = evaluations;
  best.starts = static_cast<int>(costs.size());
  best.agreeing = static_cast<int>(std::count_if(
      costs.begin(), costs.end(), [&](double c) { return c <= best.optimum.cost * (1 + same_cost) + 1e-18; }));
  return best;
}

Search search_with_prior(const model::CellParameters<>& cell, const std::vector<DataSet>& records,
                         GreyBoxOptions options, std::span<const Eigen::VectorXd> starts, Method method,
                         const Stopping& stopping) {
  options.tie_v = noise_v(measured_residuals(GreyBox(cell, records, options), starts.front()));
  std::vector<Eigen::VectorXd> from = {starts.front()};
  Search found;
  int evaluations = 0, iterations = 0;
  bool all_starts = false;
  for (int pass = 0; pass < most_passes; ++pass) {
    double own_tie_v = 0;
    found = fit_with(cell, records, options, from, method, stopping, own_tie_v);
    evaluations += found.optimum.evaluations;
    iterations += found.optimum.iterations;
    const bool agrees = std::abs(own_tie_v - found.tie_v) <= agreement * found.tie_v;
    if (agrees && all_starts) break;
    // one optimum is followed until it agrees with its residuals; then all starts compete with it
    all_starts = agrees;
    from = {found.optimum.x};
    if (all_starts) from.insert(from.end(), starts.begin(), starts.end());
    options.tie_v = own_tie_v;
  }
  found.optimum.evaluations = evaluations;
  found.optimum.iterations = iterations;
  return found;
}

}  // namespace bms::identification
