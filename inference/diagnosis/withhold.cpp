#include "diagnosis/withhold.hpp"

#include <algorithm>

#include "diagnosis/healthy_coverage.hpp"
#include "diagnosis/thresholds.hpp"
#include "diagnosis/true_current.hpp"

namespace bms::diagnosis {

namespace {

constexpr const HealthyThresholds& withhold_limits = thresholds.healthy;

std::string cause_of(std::size_t mechanism) {
  return std::string(mechanism == no_mechanism ? healthy_data::unknown_cause
                                               : std::string_view(model::catalogue[mechanism].id));
}

double total_duration_s(const std::vector<PreparedRecording>& records) {
  double sum_s = 0;
  for (const PreparedRecording& r : records) sum_s += r.duration_s();
  return sum_s;
}

bool is_of_current(std::size_t m) {
  return m == model::mechanism_index_of<model::CurrentGain> || m == model::mechanism_index_of<model::CurrentOffset>;
}

}  // namespace

double largest_error_v(const healthy_data::HealthyData& healthy) {
  double largest_v = 0;
  for (const healthy_data::HealthyBlock& b : healthy.blocks) largest_v = std::max(largest_v, b.error_v);
  return largest_v;
}

std::vector<MechanismGain> gains_of(const Grown& grown, const Survivors& survivors) {
  std::map<std::size_t, double> gains = grown.gains;
  for (const auto& [m, gain] : survivors.gains) gains[m] = std::max(gains[m], gain);
  std::vector<MechanismGain> list;
  for (const auto& [m, gain] : gains) {
    if (gain > 0) list.push_back({m, gain});
  }
  return list;
}

double unknown_gain(const ResidualTest& residual) {
  return thresholds.decision.detected * std::max({residual.gain / thresholds.adequacy.unexplained,
                                                  residual.far_out / thresholds.adequacy.far_out, 0.0});
}

bool healthy_decide(const HealthyNull& null, const HealthyCoverage& covered) {
  if (null.blocks() == 0) return false;
  return covered.share >= withhold_limits.covered_at_least || null.shows_a_cause();
}

HealthyJudge::HealthyJudge(Search& search, const LikelihoodModel& likelihood, const HypothesisFit& control,
                           const Scope& scope, const healthy_data::HealthyData& healthy, double false_alarm_rate)
    : search_(search),
      likelihood_(likelihood),
      control_(control),
      scope_(scope),
      healthy_(healthy),
      as_read_(coverage_of(likelihood.records(), healthy, likelihood.cell().capacity_ah)),
      basis_{healthy.hours(), healthy.recordings(), healthy.blocks.size(), false_alarm_rate, as_read_, true},
      null_(healthy, false_alarm_rate, total_duration_s(likelihood.records())) {}

bool HealthyJudge::is_covered() const { return basis_.covered.share >= withhold_limits.covered_at_least; }

HealthyComparison HealthyJudge::compare(std::size_t mechanism, double gain) const {
  return null_.compare(cause_of(mechanism), gain, basis_.covered.share);
}

Withheld HealthyJudge::withheld_of(std::size_t mechanism, const MechanismSetting& setting, double gain) const {
  const bool would_stand_out = null_.compare(cause_of(mechanism), gain).stands_out;
  return {mechanism, setting, gain, compare(mechanism, gain), would_stand_out};
}

std::optional<Withheld> HealthyJudge::least_of(const Survivors& found) const {
  using AlarmAndGain = std::pair<double, double>;
  const std::size_t least =
      weakest_removable(found.best.hypothesis.added(), [&](std::size_t m) -> std::optional<AlarmAndGain> {
        const HealthyComparison c = compare(m, found.gains.at(m));
        if (c.stands_out) return std::nullopt;
        return AlarmAndGain(-c.false_alarm, found.gains.at(m));
      });
  if (least == no_mechanism) return std::nullopt;
  return withheld_of(least, *found.best.hypothesis.find(least), found.gains.at(least));
}

HealthyCoverage HealthyJudge::covered_by(const HypothesisFit& fit) const {
  const std::vector<std::size_t> added = fit.hypothesis.added();
  if (std::none_of(added.begin(), added.end(), is_of_current)) return {};
  if (fitted_error_v(likelihood_, fit) > withhold_limits.gross_times * largest_error_v(healthy_)) return {};
  return coverage_of(with_true_current(likelihood_, fit), healthy_, likelihood_.cell().capacity_ah);
}

double HealthyJudge::reach() const {
  return likelihood_.facts().one_current ? thresholds.decision.tie_inseparable : thresholds.decision.tie;
}

void HealthyJudge::cover_true_current(const Survivors& found) {
  basis_.covered = as_read_;
  if (is_covered()) return;
  const auto take_if_more = [&](HealthyCoverage c) {
    if (c.share > basis_.covered.share) basis_.covered = std::move(c);
  };
  take_if_more(covered_by(found.best));
  for (const auto& [m, rivals] : found.rivals) {
    for (const HypothesisFit& rival : rivals) {
      if (search_.score(rival) - search_.score(found.best) < reach()) take_if_more(covered_by(rival));
    }
  }
}

Survivors HealthyJudge::with_current_sensor(Survivors found) {
  std::vector<std::size_t> sensor = scope_.searched;
  std::erase_if(sensor, [](std::size_t m) { return !is_of_current(m); });
  const std::vector<HypothesisFit> fits = search_.one_more(control_, sensor);
  if (fits.empty() || search_.score(fits.front()) >= search_.score(found.best) + reach()) return found;
  return eliminate(search_, likelihood_, control_, fits.front(), scope_);
}

Survivors HealthyJudge::without_withheld(Survivors found) {
  Survivors as_found = found;
  cover_true_current(found);
  if (!is_covered()) {
    found = with_current_sensor(std::move(found));
    cover_true_current(found);
  }
  // before a sensor's error is removed, which would leave the current as it is read
  basis_.decided = healthy_decide(null_, basis_.covered);
  if (!basis_.decided) return as_found;
  for (bool removed = true; removed;) {
    removed = false;
    while (std::optional<Withheld> least = least_of(found)) {
      std::erase(scope_.searched, least->mechanism);
      scope_.expected.erase(least->mechanism);
      found = without_one(search_, control_, found, least->mechanism);
      withheld_.push_back(*std::move(least));
      removed = true;
    }
    if (found.best.hypothesis.added().empty()) break;
    if (removed) found = eliminate(search_, likelihood_, control_, found.best, scope_);
  }
  if (!withheld_.empty()) cover_true_current(found);
  return found;
}

std::optional<double> HealthyJudge::gain_needed(std::size_t mechanism) const {
  return null_.gain_needed(cause_of(mechanism), basis_.covered.share);
}

void HealthyJudge::withhold_unknown(Adequacy& adequacy) {
  if (!adequacy.unknown) return;
  const double gain = unknown_gain(adequacy.residual);
  if (compare(no_mechanism, gain).stands_out) return;
  adequacy.unknown = false;
  withheld_.push_back(withheld_of(no_mechanism, {}, gain));
}

std::vector<Withheld> HealthyJudge::withheld() const {
  std::vector<Withheld> list = withheld_;
  std::stable_sort(list.begin(), list.end(), [](const Withheld& a, const Withheld& b) { return a.gain > b.gain; });
  return list;
}

}  // namespace bms::diagnosis
