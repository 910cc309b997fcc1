#include "diagnosis/findings.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Decision& finding_limits = thresholds.decision;
constexpr const Thresholds::Probability& probability_limits = thresholds.probability;

/// A rival that cannot be distinguished from a finding.
struct Equivalent {
  double behind;
  std::size_t mechanism;
  const HypothesisFit* fit;
};

/// The mechanism that a rival has in the place of m.
std::size_t replacement_of(std::size_t m, const Hypothesis& rival, const Hypothesis& best) {
  std::size_t other = m;
  for (const std::size_t a : rival.added()) {
    if (best.find(a) == nullptr) other = a;
  }
  return other;
}

/// times: model_error_times() of the mechanism.
Finding finding_of(Search& search, const Survivors& survivors, std::size_t m, double times) {
  const HypothesisFit& best = survivors.best;
  Finding f;
  f.setting = *best.hypothesis.find(m);
  f.gain = survivors.gains.at(m);
  f.at_bound.assign(model::catalogue[m].parameters, 0);
  const std::vector<ParameterRef> sought = best.hypothesis.sought();
  for (std::size_t j = 0; j < sought.size(); ++j) {
    if (best.hypothesis.settings[sought[j].setting].index == m) f.at_bound[sought[j].parameter] = best.at_bound[j];
  }
  double weights = 1;
  std::vector<Equivalent> equivalents;
  const auto rivals = survivors.rivals.find(m);
  const std::span<const HypothesisFit> fits = rivals != survivors.rivals.end()
                                                  ? std::span<const HypothesisFit>(rivals->second)
                                                  : std::span<const HypothesisFit>();
  for (const HypothesisFit& rival : fits) {
    const double behind = (search.score(rival) - search.score(best)) / times;
    const std::size_t other = replacement_of(m, rival.hypothesis, best.hypothesis);
    weights += weight_behind(behind);
    const auto alike = survivors.alike.find({m, other});
    const bool inseparable = alike != survivors.alike.end() && alike->second > finding_limits.inseparable;
    if (behind < (inseparable ? finding_limits.tie_inseparable : finding_limits.tie))
      equivalents.push_back({behind, other, &rival});
  }
  std::sort(equivalents.begin(), equivalents.end(), [](const Equivalent& a, const Equivalent& b) {
    return std::pair(a.behind, a.mechanism) < std::pair(b.behind, b.mechanism);
  });
  for (const Equivalent& e : equivalents) {
    if (std::find(f.equivalent_to.begin(), f.equivalent_to.end(), e.mechanism) != f.equivalent_to.end()) continue;
    f.equivalent_to.push_back(e.mechanism);
    f.rivals.push_back({e.fit->hypothesis, e.fit->covariance});
  }
  f.probability = probability_limits.at_most / weights;
  return f;
}

}  // namespace

double model_error_times(const HealthyGain& healthy_gain, std::size_t mechanism) {
  return healthy_gain ? std::max(healthy_gain(mechanism).value_or(0) / finding_limits.detected, 1.0) : 1;
}

double weight_behind(double behind) { return std::exp(-behind / (2 * probability_limits.temper)); }

std::vector<Finding> findings_of(Search& search, const Survivors& survivors, const Contributions& contributed,
                                 const HealthyGain& healthy_gain) {
  std::vector<Finding> findings;
  for (const std::size_t m : survivors.best.hypothesis.added()) {
    Finding& f = findings.emplace_back(finding_of(search, survivors, m, model_error_times(healthy_gain, m)));
    if (contributed.rms_v.contains(m)) f.rms_contribution_v = contributed.rms_v.at(m);
  }
  std::stable_sort(findings.begin(), findings.end(),
                   [](const Finding& a, const Finding& b) { return a.gain > b.gain; });
  return findings;
}

std::vector<Ranked> ranking_of(Search& search, const LikelihoodModel& likelihood, const HypothesisFit& control,
                               const Grown& grown, Survivors& survivors, double file_v) {
  const bool found = !survivors.best.hypothesis.added().empty();
  std::vector<Ranked> ranking;
  const auto rank = [&](const HypothesisFit& f) {
    const std::vector<std::size_t> ids = f.hypothesis.added();
    if (std::any_of(ranking.begin(), ranking.end(), [&](const Ranked& r) { return r.ids == ids; }))
      return;  // the same from another start
    const Contributions c = contributions(likelihood, control, f);
    const double share =
        found ? explained_share(file_v, c.remaining_rmse_v, search.nominal_noise().white_v) : c.explained_share;
    ranking.push_back({ids, 0, search.score(control) - search.score(f), share});
  };
  if (found) {
    rank(survivors.best);
    for (auto& [m, fits] : survivors.rivals) {
      std::stable_sort(fits.begin(), fits.end(), [&](const HypothesisFit& a, const HypothesisFit& b) {
        return search.score(a) < search.score(b);
      });
      for (const HypothesisFit& f : fits) rank(f);
    }
  } else {
    for (const HypothesisFit& f : grown.singles) rank(f);
  }
  std::stable_sort(ranking.begin(), ranking.end(), [](const Ranked& a, const Ranked& b) { return a.gain > b.gain; });
  const double no_mechanism = found ? -std::numeric_limits<double>::infinity() : finding_limits.detected;
  const double best_gain = ranking.empty() ? no_mechanism : std::max(ranking.front().gain, no_mechanism);
  double total = weight_behind(best_gain - no_mechanism);
  for (const Ranked& r : ranking) total += weight_behind(best_gain - r.gain);
  for (Ranked& r : ranking) r.probability = probability_limits.at_most * weight_behind(best_gain - r.gain) / total;
  return ranking;
}

}  // namespace bms::diagnosis
