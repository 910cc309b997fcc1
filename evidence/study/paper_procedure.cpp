#include "study/paper_procedure.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "identification/goodness_of_fit.hpp"
#include "numerics/matrix_factors.hpp"

namespace bms::study {

namespace {

/// The paper estimates both initial states of every data set (3.2.4, 4.2, title of Table 8).
id::DataSet with_free_states(const StudyData& part) {
  id::DataSet set = data_set(part);
  set.estimate_initial_soc = true;
  return set;
}

id::GreyBoxOptions one_node(double soc) {
  id::GreyBoxOptions options;
  options.soc_nodes = {soc};
  options.one_start = true;
  return options;
}

model::CellParameters<> with_paper_start(model::CellParameters<> cell) {
  for (std::size_t k = 0; k < cell.rc.soc.size; ++k) {
    cell.rc.r0_ohm[k] = paper_start.r0_ohm;
    cell.rc.r1_ohm[k] = paper_start.r1_ohm;
    cell.rc.c1_f[k] = paper_start.c1_f;
  }
  return cell;
}

double percent(const StudyData& part, const Eigen::VectorXd& residuals) {
  id::FitFigure fit;
  for (Eigen::Index row = 0; row < residuals.size(); ++row) {
    const double v = part.data.voltage_v[static_cast<std::size_t>(row)];
    fit.add(v, v + residuals[row]);
  }
  return fit.percent();
}

}  // namespace

FromData::FromData(const model::CellParameters<>& given, const StudyData& part) : part_(part) {
  id::Stopping stopping;
  stopping.iterations = paper_iterations;
  stopping.cost = 1e-7;  // figures are printed with four digits
  stopping.step = 1e-5;
  found_ = id::identify_grey_box(with_paper_start(given), {with_free_states(part)}, one_node(part.middle_soc()),
                                 id::Method::trust_region_reflective, stopping);
  set_deviation();
}

double FromData::fit_to(const StudyData& part, const id::InitialState& own) const {
  const id::GreyBox grey_box(found_.cell, {with_free_states(part)}, one_node(found_.cell.rc.soc[0]));
  const id::LeastSquares problem = grey_box.problem();
  constexpr int steps = 3;              // the voltage is linear in v_rc and, within a piece of the OCV, in SOC
  constexpr double same_points = 0.01;  // of a fit
  Eigen::VectorXd x = grey_box.start(), residuals;
  x.tail(2) = Eigen::Vector2d{own.v_rc_v, own.soc};
  Eigen::MatrixXd jacobian;
  if (!problem.evaluate(x, residuals, &jacobian)) return -INFINITY;
  const Eigen::MatrixXd by_states = jacobian.rightCols(2);
  const auto squares = (by_states.transpose() * by_states).completeOrthogonalDecomposition();
  double best = percent(part, residuals);
  for (int k = 0; k < steps; ++k) {
    const Eigen::Vector2d step = squares.solve(by_states.transpose() * residuals);
    x.tail(2) = (x.tail(2) - step).cwiseMax(problem.lower.tail(2)).cwiseMin(problem.upper.tail(2));
    if (!problem.evaluate(x, residuals, nullptr)) break;
    const double now = percent(part, residuals), before = best;
    best = std::max(best, now);
    if (now < before + same_points) break;
  }
  return best;
}

/// Parameters at a bound have a deviation here, too.
void FromData::set_deviation() {
  const id::GreyBox grey_box(found_.cell, {with_free_states(part_)}, one_node(found_.cell.rc.soc[0]));
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
  if (!grey_box.problem().evaluate(found_.optimum.x, residuals, &jacobian)) return;
  const Eigen::VectorXd norm = jacobian.colwise().norm().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled = jacobian * norm.cwiseInverse().asDiagonal();
  const Eigen::MatrixXd inverse = numerics::pseudo_inverse(scaled.transpose() * scaled);
  const double step_s = part_.data.time_s[1] - part_.data.time_s[0];
  for (Eigen::Index k = 0; k < 3; ++k)
    unit_deviation_[static_cast<std::size_t>(k)] = std::sqrt(std::max(0.0, inverse(k, k)) / step_s) / norm[k];
}

}  // namespace bms::study
