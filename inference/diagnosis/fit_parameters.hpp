// The estimated parameters of a hypothesis as a fit moves them: shapes by their logarithm, all others linearly; their
// bounds and priors.
#pragma once

#include <utility>
#include <vector>

#include <Eigen/Core>

#include "diagnosis/hypothesis.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis {

/// Distance of a parameter from what is known of most cells, in standard deviations, and the standard deviation;
/// sigma 0: nothing is known.
struct PriorDistance {
  double away = 0, sigma = 0;
};

class FitParameters {
 public:
  FitParameters(const model::CellParameters<>& cell, const Hypothesis& start);

  Eigen::Index size() const { return static_cast<Eigen::Index>(parameters_.size()); }
  const std::vector<ParameterRef>& sought() const { return sought_; }
  /// Value of parameter j in a hypothesis.
  double& of(Hypothesis& h, Eigen::Index j) const {
    const ParameterRef& s = sought_[static_cast<std::size_t>(j)];
    return h.settings[s.setting].value[s.parameter];
  }
  double of(const Hypothesis& h, Eigen::Index j) const {
    const ParameterRef& s = sought_[static_cast<std::size_t>(j)];
    return h.settings[s.setting].value[s.parameter];
  }

  bool is_shape(Eigen::Index j) const { return at(j).parameter->role == model::Role::shape; }
  double clamped(Eigen::Index j, double v) const;
  /// d v / d step.
  double natural(Eigen::Index j, double v) const;
  /// The value after a step, within its bounds.
  double moved(Eigen::Index j, double v, double step) const;
  /// Steps to the lower and upper bound; a shape goes no farther than numerics.fit.shape_step at once.
  std::pair<double, double> room(Eigen::Index j, double v) const;
  bool at_bound(Eigen::Index j, double v) const;

  /// Of a shape in its logarithm.
  PriorDistance prior_distance(Eigen::Index j, double v) const;
  /// Standard deviation of what is known of a parameter at a value v, in its unit; 0: nothing. That large strengths are
  /// rare is not counted: it says little of which one it is.
  double known_within(Eigen::Index j, double v) const;
  /// -2 log prior of all.
  double prior(const Hypothesis& h) const;

 private:
  struct Parameter {
    const model::Parameter* parameter;
    Bounds bounds;
    Usual usual;
  };
  const Parameter& at(Eigen::Index j) const { return parameters_[static_cast<std::size_t>(j)]; }

  double capacity_ah_;
  std::vector<ParameterRef> sought_;
  std::vector<Parameter> parameters_;
};

}  // namespace bms::diagnosis
