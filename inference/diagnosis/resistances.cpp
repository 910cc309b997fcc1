#include "diagnosis/resistances.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>

#include "diagnosis/block_covariance.hpp"
#include "diagnosis/products.hpp"
#include "diagnosis/resistance_means.hpp"

namespace bms::diagnosis {

namespace {

/// Standard deviations by the joint covariance: the found parameters have that of the fit; what is left of the base
/// parameters if these are known is as uncertain as the pulls of blocks of time are, but not less than by their prior
/// and the noise.
class JointUncertainty {
 public:
  JointUncertainty(const LikelihoodModel& likelihood, const HypothesisFit& fit)
      : likelihood_(likelihood), fit_(fit), base_(base_columns(likelihood, fit)) {
    normal_.compute(squared(base_) + Eigen::MatrixXd::Identity(base_.cols(), base_.cols()));
    const Columns found = likelihood.derivatives(fit.hypothesis, fit.calibration, fit.hypothesis.sought());
    follow_ = normal_.solve(products(base_, found));
  }

  double std_ohm(const Quantity& q) const {
    const Eigen::VectorXd alone = normal_.solve(q.by_base);
    const Eigen::VectorXd pull = base_ * alone;
    double blocks = 0, pulls = 0;
    Eigen::Index first = 0;
    for (const PreparedRecording& r : likelihood_.records()) {
      for_each_block(r.size(), [&](Eigen::Index from, Eigen::Index count) {
        ++blocks;
        const double sum = pull.segment(first + from, count).dot(fit_.residual.segment(first + from, count));
        pulls += sum * sum;
      });
      first += static_cast<Eigen::Index>(r.size());
    }
    const double data = std::max(pull.squaredNorm(), pulls * blocks / (blocks - 1));
    const Eigen::VectorXd found = q.by_found - follow_.transpose() * q.by_base;
    return std::sqrt(data + alone.squaredNorm() + found.dot(fit_.covariance * found));
  }

 private:
  static Columns base_columns(const LikelihoodModel& likelihood, const HypothesisFit& fit) {
    const Columns base = likelihood.calibration_derivatives(fit.hypothesis, fit.calibration),
                  own = by_own_mechanisms(likelihood, fit);
    Columns both(base.rows(), base.cols() + own.cols());
    both << base, own;
    return both;
  }

  const LikelihoodModel& likelihood_;
  const HypothesisFit& fit_;
  Columns base_;  ///< by the base parameters and by the file's mechanisms
  Eigen::LDLT<Eigen::MatrixXd> normal_;
  Eigen::MatrixXd follow_;  ///< what the base parameters do if a found parameter moves
};

}  // namespace

void add_resistances(const LikelihoodModel& likelihood, const HypothesisFit& fit, Diagnosis& d) {
  const std::optional<Load> load = load_of(likelihood, fit);
  if (!load || !fit.covariance.allFinite()) return;
  const JointUncertainty uncertainty(likelihood, fit);
  const bool follow = resistances_follow_temperature(likelihood, fit);
  const auto mean = [&](bool reference, std::size_t without = no_mechanism) {
    return mean_resistances(likelihood, fit, *load, reference, without);
  };
  const auto stated = [&](std::string name, const Quantity& here, const Quantity& reference) {
    ResistanceAt r{std::move(name), {here.ohm, uncertainty.std_ohm(here)}, {}};
    if (follow) r.reference = {reference.ohm, uncertainty.std_ohm(reference)};
    return r;
  };
  const Resistances here = mean(false), reference = mean(true);
  d.resistances = CellResistances{load->temperature_c,
                                  likelihood.cell().reference_temperature_c,
                                  load->step_s,
                                  {stated("r0_ohm", here.r0, reference.r0), stated("r1_ohm", here.r1, reference.r1),
                                   stated("step_ohm", here.step, reference.step)}};
  for (Finding& f : d.findings) {
    const auto state = [&](std::string name, const Quantity& q, const Quantity& r) {
      if (q.ohm != 0 || r.ohm != 0) f.resistances.push_back(stated(std::move(name), q, r));
    };
    const Resistances less = mean(false, f.setting.index), reference_less = mean(true, f.setting.index);
    for (std::size_t k = 0; k < here.own.size(); ++k) {
      if (fit.hypothesis.settings[k].index == f.setting.index) state("resistance_ohm", here.own[k], reference.own[k]);
    }
    state("added_r0_ohm", here.r0 - less.r0, reference.r0 - reference_less.r0);
    state("added_r1_ohm", here.r1 - less.r1, reference.r1 - reference_less.r1);
  }
}

}  // namespace bms::diagnosis
