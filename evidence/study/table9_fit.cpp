#include "study/table9_fit.hpp"

#include <algorithm>
#include <cmath>

#include "model/ocv_voltage.hpp"
#include "workflow/identification_data.hpp"

namespace bms::study {

namespace {

using Eigen::Index;
constexpr Index tenths = 10, corners = tenths + 1;
constexpr double corner_scale_v = 0.01;

/// Weights of the corners at the SOC of every sample: the straight pieces between them.
Eigen::MatrixXd corner_weights(const std::vector<StudyData>& parts, Index rows) {
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(rows, corners);
  Index row = 0;
  for (const StudyData& part : parts) {
    double soc = part.soc_from;
    const id::Data& d = part.data;
    for (std::size_t k = 0; k < d.size(); ++k, ++row) {
      if (k > 0) soc += d.current_a[k] * (d.time_s[k] - d.time_s[k - 1]) / (3'600 * d.capacity_ah);
      if (!std::isfinite(d.voltage_v[k])) continue;
      const double at = std::clamp(static_cast<double>(tenths) * soc, 0.0, static_cast<double>(tenths));
      const Index below = std::min(static_cast<Index>(at), tenths - 1);
      weights(row, below) = static_cast<double>(below + 1) - at;
      weights(row, below + 1) = at - static_cast<double>(below);
    }
  }
  return weights;
}

/// The grey box with a correction of the voltage at each corner as further unknowns.
id::LeastSquares with_corners(const id::GreyBox& grey_box, const Eigen::MatrixXd& weights) {
  const id::LeastSquares circuit = grey_box.problem();
  const Index n = circuit.scale.size();
  id::LeastSquares p;
  const auto extended = [&](const Eigen::VectorXd& values, double corner) {
    Eigen::VectorXd all(n + corners);
    all << values, Eigen::VectorXd::Constant(corners, corner);
    return all;
  };
  p.lower = extended(circuit.lower, -1);
  p.upper = extended(circuit.upper, 1);
  p.scale = extended(circuit.scale, corner_scale_v);
  p.evaluate = [circuit, &weights, n](const Eigen::VectorXd& x, Eigen::VectorXd& r, Eigen::MatrixXd* jacobian) {
    Eigen::MatrixXd of_grey;
    if (!circuit.evaluate(x.head(n), r, jacobian != nullptr ? &of_grey : nullptr)) return false;
    r.head(weights.rows()) += weights * x.tail(corners);
    if (jacobian == nullptr) return true;
    jacobian->setZero(r.size(), n + corners);
    jacobian->leftCols(n) = of_grey;
    jacobian->topRightCorner(weights.rows(), corners) = weights;
    return true;
  };
  return p;
}

Table9Row row_of(Index k, const Eigen::VectorXd& x, const id::Uncertainty& u, const std::vector<double>& corner_v) {
  const Index first_corner = x.size() - corners;
  const auto parameter = [&](const char* name, Index at) {
    return id::Parameter{.name = name, .soc = 0, .value = x[at], .std = u.std(at), .std_white = u.std_white(at)};
  };
  Table9Row row;
  const auto below = static_cast<std::size_t>(k);
  row.soc = static_cast<double>(k + 1) / tenths;
  row.r0 = parameter("r0_ohm", k);
  row.r1 = parameter("r1_ohm", tenths + k);
  row.c1 = parameter("c1_f", 2 * tenths + k);
  const double width = 1.0 / tenths, edge = static_cast<double>(k) * width;
  row.b1_v = (corner_v[below + 1] - corner_v[below]) / width;
  row.b0_v = corner_v[below] - row.b1_v * edge;
  // linear in the two corners
  const Eigen::Matrix2d covariance = u.covariance.block<2, 2>(first_corner + k, first_corner + k);
  const Eigen::Vector2d slope{-1 / width, 1 / width}, level{1 + edge / width, -edge / width};
  row.b1_std_v = std::sqrt(std::max(0.0, slope.dot(covariance * slope)));
  row.b0_std_v = std::sqrt(std::max(0.0, level.dot(covariance * level)));
  return row;
}

}  // namespace

Table9Fit fit_table9(const model::CellParameters<>& cell, const std::vector<StudyData>& parts) {
  std::vector<id::DataSet> sets;
  for (const StudyData& part : parts) sets.push_back(data_set(part));
  id::GreyBoxOptions options;
  options.bounds = workflow::circuit_bounds(cell.capacity_ah);
  for (Index k = 1; k <= tenths; ++k) options.soc_nodes.push_back(static_cast<double>(k) / tenths);
  const id::GreyBox grey_box(cell, sets, options);
  Eigen::VectorXd x = grey_box.start();
  x.head(tenths).setConstant(paper_start.r0_ohm);
  x.segment(tenths, tenths).setConstant(paper_start.r1_ohm);
  x.segment(2 * tenths, tenths)
      .setConstant(paper_start.c1_f / 5);  // several minima: the search begins below Appendix A
  x.conservativeResize(x.size() + corners);
  x.tail(corners).setZero();
  const Eigen::MatrixXd weights = corner_weights(parts, static_cast<Index>(grey_box.samples()));
  const id::LeastSquares problem = with_corners(grey_box, weights);
  const id::Optimum found = minimise(problem, x, id::Method::trust_region_reflective);
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
  problem.evaluate(found.x, residuals, &jacobian);
  const id::Uncertainty u =
      id::uncertainty(residuals, jacobian, static_cast<Index>(grey_box.samples()), found.at_bound, 0);
  Table9Fit out;
  for (Index k = 0; k < corners; ++k)
    out.corner_v.push_back(model::ocv_voltage(cell.ocv, static_cast<double>(k) / tenths) +
                           found.x[found.x.size() - corners + k]);
  for (Index k = 0; k < tenths; ++k) out.rows.push_back(row_of(k, found.x, u, out.corner_v));
  out.rmse_v = std::sqrt(residuals.squaredNorm() / static_cast<double>(grey_box.samples()));
  out.converged = found.converged;
  return out;
}

}  // namespace bms::study
