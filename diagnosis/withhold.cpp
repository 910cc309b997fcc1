#include "diagnosis/withhold.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/charge_count.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Healthy& withhold_limits = thresholds.healthy;

double total_duration_s(const std::vector<PreparedRecording>& records) {
  double sum_s = 0;
  for (const PreparedRecording& r : records) sum_s += r.duration_s();
  return sum_s;
}

/// Share of the rows at charges, temperatures and currents of the healthy blocks.
double covered_share(const std::vector<PreparedRecording>& records, const measurement::HealthyData& healthy,
                     double capacity_ah) {
  measurement::HealthyRange soc, temperature_c;
  double largest_a = 0;
  for (const measurement::HealthyBlock& b : healthy.blocks) {
    soc.add(b.soc);
    temperature_c.add(b.temperature_c);
    if (b.current_a.known()) largest_a = std::max({largest_a, -b.current_a.low, b.current_a.high});
  }
  const auto within = [](const measurement::HealthyRange& range, double value, double beyond) {
    return !range.known() || !std::isfinite(value) || (value >= range.low - beyond && value <= range.high + beyond);
  };
  double inside = 0, rows = 0;
  for (const PreparedRecording& r : records) {
    for_each_row(r, capacity_ah, [&](const CountedRow& row) {
      const double at_c = r.temperature_c.empty() ? std::nan("") : r.temperature_c[row.k];
      const bool covered = within(soc, row.soc, withhold_limits.soc_beyond) &&
                           within(temperature_c, at_c, withhold_limits.temperature_beyond_k) &&
                           std::abs(row.current_a) <= withhold_limits.current_beyond * largest_a;
      inside += covered ? 1 : 0;
      ++rows;
    });
  }
  return rows > 0 ? inside / rows : 0;
}

HealthyBasis basis_of(const std::vector<PreparedRecording>& records, const measurement::HealthyData& healthy,
                      double rate, double capacity_ah) {
  return {healthy.hours(), healthy.recordings(), healthy.blocks.size(), rate,
          covered_share(records, healthy, capacity_ah)};
}

}  // namespace

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

HealthyJudge::HealthyJudge(Search& search, const LikelihoodModel& likelihood, const HypothesisFit& control,
                           const Scope& scope, const measurement::HealthyData& healthy, double false_alarm_rate)
    : search_(search),
      likelihood_(likelihood),
      control_(control),
      scope_(scope),
      basis_(basis_of(likelihood.records(), healthy, false_alarm_rate, likelihood.cell().capacity_ah)),
      null_(healthy, false_alarm_rate, total_duration_s(likelihood.records())) {}

bool HealthyJudge::is_covered() const { return basis_.covered >= withhold_limits.covered_at_least; }

HealthyComparison HealthyJudge::compare(std::size_t mechanism, double gain) const {
  const std::string cause =
      mechanism == no_mechanism ? std::string(measurement::unknown_cause) : std::string(model::catalogue[mechanism].id);
  HealthyComparison c = null_.compare(cause, gain);
  if (!is_covered()) c.stands_out = false;
  return c;
}

std::optional<Withheld> HealthyJudge::least_of(const Survivors& found) const {
  std::optional<Withheld> least;
  for (const std::size_t m : found.best.hypothesis.added()) {
    const double gain = found.gains.at(m);
    const HealthyComparison c = compare(m, gain);
    const bool less = !least || c.false_alarm > least->healthy.false_alarm ||
                      (c.false_alarm == least->healthy.false_alarm && gain < least->gain);
    if (!c.stands_out && less) least = Withheld{m, *found.best.hypothesis.find(m), gain, c, false};
  }
  return least;
}

Survivors HealthyJudge::without_withheld(Survivors found) {
  if (!is_covered()) {
    for (const std::size_t m : found.best.hypothesis.added())
      withheld_.push_back({m, *found.best.hypothesis.find(m), found.gains.at(m), compare(m, found.gains.at(m)), true});
    return {control_, {}, {}, {}};
  }
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
  return found;
}

std::optional<double> HealthyJudge::gain_needed(std::size_t mechanism) const {
  if (!is_covered()) return std::nullopt;
  return null_.gain_needed(std::string(model::catalogue[mechanism].id));
}

void HealthyJudge::withhold_unknown(Adequacy& adequacy) {
  if (!adequacy.unknown) return;
  const double gain = unknown_gain(adequacy.residual);
  const HealthyComparison c = compare(no_mechanism, gain);
  if (c.stands_out) return;
  adequacy.unknown = false;
  withheld_.push_back({no_mechanism, {}, gain, c, !is_covered()});
}

std::vector<Withheld> HealthyJudge::withheld() const {
  std::vector<Withheld> list = withheld_;
  std::stable_sort(list.begin(), list.end(), [](const Withheld& a, const Withheld& b) { return a.gain > b.gain; });
  return list;
}

}  // namespace bms::diagnosis
