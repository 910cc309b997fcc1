#include "diagnosis/selection.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "diagnosis/block_covariance.hpp"
#include "diagnosis/credibility.hpp"
#include "diagnosis/locate.hpp"
#include "diagnosis/testability.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Decision& selection_limits = thresholds.decision;

bool is_intermittent(std::size_t mechanism) { return knowledge_of(mechanism).signature == Signature::contact_bursts; }

/// Largest factor by which the variance of one of a mechanism's strengths is wider with the error of the model.
double widening(const Hypothesis& narrow, const Hypothesis& wide, std::size_t mechanism) {
  double most = 1;
  for (const ParameterRef& p : narrow.sought()) {
    const double was = narrow.settings[p.setting].deviation[p.parameter],
                 is = wide.settings[p.setting].deviation[p.parameter];
    if (narrow.settings[p.setting].index == mechanism && was > 0 && std::isfinite(is))
      most = std::max(most, is / was * (is / was));
  }
  return most;
}

/// The other mechanism whose strength is correlated most with this one's; no_mechanism if none is by much.
std::size_t partner_of(const HypothesisFit& f, std::size_t mechanism) {
  const std::vector<ParameterRef> sought = f.hypothesis.sought();
  double most = selection_limits.trades;
  std::size_t partner = no_mechanism;
  const auto index = [&](std::size_t j) { return f.hypothesis.settings[sought[j].setting].index; };
  for (std::size_t a = 0; a < sought.size(); ++a) {
    for (std::size_t b = 0; b < sought.size(); ++b) {
      if (index(a) != mechanism || index(b) == mechanism) continue;
      const auto i = static_cast<Eigen::Index>(a), j = static_cast<Eigen::Index>(b);
      const double c = std::abs(f.covariance(i, j)) / std::sqrt(f.covariance(i, i) * f.covariance(j, j));
      if (!(c > most)) continue;
      most = c;
      partner = index(b);
    }
  }
  return partner;
}

/// What decides which mechanism goes first.
using CertainAndGain = std::pair<bool, double>;

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

  /// Returns true if the best hypothesis has changed: then everything is compared again. What is not needed goes before
  /// the rest is compared with rivals.
  bool round() {
    if (search_.stopped() || found_.best.hypothesis.added().empty()) return false;
    found_.rivals.clear();
    found_.gains.clear();
    found_.best = search_.converged(found_.best);
    const std::map<std::size_t, double> rms_v = contributions(likelihood_, control_, found_.best).rms_v;
    const double all_gain = search_.gain(control_, found_.best);
    const bool alone = found_.best.hypothesis.added().size() == 1;
    std::map<std::size_t, HypothesisFit> without;
    if (alone)
      without[found_.best.hypothesis.added().front()] = control_;
    else
      without = search_.without_each(found_.best);
    for (const std::size_t m : found_.best.hypothesis.added()) {
      found_.gains[m] = search_.gain(without[m], found_.best);
      if (found_.gains[m] < 0 && begins_better(m, without[m])) return true;
    }
    const std::size_t needless =
        weakest_removable(found_.best.hypothesis.added(), [&](std::size_t m) -> std::optional<CertainAndGain> {
          const double gain = found_.gains[m];
          const bool needed =
              gain >= selection_limits.detected && is_credible(found_.best, m) &&
              (alone || (is_seen(gain, all_gain, rms_v.at(m)) && !is_within_wander(m, without[m], rms_v)));
          if (needed) return std::nullopt;
          return CertainAndGain(scope_.expected.contains(m), gain);
        });
    if (needless != no_mechanism) {
      found_.best = std::move(without[needless]);
      return true;
    }
    for (const auto& [m, rest] : without) {
      if (compare_with_rivals(m, rest)) return true;
    }
    for (const auto& [m, rest] : without) found_.gains[m] = search_.gain(rest, found_.best);
    return false;
  }

  /// Returns true if something that was fitted on the way is better with as many causes or fewer, credible, and has
  /// what is certain: what was dropped last had taken its place. That has become the best. Each cause more must gain
  /// what is needed to be found, also over fewer that are others: two at their bounds do what one does well.
  bool resume() {
    const std::size_t most = std::max<std::size_t>(found_.best.hypothesis.added().size(), 1);
    const double now = burdened(found_.best);
    const HypothesisFit* better = nullptr;
    for (const auto& known : search_.best_of_each()) {
      const std::vector<std::size_t>& mechanisms = known.first;
      const HypothesisFit& fit = known.second;
      const bool allowed =
          keeps_certain(fit) && std::all_of(mechanisms.begin(), mechanisms.end(), [&](std::size_t m) {
            return std::find(scope_.searched.begin(), scope_.searched.end(), m) != scope_.searched.end() &&
                   is_credible(fit, m);
          });
      const double margin = mechanisms.size() == found_.best.hypothesis.added().size() ? selection_limits.detected : 0;
      const bool least = better == nullptr || burdened(fit) < burdened(*better);
      if (allowed && mechanisms.size() <= most && burdened(fit) < now - margin && least) better = &fit;
    }
    if (better == nullptr) return false;
    found_ = {*better, {}, {}, {}};
    return true;
  }

  /// Ends with mechanisms that may stay.
  void finish() {
    int starts = 0;
    while (drop_one_not_credible() || (starts++ < numerics.search.elimination_rounds && begin_better())) {
    }
  }

  Survivors survivors() && {
    for (const std::size_t m : found_.best.hypothesis.added()) {
      if (!found_.gains.contains(m)) found_.gains[m] = search_.gain(search_.without_one(found_.best, m), found_.best);
    }
    return std::move(found_);
  }

 private:
  /// Score with what each cause must gain to be found: the smaller the better.
  double burdened(const HypothesisFit& f) {
    return search_.score(f) + selection_limits.detected * static_cast<double>(f.hypothesis.added().size());
  }

  /// Returns true if it has what is certain in most of the recording and the best has.
  bool keeps_certain(const HypothesisFit& f) const {
    return std::all_of(scope_.kept.begin(), scope_.kept.end(), [&](std::size_t m) {
      return found_.best.hypothesis.find(m) == nullptr || f.hypothesis.find(m) != nullptr;
    });
  }

  /// A mechanism known a priori may still have a poorly determined size: then its standard deviation says so.
  bool is_credible(const HypothesisFit& f, std::size_t m) const {
    return scope_.expected.contains(m) ||
           (!is_weak(f, m, scope_.expected) && !is_implausible(f, m, likelihood_.facts()) &&
            !(likelihood_.facts().one_current && is_at_the_end(f, m, likelihood_.records())));
  }

  /// The rounds are limited, and end with mechanisms that may not stay: those without a strength of their own. Of two
  /// that cancel each other one stays, with the other as its rival: the recordings know their sum alone. Returns false
  /// if all may stay.
  bool drop_one_not_credible() {
    const std::vector<std::size_t> added = found_.best.hypothesis.added();
    const std::map<std::size_t, double> rms_v = contributions(likelihood_, control_, found_.best).rms_v;
    const std::size_t worst = weakest_removable(added, [&](std::size_t m) -> std::optional<double> {
      if (is_credible(found_.best, m)) return std::nullopt;
      return -rms_v.at(m);
    });
    if (worst == no_mechanism) return false;
    const std::size_t partner = partner_of(found_.best, worst);
    HypothesisFit without = added.size() == 1 ? control_ : search_.without_one(found_.best, worst);
    found_.rivals.clear();
    found_.gains.clear();
    if (partner != no_mechanism) {
      HypothesisFit swapped = search_.without_one(found_.best, partner);
      const bool swap = scope_.expected.contains(worst) != scope_.expected.contains(partner)
                            ? scope_.expected.contains(worst)
                            : search_.score(swapped) < search_.score(without);
      const std::size_t kept = swap ? worst : partner, other = swap ? partner : worst;
      if (swap) std::swap(swapped, without);
      found_.rivals[kept].push_back(std::move(swapped));
      found_.alike[{kept, other}] = 1;
    }
    found_.best = std::move(without);
    return true;
  }

  /// One of several mechanisms must be seen.
  bool is_seen(double gain, double all_gain, double rms_v) const {
    return rms_v >= selection_limits.noticeable * error_v_ || gain >= selection_limits.noticeable_gain * all_gain;
  }

  /// Returns true for a contact, or what is not distinguished from one at one current.
  static bool could_be_contact(std::size_t m) {
    return m == model::mechanism_index_of<model::ContactStep> ||
           m == model::mechanism_index_of<model::ResistanceGrowth>;
  }

  /// Returns true if what a slow cause explains next to a contact, at one current, is no more than it may wander.
  bool is_within_wander(std::size_t m, const HypothesisFit& without, const std::map<std::size_t, double>& rms_v) const {
    if (!likelihood_.facts().one_current || scope_.expected.contains(m) || could_be_contact(m) || is_intermittent(m) ||
        model::catalogue[m].domain != model::Domain::physics)
      return false;
    double resistance_v = 0;
    for (const auto& [other, v] : rms_v) resistance_v = std::max(resistance_v, could_be_contact(other) ? v : 0);
    return fitted_error_v(likelihood_, without) <
           std::hypot(fitted_error_v(likelihood_, found_.best), selection_limits.contact_wander * resistance_v);
  }

  /// begins_better() for each mechanism whose gain is not known.
  bool begin_better() {
    const std::vector<std::size_t> added = found_.best.hypothesis.added();
    if (added.size() < 2) return false;
    for (const std::size_t m : added) {
      if (found_.gains.contains(m)) continue;
      const HypothesisFit without = search_.without_one(found_.best, m);
      found_.gains[m] = search_.gain(without, found_.best);
      if (found_.gains[m] < 0 && begins_better(m, without)) {
        found_.gains.clear();
        return true;
      }
    }
    return false;
  }

  /// A hypothesis with less that is better: the fit with more has ended in a minimum of its own. Returns true if it is
  /// better from there, and has become the best.
  bool begins_better(std::size_t m, const HypothesisFit& without) {
    const std::vector<HypothesisFit> again = search_.one_more(without, {m});
    if (again.empty() || search_.score(again.front()) > search_.score(found_.best) - selection_limits.better_start)
      return false;
    found_.best = again.front();
    return true;
  }

  /// Returns true if a rival, or the same mechanisms from another start by what matters, has become the best.
  bool compare_with_rivals(std::size_t m, const HypothesisFit& without) {
    HypothesisFit& best = found_.best;
    bool changed = false;
    std::map<std::size_t, double> likeness;
    const Search::Replacement replacement{m, best, without, found_.gains[m]};
    for (HypothesisFit& rival : search_.in_place_of(replacement, scope_.searched, likeness)) {
      const bool same_mechanisms = rival.hypothesis.find(m) != nullptr;
      if (!search_.improves_lasting_error(without, rival)) continue;
      const double ahead = same_mechanisms ? selection_limits.better_start : selection_limits.better_rival;
      const std::vector<std::size_t> added = rival.hypothesis.added();
      const bool replaceable =
          same_mechanisms || (!scope_.expected.contains(m) && std::all_of(added.begin(), added.end(), [&](auto other) {
            return best.hypothesis.find(other) != nullptr || is_credible(rival, other);
          }));
      const double better_by = search_.score(best) - search_.score(rival);
      if (replaceable && better_by > ahead) {
        best = rival;
        // minima of the same mechanisms lie side by side where a hysteresis turns round: what is compared stays as it
        // is
        changed = changed || !same_mechanisms || better_by > numerics.search.another_minimum;
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
  RecordingFacts mostly = likelihood.facts();
  mostly.away_k = mostly.mostly_away_k;
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    if (knowledge_of(m).only_a_term) continue;
    if (const auto reason = not_testable(likelihood, base, m)) scope.not_testable.push_back({m, *reason});
    if (base.find(m) != nullptr) continue;
    scope.searched.push_back(m);
    if (knowledge_of(m).expected(likelihood.cell(), likelihood.facts())) scope.expected.insert(m);
    if (knowledge_of(m).expected(likelihood.cell(), mostly)) scope.kept.insert(m);
  }
  return scope;
}

Grown grow(Search& search, const HypothesisFit& control, const Scope& scope, std::size_t most) {
  Grown grown{control, {}, {}};
  HypothesisFit& current = grown.fit;
  std::vector<std::size_t> steady = scope.searched;
  std::erase_if(steady, is_intermittent);
  // each cause alone, also without what is certain beforehand: with a strength that nothing limits, that one may take
  // the place of any other
  grown.singles = search.one_more(control, steady);
  for (const std::size_t m : scope.expected) {
    const std::vector<HypothesisFit> fits = search.one_more(current, {m});
    if (fits.empty()) continue;
    const double gain = grown.gains[m] = search.gain(current, fits.front());
    if (gain > selection_limits.detected) current = fits.front();
  }
  bool all = false;
  while (current.hypothesis.added().size() < most && !search.stopped()) {
    const bool alone = current.hypothesis.added().empty();
    std::vector<HypothesisFit> fits =
        alone && !all ? grown.singles : search.one_more(current, all ? scope.searched : steady);
    if (alone && all) grown.singles.insert(grown.singles.end(), fits.begin(), fits.end());
    std::erase_if(fits, [&](const HypothesisFit& f) { return !search.improves_lasting_error(current, f); });
    for (const HypothesisFit& f : fits) {
      double& gain = grown.gains[f.hypothesis.settings.back().index];
      gain = std::max(gain, search.gain(current, f));
    }
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
  int resumed = 0;
  do {
    for (int round = 0; round < numerics.search.elimination_rounds && elimination.round(); ++round) {
    }
    elimination.finish();
  } while (resumed++ < numerics.search.elimination_resumed && elimination.resume());
  return std::move(elimination).survivors();
}

Survivors without_one(Search& search, const HypothesisFit& control, const Survivors& found, std::size_t mechanism) {
  const auto reduced = [&](const HypothesisFit& f, std::size_t m) {
    return f.hypothesis.added().size() == 1 ? control : search.without_one(f, m);
  };
  Survivors rest{reduced(found.best, mechanism), {}, {}, {}};
  for (const std::size_t m : rest.best.hypothesis.added())
    rest.gains[m] = search.gain(reduced(rest.best, m), rest.best);
  return rest;
}

Survivors without_uncertain(Search& search, LikelihoodModel& likelihood, const HypothesisFit& control,
                            const Scope& scope, Survivors found) {
  for (;;) {
    likelihood.set_noise(found.best.noise);
    HypothesisFit with_error = found.best;
    include_model_error(likelihood, with_error);
    const std::size_t weakest =
        weakest_removable(with_error.hypothesis.added(), [&](std::size_t m) -> std::optional<double> {
          if (scope.expected.contains(m) || !is_uncertain(with_error, m, scope.expected)) return std::nullopt;
          // far from an ellipse the deviations say less than the gain, which the error of the model makes too large
          const double too_large = widening(found.best.hypothesis, with_error.hypothesis, m);
          if (found.gains[m] > selection_limits.own_sigmas * selection_limits.own_sigmas * too_large)
            return std::nullopt;
          return found.gains[m];
        });
    if (weakest == no_mechanism) return found;
    found = without_one(search, control, found, weakest);
  }
}

}  // namespace bms::diagnosis
