#include "diagnosis/adequacy.hpp"

#include <algorithm>

#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Adequacy& adequacy_limits = thresholds.adequacy;

double gained(const Adequacy& a) { return a.control_cost - a.best_cost; }

/// Sum of squares of the checks of instruments.
double of_checks(const LikelihoodModel& likelihood, const HypothesisFit& fit) {
  return fit.residual.tail(static_cast<Eigen::Index>(likelihood.samples() - likelihood.readings())).squaredNorm();
}

/// Share of the voltage's misfit that is explained. What a check gains says nothing of it.
double share_of_misfit(const Adequacy& a, double gain_of_checks) {
  const double gain = std::max(gained(a) - gain_of_checks, 0.0);
  return gain + a.residual.gain > 0 ? gain / (gain + a.residual.gain) : 1;
}

/// Returns true if the residual has something that noise does not have.
bool is_unusual(const Adequacy& a) {
  return a.residual.gain > adequacy_limits.unexplained || a.residual.far_out > adequacy_limits.far_out;
}

bool is_unknown(const Adequacy& a, const Hypothesis& best) {
  if (!is_unusual(a)) return false;
  // what is flexible gains on anything: if it is named, its residual must be white
  const double enough =
      best.find(Signature::contact_bursts) != nullptr ? adequacy_limits.explained_by_bursts : adequacy_limits.explained;
  return !a.found || a.explained < enough;
}

}  // namespace

Adequacy judge(LikelihoodModel& likelihood, const NoiseModel& nominal, const HypothesisFit& control,
               Survivors& survivors) {
  likelihood.set_noise(nominal);
  const int iterations = numerics.fit.nominal_iterations;
  const HypothesisFit control_fit = likelihood.fit(control.hypothesis, control.calibration, iterations),
                      best_fit = likelihood.fit(survivors.best.hypothesis, survivors.best.calibration, iterations);
  Adequacy a{control_fit.cost, best_fit.cost, test_residual(likelihood, best_fit)};
  a.explained = share_of_misfit(a, of_checks(likelihood, control_fit) - of_checks(likelihood, best_fit));
  // what explains little, and that incompletely, is not a cause, unless nothing else makes the recording explained
  if (!survivors.best.hypothesis.added().empty() && gained(a) < thresholds.decision.faint &&
      a.explained < adequacy_limits.explained) {
    Adequacy without{control_fit.cost, control_fit.cost, test_residual(likelihood, control_fit)};
    without.explained = share_of_misfit(without, 0);
    if (is_unusual(a) || !is_unusual(without)) {
      survivors = {control, {}, {}, {}};
      a = without;
    }
  }
  a.found = !survivors.best.hypothesis.added().empty();
  if (a.found) a.only_place = only_place(likelihood, control_fit, best_fit);
  likelihood.set_noise(survivors.best.noise);
  a.unknown = is_unknown(a, survivors.best.hypothesis);
  return a;
}

}  // namespace bms::diagnosis
