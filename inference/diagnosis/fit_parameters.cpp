#include "diagnosis/fit_parameters.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/numerics.hpp"
#include "diagnosis/thresholds.hpp"
#include "model/cell.hpp"

namespace bms::diagnosis {

namespace {

/// Beyond priors.tail standard deviations what is rare costs as much more as its logarithm, not as its square: a
/// divider that is wrong by half must be found with its size, and not be pulled to what is common.
PriorDistance with_tail(PriorDistance d) {
  const double tail = thresholds.priors.tail, size = std::abs(d.away);
  if (size <= tail) return d;
  const double away = tail * std::sqrt(1 + 2 * std::log(size / tail));
  return {std::copysign(away, d.away), d.sigma * away * size / (tail * tail)};  // sigma: 1 / (d away / d value)
}

}  // namespace

FitParameters::FitParameters(const model::CellParameters<>& cell, const Hypothesis& start)
    : capacity_ah_(cell.capacity_ah), sought_(start.sought()) {
  const double rc_s = model::cell_detail::rc_value(cell.rc, cell.rc.r1_ohm, numerics.middle_soc) *
                      model::cell_detail::rc_value(cell.rc, cell.rc.c1_f, numerics.middle_soc);
  for (const ParameterRef& s : sought_) {
    const std::size_t mechanism = start.settings[s.setting].index;
    const model::Parameter& p = model::catalogue[mechanism].parameter[s.parameter];
    const Bounds file{p.lower(capacity_ah_), p.upper(capacity_ah_)};
    const auto known = knowledge_of(mechanism).known(s.parameter, start.settings[s.setting], cell);
    parameters_.push_back(
        {&p, knowledge_of(mechanism).bounds(s.parameter, file, rc_s), known.value_or(Usual{p.typical, p.spread})});
  }
}

double FitParameters::clamped(Eigen::Index j, double v) const {
  return std::clamp(v, at(j).bounds.low, at(j).bounds.high);
}

double FitParameters::natural(Eigen::Index j, double v) const {
  return is_shape(j) ? v : (at(j).bounds.high - at(j).bounds.low) / numerics.fit.linear_steps;
}

double FitParameters::moved(Eigen::Index j, double v, double step) const {
  return clamped(j, is_shape(j) ? v * std::exp(step) : v + natural(j, v) * step);
}

std::pair<double, double> FitParameters::room(Eigen::Index j, double v) const {
  const auto [low, high] = at(j).bounds;
  const double shape_step = numerics.fit.shape_step;
  if (is_shape(j)) return {std::max(std::log(low / v), -shape_step), std::min(std::log(high / v), shape_step)};
  return {(low - v) / natural(j, v), (high - v) / natural(j, v)};
}

bool FitParameters::at_bound(Eigen::Index j, double v) const {
  const auto [low, high] = at(j).bounds;
  const double reach = numerics.fit.bound_reach * (high - low);
  return v <= low + reach || v >= high - reach;
}

PriorDistance FitParameters::prior_distance(Eigen::Index j, double v) const {
  const model::Parameter& p = *at(j).parameter;
  const double log_sigma = thresholds.priors.log_sigma;
  if (is_shape(j)) return {std::log(v / p.default_value(capacity_ah_)) / log_sigma, log_sigma};
  if (const Usual& usual = at(j).usual; usual.spread > 0) return {(v - usual.typical) / usual.spread, usual.spread};
  const double common = p.common(capacity_ah_);
  if (common <= 0 || std::abs(v) <= common) return {};
  const double sigma = thresholds.priors.rarity * common;
  return with_tail({(v - std::copysign(common, v)) / sigma, sigma});
}

double FitParameters::known_within(Eigen::Index j, double v) const {
  return is_shape(j) ? thresholds.priors.log_sigma * v : at(j).usual.spread;
}

double FitParameters::prior(const Hypothesis& h) const {
  double sum = 0;
  for (Eigen::Index j = 0; j < size(); ++j) sum += std::pow(prior_distance(j, of(h, j)).away, 2);
  return sum;
}

}  // namespace bms::diagnosis
