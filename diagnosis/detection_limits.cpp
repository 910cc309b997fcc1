#include "diagnosis/detection_limits.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/screen.hpp"
#include "diagnosis/search.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

bool is_reachable(const DetectionLimit& limit, double capacity_ah) {
  const model::Parameter& p = model::catalogue[limit.mechanism].parameter[limit.parameter];
  return limit.value <= std::max(std::abs(p.lower(capacity_ah)), std::abs(p.upper(capacity_ah)));
}

}  // namespace

std::vector<StrengthSigma> strength_sigmas(LikelihoodModel& likelihood, const NoiseModel& nominal,
                                           const HypothesisFit& control, const Scope& scope) {
  likelihood.set_noise(nominal);
  const Screen screen(likelihood, control, scope.searched);
  std::vector<StrengthSigma> sigmas;
  for (const Candidate& c : screen.candidates()) {
    if (c.least_sigma > 0) sigmas.push_back({c.mechanism, c.least_sigma});
  }
  return sigmas;
}

double needed_gain(const ResidualTest& left) {
  const double share = thresholds.adequacy.explained;
  return std::clamp(share / (1 - share) * left.gain, thresholds.decision.detected, thresholds.decision.faint);
}

std::vector<DetectionLimit> limits_of(const std::vector<StrengthSigma>& sigmas, const ResidualTest& left,
                                      double capacity_ah, const HealthyGain& healthy) {
  std::vector<DetectionLimit> limits;
  const double decision = needed_gain(left);
  for (const StrengthSigma& s : sigmas) {
    double needed = decision + price_of_unknowns(s.mechanism);
    if (healthy) {
      const std::optional<double> to_stand_out = healthy(s.mechanism);
      if (!to_stand_out) continue;
      needed = std::max(needed, *to_stand_out);
    }
    const DetectionLimit limit{s.mechanism, 0, s.sigma * (std::sqrt(needed) + thresholds.screening.limit_margin)};
    if (is_reachable(limit, capacity_ah)) limits.push_back(limit);
  }
  return limits;
}

}  // namespace bms::diagnosis
