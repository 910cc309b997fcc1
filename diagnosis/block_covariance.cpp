#include "diagnosis/block_covariance.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "diagnosis/products.hpp"

namespace bms::diagnosis {

namespace {

/// Derivatives by the parameters of the cell file's own mechanisms, in their standard deviations. A fit leaves these as
/// they are, so that their error goes into what it finds.
Columns by_own_mechanisms(const LikelihoodModel& likelihood, const HypothesisFit& fit) {
  std::vector<ParameterRef> refs;
  std::vector<double> sigmas;
  for (std::size_t s = 0; s < fit.hypothesis.own; ++s) {
    const MechanismSetting& setting = fit.hypothesis.settings[s];
    const model::MechanismInfo& info = model::catalogue[setting.index];
    for (std::size_t p = 0; p < info.parameters; ++p) {
      if (info.parameter[p].role == model::Role::given || !(setting.deviation[p] > 0)) continue;
      refs.push_back({s, p});
      sigmas.push_back(setting.deviation[p]);
    }
  }
  if (refs.empty()) return Columns(static_cast<Eigen::Index>(likelihood.samples()), 0);
  Columns columns = likelihood.derivatives(fit.hypothesis, fit.calibration, refs);
  for (Eigen::Index j = 0; j < columns.cols(); ++j) columns.col(j) *= sigmas[static_cast<std::size_t>(j)];
  return columns;
}

}  // namespace

Eigen::MatrixXd block_covariance(const LikelihoodModel& likelihood, const HypothesisFit& fit) {
  const Columns base = likelihood.calibration_derivatives(fit.hypothesis, fit.calibration);
  Columns own = likelihood.derivatives(fit.hypothesis, fit.calibration, fit.hypothesis.sought());
  const Eigen::MatrixXd normal = squared(base) + Eigen::MatrixXd::Identity(base.cols(), base.cols());  // with its prior
  const Eigen::LDLT<Eigen::MatrixXd> solver = normal.ldlt();
  const Eigen::MatrixXd follow = solver.solve(products(base, own));
  own -= base * follow;
  Columns file = by_own_mechanisms(likelihood, fit);
  file -= base * solver.solve(products(base, file));
  const Eigen::MatrixXd with_file = own.transpose() * file,
                        known = file.transpose() * file + Eigen::MatrixXd::Identity(file.cols(), file.cols());
  Eigen::MatrixXd pulls = Eigen::MatrixXd::Zero(own.cols(), own.cols());
  Eigen::Index first = 0;
  double blocks = 0;
  for (const PreparedRecording& r : likelihood.records()) {
    for_each_block(r.size(), [&](Eigen::Index from, Eigen::Index count) {
      ++blocks;
      const Eigen::VectorXd pull =
          own.middleRows(first + from, count).transpose() * fit.residual.segment(first + from, count);
      pulls += pull * pull.transpose();
    });
    first += static_cast<Eigen::Index>(r.size());
  }
  // the prior of the base parameters pulls as it is assumed to
  Eigen::MatrixXd all = blocks / (blocks - 1) * pulls + follow.transpose() * follow;
  // the file's mechanisms are known to their standard deviations, and together as well as these recordings show
  if (file.cols() > 0) all += with_file * known.ldlt().solve(with_file.transpose());
  return fit.covariance * all * fit.covariance;
}

void include_model_error(const LikelihoodModel& likelihood, HypothesisFit& fit) {
  const std::vector<ParameterRef> sought = fit.hypothesis.sought();
  if (sought.empty()) return;
  const Eigen::MatrixXd wide = block_covariance(likelihood, fit);
  Eigen::VectorXd times(wide.rows());
  for (Eigen::Index j = 0; j < wide.rows(); ++j) {
    const double ratio = wide(j, j) / fit.covariance(j, j);
    times[j] = std::isfinite(ratio) ? std::sqrt(std::max(ratio, 1.0)) : 1;
    const ParameterRef& p = sought[static_cast<std::size_t>(j)];
    fit.hypothesis.settings[p.setting].deviation[p.parameter] *= times[j];
  }
  fit.covariance = times.asDiagonal() * fit.covariance * times.asDiagonal();
}

}  // namespace bms::diagnosis
