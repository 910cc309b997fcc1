#include "diagnosis/selection.hpp"

#include <algorithm>

#include "diagnosis/locate.hpp"
#include "diagnosis/testability.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Decision& selection_limits = thresholds.decision;

bool comes_and_goes(std::size_t mechanism) { return knowledge_of(mechanism).signature == Signature::contact_bursts; }

/// The elimination in progress.
class Elimination {
 public:
  Elimination(Search& search, const LikelihoodModel& likelihood, const HypothesisFit& control,
              const HypothesisFit& grown, const Scope& scope)
      : search_(search),
        likelihood_(likelihood),
        control_(control),
        scope_(scope),
        error_v_(plain_error_v(likelihood, likelihood.base())) {
    found_.best = grown;
  }

  /// Returns true if the best hypothesis has changed: then everything is compared again.
  bool round() {
    found_.rivals.clear();
    found_.gains.clear();
    const std::map<std::size_t, double> rms_v = contributions(likelihood_, control_, found_.best).rms_v;
    const double all_gain = search_.gain(control_, found_.best);
    std::vector<std::pair<double, HypothesisFit>> reduced;  // without those that are not needed, by their gain
    for (const std::size_t m : found_.best.hypothesis.added()) {
      const bool alone = found_.best.hypothesis.added().size() == 1;
      const HypothesisFit without = alone ? control_ : search_.without_one(found_.best, m);
      const double gain = found_.gains[m] = search_.gain(without, found_.best);
      if (gain < selection_limits.detected || !(alone || counts(gain, all_gain, rms_v.at(m))))
        reduced.emplace_back(gain, without);
      else if (compare_with_rivals(m, without))
        return true;
    }
    if (reduced.empty()) return false;
    std::sort(reduced.begin(), reduced.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    found_.best = reduced.front().second;
    return true;
  }

  Survivors survivors() && {
    for (const std::size_t m : found_.best.hypothesis.added()) {
      if (!found_.gains.contains(m)) found_.gains[m] = search_.gain(search_.without_one(found_.best, m), found_.best);
    }
    return std::move(found_);
  }

 private:
  /// One of several mechanisms must be seen, and must not be larger than the error: such ones cancel each other. Of
  /// these the one goes that is missed less.
  bool counts(double gain, double all_gain, double rms_v) const {
    const bool seen =
        rms_v >= selection_limits.noticeable * error_v_ || gain >= selection_limits.noticeable_gain * all_gain;
    return seen && rms_v <= selection_limits.larger_than_error * error_v_;
  }

  /// Returns true if a rival, or the same mechanisms from another start, has become the best.
  bool compare_with_rivals(std::size_t m, const HypothesisFit& without) {
    HypothesisFit& best = found_.best;
    bool changed = false;
    std::map<std::size_t, double> likeness;
    const Search::Replacement replacement{m, best, without, found_.gains[m]};
    for (HypothesisFit& rival : search_.in_place_of(replacement, scope_.searched, likeness)) {
      const bool same_mechanisms = rival.hypothesis.find(m) != nullptr;
      if (!search_.carries(without, rival)) continue;
      const double ahead = same_mechanisms ? selection_limits.better_start : selection_limits.better_rival;
      const bool replaceable = same_mechanisms || !scope_.expected.contains(m);
      if (replaceable && search_.score(rival) < search_.score(best) - ahead) {
        best = rival;
        changed = true;
      }
      if (!same_mechanisms) found_.rivals[m].push_back(std::move(rival));
    }
    for (const auto& [other, value] : likeness) found_.alike[{m, other}] = value;
    return changed;
  }

  Search& search_;
  const LikelihoodModel& likelihood_;
  const HypothesisFit& control_;
  const Scope& scope_;
  double error_v_;
  Survivors found_;  ///< its best is the current hypothesis
};

}  // namespace

Scope scope_of(const LikelihoodModel& likelihood) {
  Scope scope;
  const Hypothesis base = likelihood.base();
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    if (const auto reason = not_testable(likelihood, base, m)) scope.not_testable.push_back({m, *reason});
    if (base.find(m) != nullptr) continue;
    scope.searched.push_back(m);
    if (knowledge_of(m).expected(likelihood.cell(), likelihood.facts())) scope.expected.insert(m);
  }
  return scope;
}

Grown grow(Search& search, const HypothesisFit& control, const Scope& scope, std::size_t most) {
  Grown grown{control, {}};
  HypothesisFit& current = grown.fit;
  for (const std::size_t m : scope.expected) {
    const std::vector<HypothesisFit> fits = search.one_more(current, {m});
    if (!fits.empty() && search.gain(current, fits.front()) > selection_limits.detected) current = fits.front();
  }
  std::vector<std::size_t> steady = scope.searched;
  std::erase_if(steady, comes_and_goes);
  bool all = false;
  while (current.hypothesis.added().size() < most) {
    std::vector<HypothesisFit> fits = search.one_more(current, all ? scope.searched : steady);
    if (current.hypothesis.added().empty()) grown.singles.insert(grown.singles.end(), fits.begin(), fits.end());
    std::erase_if(fits, [&](const HypothesisFit& f) { return !search.carries(current, f); });
    const bool gains = !fits.empty() && search.gain(current, fits.front()) >= selection_limits.detected;
    if (gains)
      current = fits.front();
    else if (all)
      break;
    all = !gains;
  }
  return grown;
}

Survivors eliminate(Search& search, const LikelihoodModel& likelihood, const HypothesisFit& control,
                    const HypothesisFit& grown, const Scope& scope) {
  Elimination elimination(search, likelihood, control, grown, scope);
  for (int round = 0; round < numerics.search.elimination_rounds && elimination.round(); ++round) {
  }
  return std::move(elimination).survivors();
}

}  // namespace bms::diagnosis
