#include "fleet/analysis.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

namespace bms::fleet {

namespace {

/// 1 of 72 healthy recordings of benchmark/ was off.
constexpr double false_alarm = 0.014;
/// Of two recordings of one cell. Not measured: chosen on development depots; 3 of 20 recordings are no discovery.
constexpr double false_alarm_correlation = 0.05;
constexpr double shared_share = 0.5;          ///< of the cells of a battery that are off together
constexpr std::size_t fewest_neighbours = 3;  ///< cells of a battery whose median is a reference
constexpr double known_soc = 0.03;            ///< a start with a larger sigma is not used
constexpr double least_discharge = 0.01;      ///< lost charge that is worth a visit
constexpr double cause_share = 0.2;           ///< of the recordings that are off, for a cause to be named
constexpr double forecast_days = 3'650;

/// What a cause is taken for if all cells of a battery show it.
const std::map<std::string, std::string>& shared_causes() {
  static const std::map<std::string, std::string> causes = {{"leakage", "current_offset"},
                                                            {"coulombic_loss", "current_offset"},
                                                            {"initial_soc", "current_offset"},
                                                            {"current_offset", "current_offset"},
                                                            {"current_gain", "current_gain"}};
  return causes;
}

/// The most urgent causes first: what heats up, what may become a short circuit, what misleads the battery management.
int urgency_of(const std::string& cause) {
  constexpr std::array order = {"contact_intermittent", "contact_step",    "leakage",    "current_offset",
                                "current_gain",         "capacity_change", "data_fault", "resistance_growth"};
  return static_cast<int>(std::find(order.begin(), order.end(), cause) - order.begin());
}

long date_of(const Entry& entry) { return std::lround(std::floor(entry.day)); }

bool is_off(const Entry& entry) { return !entry.named.empty() || entry.verdict == "UNKNOWN"; }

/// How often recordings name each mechanism; one that cannot be distinguished counts half.
class Causes {
 public:
  void add(const Entry& entry) {
    for (const Named& n : entry.named) {
      weight_[n.mechanism] += 1;
      for (const std::string& other : n.equivalent) weight_[other] += 0.5;
    }
  }
  void share() {
    std::map<std::string, double> shared;
    for (const auto& [id, weight] : weight_) {
      const auto found = shared_causes().find(id);
      shared[found == shared_causes().end() ? id : found->second] += weight;
    }
    weight_ = std::move(shared);
  }
  /// Those of at least `least`, the most frequent first.
  std::vector<std::string> most(double least) const {
    std::vector<std::pair<double, std::string>> order;
    for (const auto& [id, weight] : weight_) {
      if (weight >= least) order.emplace_back(-weight, id);
    }
    std::sort(order.begin(), order.end());
    std::vector<std::string> ids;
    for (const auto& [weight, id] : order) ids.push_back(id);
    return ids;
  }

 private:
  std::map<std::string, double> weight_;
};

/// Standard deviation from day to day, robust.
double scatter_of(const std::vector<Reading>& readings) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < readings.size(); ++k)
    steps.push_back(std::abs(readings[k].value - readings[k - 1].value));
  constexpr double of_normal = 0.6745 * 1.4142;  // median of |difference| of two values of sigma 1
  return steps.empty() ? 0 : median(steps) / of_normal;
}

/// The cells of one battery.
class Battery {
 public:
  Battery(const History& history, std::vector<std::size_t> cells) : history_(history), cells_(std::move(cells)) {}

  void judge(std::vector<Issue>& issues) {
    find_shared();
    judge_shared(issues);
    for (const std::size_t c : cells_) judge_cell(c, issues);
    if (cells_.size() < fewest_neighbours) return;
    const auto starts = relative_starts();
    std::vector<double> scatters;
    for (const auto& readings : starts) scatters.push_back(scatter_of(readings));
    for (std::size_t k = 0; k < cells_.size(); ++k) judge_discharge(cells_[k], starts[k], median(scatters), issues);
  }

 private:
  const CellHistory& cell(std::size_t c) const { return history_.cells[c]; }

  /// Days on which more than half of the cells are off.
  void find_shared() {
    std::map<long, std::pair<std::size_t, std::size_t>> days;  // off, usable
    for (const std::size_t c : cells_) {
      for (const Entry& e : cell(c).entries) {
        if (!e.usable()) continue;
        days[date_of(e)].first += is_off(e) ? 1 : 0;
        ++days[date_of(e)].second;
      }
    }
    for (const auto& [day, counts] : days) {
      const bool several = counts.second > 1;
      days_.push_back(day);
      shared_.push_back(several &&
                        static_cast<double>(counts.first) > shared_share * static_cast<double>(counts.second));
      if (shared_.back()) shared_days_.insert(day);
    }
  }

  /// Offset of the current sensor by day: the median of what the cells estimate.
  std::vector<Reading> offsets() const {
    std::map<long, std::vector<double>> by_day;
    for (const std::size_t c : cells_) {
      for (const Entry& e : cell(c).entries) {
        if (e.usable() && e.current_offset) by_day[date_of(e)].push_back(e.current_offset->value);
      }
    }
    std::vector<Reading> readings;
    for (const auto& [day, values] : by_day) readings.push_back({static_cast<double>(day), median(values), 0});
    return readings;
  }

  void judge_shared(std::vector<Issue>& issues) {
    Issue issue;
    issue.truck = cell(cells_.front()).truck;
    issue.of = days_.size();
    issue.seen = shared_days_.size();
    if (issue.seen == 0 || cells_.size() < 2) return;
    Causes causes;
    double most = -1;
    for (const std::size_t c : cells_) {
      for (std::size_t k = 0; k < cell(c).entries.size(); ++k) {
        const Entry& e = cell(c).entries[k];
        if (!e.usable() || !shared_days_.contains(date_of(e))) continue;
        causes.add(e);
        for (const Named& n : e.named) {
          if (n.gain <= most) continue;
          most = n.gain;
          issue.cell = c;
          issue.entry = k;
        }
      }
    }
    if (most < 0) issue.cell = cells_.front();
    causes.share();
    const auto ids = causes.most(2);
    issue.cause = ids.empty() ? "unknown" : ids.front();
    if (ids.size() > 1) issue.also.assign(ids.begin() + 1, ids.end());
    issue.p_value = false_alarm_probability(shared_, false_alarm, false_alarm_correlation);
    issue.onset_day = static_cast<double>(days_[first_of_many(shared_)]);
    const std::vector<Reading> readings = offsets();
    const auto onset = onset_of(readings, std::max(scatter_of(readings), 1e-6));
    if (issue.cause == "current_offset" && onset && onset->p_value < 0.01) {
      issue.onset_day = onset->day;
      issue.per_day = onset->per_day;
      issue.size = Strength{readings.back().value, scatter_of(readings)};
      issue.unit = "A";
    }
    issues.push_back(std::move(issue));
  }

  /// Recordings that are off on days that are not shared.
  void judge_cell(std::size_t c, std::vector<Issue>& issues) const {
    Issue issue;
    issue.truck = cell(c).truck;
    issue.cell_index = cell(c).cell_index;
    issue.cell = c;
    Causes causes;
    std::vector<bool> off;
    std::vector<double> days;
    double most = -1;
    for (std::size_t k = 0; k < cell(c).entries.size(); ++k) {
      const Entry& e = cell(c).entries[k];
      if (!e.usable() || shared_days_.contains(date_of(e))) continue;
      off.push_back(is_off(e));
      days.push_back(e.day);
      if (!off.back()) continue;
      causes.add(e);
      const double gain = e.named.empty() ? 0 : e.named.front().gain;
      if (gain <= most) continue;
      most = gain;
      issue.entry = k;
    }
    issue.of = off.size();
    issue.seen = static_cast<std::size_t>(std::count(off.begin(), off.end(), true));
    if (issue.seen == 0) return;
    const auto ids = causes.most(std::max(1.0, cause_share * static_cast<double>(issue.seen)));
    issue.cause = ids.empty() ? "unknown" : ids.front();
    if (ids.size() > 1) issue.also.assign(ids.begin() + 1, ids.end());
    issue.p_value = false_alarm_probability(off, false_alarm, false_alarm_correlation);
    issue.onset_day = std::floor(days[first_of_many(off)]);
    if (const Named* n = cell(c).entries[issue.entry].find(issue.cause)) {
      issue.size = n->strength;
      issue.unit = n->unit;
    }
    issues.push_back(std::move(issue));
  }

  /// State of charge at the start less the median of the battery's cells on that day.
  std::vector<std::vector<Reading>> relative_starts() const {
    std::map<long, std::vector<double>> by_day;
    const auto use = [](const Entry& e) { return e.usable() && e.initial_soc && e.initial_soc->sigma < known_soc; };
    for (const std::size_t c : cells_) {
      for (const Entry& e : cell(c).entries) {
        if (use(e)) by_day[date_of(e)].push_back(e.initial_soc->value);
      }
    }
    std::vector<std::vector<Reading>> starts;
    for (const std::size_t c : cells_) {
      starts.emplace_back();
      for (const Entry& e : cell(c).entries) {
        if (use(e) && by_day[date_of(e)].size() >= fewest_neighbours)
          starts.back().push_back(
              {static_cast<double>(date_of(e)), e.initial_soc->value - median(by_day[date_of(e)]), 0});
      }
    }
    return starts;
  }

  void judge_discharge(std::size_t c, const std::vector<Reading>& readings, double scatter,
                       std::vector<Issue>& issues) const {
    constexpr double least_scatter = 5e-4;
    const auto onset = onset_of(readings, std::max(scatter, least_scatter));
    if (!onset || onset->per_day >= 0) return;
    const double lost = -onset->per_day * (readings.back().day - onset->day + 1);
    if (lost < least_discharge) return;
    Issue issue;
    issue.truck = cell(c).truck;
    issue.cell_index = cell(c).cell_index;
    issue.cause = "leakage";
    issue.cell = c;
    issue.entry = cell(c).entries.size() - 1;
    issue.of = readings.size();
    issue.seen = static_cast<std::size_t>(
        std::count_if(readings.begin(), readings.end(), [&](const Reading& r) { return r.day >= onset->day; }));
    issue.p_value = onset->p_value;
    issue.onset_day = onset->day;
    issue.per_day = -onset->per_day;
    issue.size = Strength{lost, scatter};
    issue.unit = "1";
    issues.push_back(std::move(issue));
  }

  const History& history_;
  std::vector<std::size_t> cells_;
  std::vector<long> days_;  ///< with usable recordings, ascending
  std::vector<bool> shared_;
  std::set<long> shared_days_;
};

/// A self-discharge explains what else the recordings of that cell name.
void join(std::vector<Issue>& issues) {
  std::vector<Issue> joined;
  for (Issue& issue : issues) {
    const auto same = std::find_if(joined.begin(), joined.end(), [&](const Issue& other) {
      return other.truck == issue.truck && other.cell_index == issue.cell_index && !issue.cell_index.empty();
    });
    if (same == joined.end() || issue.cause != "leakage" || !issue.confirmed) {
      joined.push_back(std::move(issue));
      continue;
    }
    issue.also = same->also;
    if (same->cause != "leakage" && same->cause != "unknown") issue.also.insert(issue.also.begin(), same->cause);
    *same = std::move(issue);
  }
  issues = std::move(joined);
}

CellTrends trends_of(const CellHistory& cell, const AnalysisOptions& options) {
  std::vector<Reading> resistance, capacity;
  for (const Entry& e : cell.entries) {
    if (!e.usable() || e.verdict == "UNKNOWN") continue;
    if (e.resistance) resistance.push_back({e.day, e.resistance->value, e.resistance->sigma});
    if (e.capacity) capacity.push_back({e.day, e.capacity->value, e.capacity->sigma});
  }
  CellTrends trends;
  trends.resistance = trend_of(resistance);
  trends.capacity = trend_of(capacity);
  if (trends.resistance)
    trends.resistance_crossing = crossing_of(*trends.resistance, options.resistance_limit, forecast_days);
  if (trends.capacity) trends.capacity_crossing = crossing_of(*trends.capacity, options.capacity_limit, forecast_days);
  return trends;
}

}  // namespace

Analysis analyse(const History& history, const AnalysisOptions& options) {
  Analysis analysis;
  for (std::size_t from = 0; from < history.cells.size();) {
    std::vector<std::size_t> cells;
    std::size_t to = from;
    while (to < history.cells.size() && history.cells[to].truck == history.cells[from].truck) cells.push_back(to++);
    ++analysis.trucks;
    Battery(history, std::move(cells)).judge(analysis.issues);
    from = to;
  }
  std::vector<double> p_values;
  for (const Issue& issue : analysis.issues) p_values.push_back(issue.p_value);
  // a battery has the hypotheses of its cells, two of each, and one of its own
  const std::vector<double> rates = false_discovery_rates(p_values, 2 * history.cells.size() + analysis.trucks);
  for (std::size_t k = 0; k < rates.size(); ++k) {
    analysis.issues[k].rate = rates[k];
    analysis.issues[k].confirmed = rates[k] <= options.false_discovery_rate;
  }
  join(analysis.issues);
  std::stable_sort(analysis.issues.begin(), analysis.issues.end(), [](const Issue& a, const Issue& b) {
    if (a.confirmed != b.confirmed) return a.confirmed;
    if (!a.confirmed) return a.p_value < b.p_value;
    const int first = urgency_of(a.cause), second = urgency_of(b.cause);
    return first != second ? first < second : a.p_value < b.p_value;
  });
  for (const CellHistory& cell : history.cells) {
    analysis.trends.push_back(trends_of(cell, options));
    for (const Entry& e : cell.entries) {
      analysis.usable += e.usable() ? 1 : 0;
      analysis.errors += e.error.empty() ? 0 : 1;
    }
  }
  return analysis;
}

}  // namespace bms::fleet
