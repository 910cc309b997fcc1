#include "diagnosis/detection_limits.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/numerics.hpp"
#include "diagnosis/screen.hpp"
#include "diagnosis/search.hpp"
#include "diagnosis/thresholds.hpp"
#include "numerics/in_parallel.hpp"

namespace bms::diagnosis {

namespace {

bool is_reachable(const DetectionLimit& limit, double capacity_ah) {
  const model::Parameter& p = model::catalogue[limit.mechanism].parameter[limit.parameter];
  return thresholds.screening.limits_in_bounds * limit.value <=
         std::max(std::abs(p.lower(capacity_ah)), std::abs(p.upper(capacity_ah)));
}

/// The smallest size with this gain, by ever larger ones; what is not reachable as it is.
double size_with(double needed, DetectionLimit limit, const StrengthSigma& s, double capacity_ah,
                 const GainOfSize& gain) {
  const double margin = thresholds.screening.limit_margin * s.sigma;
  while (is_reachable(limit, capacity_ah) && gain(s, limit.value - margin) < needed)
    limit.value *= numerics.search.limit_step;
  return limit.value;
}

}  // namespace

std::vector<StrengthSigma> strength_sigmas(LikelihoodModel& likelihood, const NoiseModel& nominal,
                                           const HypothesisFit& control, const Scope& scope) {
  likelihood.set_noise(nominal);
  const Screen screen(likelihood, control, scope.searched);
  std::vector<StrengthSigma> sigmas;
  const PreparedRecording& first = likelihood.records().front();
  for (const Candidate& c : screen.candidates()) {
    if (!(c.least_sigma > 0)) continue;
    StrengthSigma& s = sigmas.emplace_back(StrengthSigma{c.mechanism, c.least_sigma, c.start});
    // a contact that changes at the end is hardly seen, whatever its size
    if (knowledge_of(c.mechanism).signature == Signature::contact_change)
      s.start.value[contact_onset] = (first.time_s.front() + first.time_s.back()) / 2;
  }
  return sigmas;
}

double needed_gain(const ResidualTest& left) {
  const double share = thresholds.adequacy.explained;
  return std::clamp(share / (1 - share) * left.gain, thresholds.decision.detected, thresholds.decision.faint);
}

std::vector<DetectionLimit> limits_of(const std::vector<StrengthSigma>& sigmas, const ResidualTest& left,
                                      double capacity_ah, const HealthyGain& healthy, const GainOfSize& gain) {
  std::vector<DetectionLimit> all(sigmas.size());
  const double decision = needed_gain(left);
  numerics::in_parallel(sigmas.size(), [&](std::size_t k) {
    const StrengthSigma& s = sigmas[k];
    double needed = decision + price_of_unknowns(s.mechanism);
    if (healthy) {
      const std::optional<double> to_stand_out = healthy(s.mechanism);
      needed = std::max(needed, to_stand_out.value_or(std::numeric_limits<double>::infinity()));
    }
    all[k] = {s.mechanism, 0, s.sigma * (std::sqrt(needed) + thresholds.screening.limit_margin)};
    if (gain) all[k].value = size_with(needed, all[k], s, capacity_ah, gain);
  });
  std::erase_if(all, [&](const DetectionLimit& limit) { return !is_reachable(limit, capacity_ah); });
  return all;
}

std::vector<std::size_t> not_visible(const Diagnosis& d) {
  std::vector<std::size_t> hidden;
  if (d.verdict == Verdict::data_fault || d.verdict == Verdict::unfinished) return hidden;
  const auto has = [](const auto& list, std::size_t m) {
    return std::any_of(list.begin(), list.end(), [m](const auto& entry) { return entry.mechanism == m; });
  };
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    const MechanismKnowledge& knowledge = knowledge_of(m);
    if (knowledge.only_a_term || knowledge.signature == Signature::contact_bursts) continue;
    if (d.extended.find(m) == nullptr && !has(d.not_testable, m) && !has(d.limits, m)) hidden.push_back(m);
  }
  return hidden;
}

}  // namespace bms::diagnosis
