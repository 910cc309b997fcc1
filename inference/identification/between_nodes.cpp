#include "identification/between_nodes.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace bms::identification {

namespace {

constexpr double node_distance = 0.1;  // distance of the nodes of Table 9

/// A curve with independent steps of standard deviation `step` from node to node has second differences of
/// sqrt(2) step. A parabola with the second difference d differs from its chord by d / 8 in the middle.
double bulge(double step) { return std::numbers::sqrt2 * step / 8; }

/// With nodes at both ends of the samples (of one node), or in the middle of each interval too.
GreyBox refined(const GreyBox& of, const Eigen::VectorXd& x) {
  GreyBoxOptions options = of.options();
  const std::vector<double>& nodes = of.options().soc_nodes;
  std::vector<double> fine;
  if (nodes.size() == 1) {
    const auto [low, high] = of.soc_range(x);
    fine = {low, std::max(high, low + 1e-6)};
  }
  for (std::size_t k = 0; nodes.size() > 1 && k < nodes.size(); ++k) {
    if (k > 0) fine.push_back((nodes[k - 1] + nodes[k]) / 2);
    fine.push_back(nodes[k]);
  }
  options.soc_nodes = fine;
  return {of.cell_with(x), of.records(), options};
}

}  // namespace

Eigen::MatrixXd changes_between_nodes(const GreyBox& grey_box, const Eigen::VectorXd& x) {
  const GreyBox fine = refined(grey_box, x);
  const auto nodes = static_cast<Eigen::Index>(grey_box.options().soc_nodes.size()),
             fine_nodes = static_cast<Eigen::Index>(fine.options().soc_nodes.size()), rest = x.size() - 3 * nodes;
  Eigen::VectorXd at = fine.start(), residuals;
  at.tail(rest) = x.tail(rest);
  Eigen::MatrixXd jacobian;
  fine.problem().evaluate(at, residuals, &jacobian);  // the same simulation as that of grey_box
  const auto rows = residuals.size() - static_cast<Eigen::Index>(fine.ties());
  const Eigen::Index per_quantity = std::max<Eigen::Index>(1, nodes - 1);
  Eigen::MatrixXd changes = Eigen::MatrixXd::Zero(rows + static_cast<Eigen::Index>(grey_box.ties()), 3 * per_quantity);
  const std::vector<double>& soc = fine.options().soc_nodes;
  for (Eigen::Index quantity = 0; quantity < 3; ++quantity) {
    const auto of = static_cast<std::size_t>(quantity);
    const auto column = [&](Eigen::Index k) {
      return jacobian.col(quantity * fine_nodes + k).head(rows) * at[quantity * fine_nodes + k];
    };
    if (nodes == 1) {
      const double rise = step_between(of, soc[0], soc[1]) * std::sqrt((soc[1] - soc[0]) / node_distance);
      changes.col(quantity).head(rows) = rise / 2 * (column(1) - column(0));
      continue;
    }
    for (Eigen::Index k = 0; k + 1 < nodes; ++k) {
      const auto below = static_cast<std::size_t>(2 * k);
      const double step =
          step_between(of, soc[below], soc[below + 2]) * std::sqrt((soc[below + 2] - soc[below]) / node_distance);
      changes.col(quantity * per_quantity + k).head(rows) = bulge(step) * column(2 * k + 1);
    }
  }
  return changes;
}

}  // namespace bms::identification
