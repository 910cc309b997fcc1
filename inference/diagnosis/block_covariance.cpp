#include "diagnosis/block_covariance.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "diagnosis/fit_parameters.hpp"
#include "diagnosis/numerics.hpp"
#include "diagnosis/products.hpp"
#include "numerics/symmetric_eigen.hpp"

namespace bms::diagnosis {

namespace {

/// 1 / variance of what is known of each estimated parameter before any voltage is looked at; 0: nothing.
Eigen::VectorXd prior_precision(const LikelihoodModel& likelihood, const HypothesisFit& fit) {
  const FitParameters parameters(likelihood.cell(), fit.hypothesis);
  Eigen::VectorXd precision = Eigen::VectorXd::Zero(parameters.size());
  for (Eigen::Index j = 0; j < parameters.size(); ++j) {
    const double sigma = parameters.known_within(j, parameters.of(fit.hypothesis, j));
    if (sigma > 0) precision[j] = 1 / (sigma * sigma);
  }
  return precision;
}

/// l with l l' = covariance. Where rounding has left a covariance that has none, of a wider one that has: with the
/// least variances, in units of the standard deviations, raised above rounding.
Eigen::MatrixXd factor_of(const Eigen::MatrixXd& covariance) {
  const Eigen::LLT<Eigen::MatrixXd> root(covariance);
  if (root.info() == Eigen::Success) return root.matrixL();
  const Eigen::VectorXd variance = covariance.diagonal().cwiseAbs(),
                        unit = (variance.array() > 0).select(variance.cwiseSqrt(), 1.0);
  const numerics::SymmetricEigen axes =
      numerics::symmetric_eigen(unit.cwiseInverse().asDiagonal() * covariance * unit.cwiseInverse().asDiagonal());
  return unit.asDiagonal() * axes.vectors * axes.values.cwiseMax(numerics.fit.ridge).cwiseSqrt().asDiagonal();
}

/// Covariance from what the data say, as uncertain in each direction as their pulls are there, but not less than by the
/// covariance of the fit; and from the prior, which the error of the model leaves as it is.
/// pulls: covariance of the data's pulls. prior: precision of each parameter.
Eigen::MatrixXd with_prior(const Eigen::MatrixXd& covariance, const Eigen::VectorXd& prior,
                           const Eigen::MatrixXd& pulls) {
  // in coordinates in which the covariance of the fit is 1: data + rest = 1
  const Eigen::MatrixXd l = factor_of(covariance);
  const Eigen::MatrixXd rest = l.transpose() * prior.asDiagonal() * l;
  const numerics::SymmetricEigen known = numerics::symmetric_eigen(rest);
  const Eigen::VectorXd share = (1 - known.values.array()).cwiseMax(numerics.fit.ridge);  // known from data
  const Eigen::MatrixXd data_root = known.vectors * share.cwiseSqrt().asDiagonal();
  const Eigen::MatrixXd back = share.cwiseSqrt().cwiseInverse().asDiagonal() * known.vectors.transpose();
  const Eigen::MatrixXd turned = back * l.transpose();
  const numerics::SymmetricEigen spread = numerics::symmetric_eigen(turned * pulls * turned.transpose());
  const Eigen::VectorXd weaker = spread.values.cwiseMax(1).cwiseInverse();
  const Eigen::MatrixXd data = data_root * spread.vectors;
  const Eigen::MatrixXd precision = data * weaker.asDiagonal() * data.transpose() + rest;
  return l * precision.ldlt().solve(Eigen::MatrixXd(l.transpose()));
}

}  // namespace

std::vector<FileParameter> own_parameters(const Hypothesis& h) {
  std::vector<FileParameter> own;
  for (std::size_t s = 0; s < h.own; ++s) {
    const MechanismSetting& setting = h.settings[s];
    const model::MechanismInfo& info = model::catalogue[setting.index];
    for (std::size_t p = 0; p < info.parameters; ++p) {
      if (info.parameter[p].role == model::Role::given || !(setting.deviation[p] > 0)) continue;
      own.push_back({{s, p}, setting.deviation[p]});
    }
  }
  return own;
}

Columns by_own_mechanisms(const LikelihoodModel& likelihood, const HypothesisFit& fit) {
  const std::vector<FileParameter> own = own_parameters(fit.hypothesis);
  if (own.empty()) return Columns(static_cast<Eigen::Index>(likelihood.samples()), 0);
  std::vector<ParameterRef> refs;
  for (const FileParameter& o : own) refs.push_back(o.ref);
  Columns columns = likelihood.derivatives(fit.hypothesis, fit.calibration, refs);
  for (Eigen::Index j = 0; j < columns.cols(); ++j) columns.col(j) *= own[static_cast<std::size_t>(j)].sigma;
  return columns;
}

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
  return with_prior(fit.covariance, prior_precision(likelihood, fit), all);
}

void include_model_error(const LikelihoodModel& likelihood, HypothesisFit& fit) {
  const std::vector<ParameterRef> sought = fit.hypothesis.sought();
  if (sought.empty() || !fit.covariance.allFinite()) return;
  fit.covariance = block_covariance(likelihood, fit);
  for (std::size_t j = 0; j < sought.size(); ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    fit.hypothesis.settings[sought[j].setting].deviation[sought[j].parameter] = std::sqrt(fit.covariance(k, k));
  }
}

}  // namespace bms::diagnosis
