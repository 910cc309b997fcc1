#include "fleet/battery.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

namespace bms::fleet {

namespace {

/// 1 of 72 healthy recordings of evidence/benchmark/ was off.
constexpr double false_alarm = 0.014;
/// Of two recordings of one cell. Not measured: chosen on development depots; 3 of 20 recordings are no discovery.
constexpr double false_alarm_correlation = 0.05;
constexpr double shared_share = 0.5;          ///< of the cells of a battery that are off together
constexpr std::size_t fewest_neighbours = 3;  ///< cells of a battery whose median is a reference
constexpr double known_soc = 0.12;            ///< a start with a larger sigma is not used
constexpr double least_discharge = 0.01;      ///< lost charge that is worth a visit
constexpr double least_loss = 0.03;           ///< of the capacity, against the neighbours, that is worth a visit
constexpr double capacities_differ = 0.01;    ///< standard deviation of healthy cells of one battery
constexpr double least_drift = 2;             ///< of the current sensor's offset, in sigmas of one recording's estimate
constexpr double cause_share = 0.2;           ///< of the recordings that are off, for a cause to be named

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
    for (const auto& [id, weight] : weight_) shared[cause_if_shared(id)] += weight;
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

/// The cause that the recordings name most often, of those that are off. One name among several is not enough.
void set_causes(const Causes& causes, std::size_t off, Issue& issue) {
  const double share = cause_share * static_cast<double>(off);
  const auto named = causes.most(std::max(off > 1 ? 2.0 : 1.0, share));
  issue.cause = named.empty() ? "unknown" : named.front();
  issue.also = causes.most(std::max(1.0, share));
  std::erase(issue.also, issue.cause);
}

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
    judge_drift(issues);
    const auto starts = relative_starts();
    std::vector<double> scatters;
    for (const auto& readings : starts) scatters.push_back(scatter_of(readings));
    const auto capacities = relative_capacities();
    for (std::size_t k = 0; k < cells_.size(); ++k) {
      judge_discharge(cells_[k], starts[k], median(scatters), issues);
      judge_weak(cells_[k], capacities[k], issues);
    }
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

  /// Offset of the current sensor by day: the median of what the cells estimate. Around a model that does not fit, an
  /// estimate says nothing.
  std::vector<Reading> offsets() const {
    std::map<long, std::pair<std::vector<double>, std::vector<double>>> by_day;
    for (const std::size_t c : cells_) {
      for (const Entry& e : cell(c).entries) {
        if (!e.usable() || e.verdict == "UNKNOWN" || !e.current_offset) continue;
        by_day[date_of(e)].first.push_back(e.current_offset->value);
        by_day[date_of(e)].second.push_back(e.current_offset->sigma);
      }
    }
    std::vector<Reading> readings;
    for (const auto& [day, of_cells] : by_day) {
      if (of_cells.first.size() >= fewest_neighbours)
        readings.push_back({static_cast<double>(day), median(of_cells.first), median(of_cells.second)});
    }
    return readings;
  }

  /// A current sensor whose offset changes from some day on, by more than one recording would show.
  void judge_drift(std::vector<Issue>& issues) const {
    std::vector<Reading> readings = offsets();
    std::vector<double> sigmas;
    for (Reading& r : readings) sigmas.push_back(std::exchange(r.sigma, 0));
    const double scatter = scatter_of(readings);
    const auto onset = onset_of(readings, std::max(scatter, 1e-6));
    if (!onset) return;
    const double change = onset->per_day * (readings.back().day - onset->day + 1);
    if (std::abs(change) < least_drift * median(sigmas)) return;
    Issue issue;
    issue.truck = cell(cells_.front()).truck;
    issue.cause = "current_offset";
    issue.by_comparison = true;
    issue.cell = cells_.front();
    issue.entry = cell(issue.cell).entries.size() - 1;
    issue.of = readings.size();
    issue.seen = static_cast<std::size_t>(
        std::count_if(readings.begin(), readings.end(), [&](const Reading& r) { return r.day >= onset->day; }));
    issue.p_value = onset->p_value;
    issue.onset_day = onset->day;
    issue.per_day = onset->per_day;
    issue.size = Strength{readings.back().value, scatter};
    issue.unit = "A";
    issues.push_back(std::move(issue));
  }

  void judge_shared(std::vector<Issue>& issues) {
    Issue issue;
    issue.truck = cell(cells_.front()).truck;
    issue.of = days_.size();
    issue.seen = shared_days_.size();
    if (issue.seen == 0 || cells_.size() < 2) return;
    Causes causes;
    std::size_t off = 0;
    double most = -1;
    for (const std::size_t c : cells_) {
      for (std::size_t k = 0; k < cell(c).entries.size(); ++k) {
        const Entry& e = cell(c).entries[k];
        if (!e.usable() || !shared_days_.contains(date_of(e))) continue;
        causes.add(e);
        off += is_off(e) ? 1 : 0;
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
    set_causes(causes, off, issue);
    issue.p_value = false_alarm_probability(shared_, false_alarm, false_alarm_correlation);
    issue.onset_day = static_cast<double>(days_[first_of_many(shared_)]);
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
    set_causes(causes, issue.seen, issue);
    issue.p_value = false_alarm_probability(off, false_alarm, false_alarm_correlation);
    issue.onset_day = std::floor(days[first_of_many(off)]);
    if (const Named* n = cell(c).entries[issue.entry].find(issue.cause)) {
      issue.size = n->strength;
      issue.unit = n->unit;
    }
    issues.push_back(std::move(issue));
  }

  /// A reading of each cell less the median of the battery's cells on that day. reading_of(Entry): nothing if the
  /// recording does not have it.
  template <class F>
  std::vector<std::vector<Reading>> relative(F&& reading_of) const {
    std::map<long, std::vector<double>> by_day;
    const auto read = [&](const Entry& e) { return e.usable() ? reading_of(e) : std::nullopt; };
    for (const std::size_t c : cells_) {
      for (const Entry& e : cell(c).entries) {
        if (const auto reading = read(e)) by_day[date_of(e)].push_back(reading->value);
      }
    }
    std::vector<std::vector<Reading>> readings;
    for (const std::size_t c : cells_) {
      readings.emplace_back();
      for (const Entry& e : cell(c).entries) {
        const std::vector<double>& of_day = by_day[date_of(e)];
        if (const auto reading = read(e); reading && of_day.size() >= fewest_neighbours)
          readings.back().push_back({static_cast<double>(date_of(e)), reading->value - median(of_day), reading->sigma});
      }
    }
    return readings;
  }

  /// States of charge at the start. Their scatter is that from day to day, not their sigma.
  std::vector<std::vector<Reading>> relative_starts() const {
    return relative([](const Entry& e) {
      const bool known = e.initial_soc && e.initial_soc->sigma < known_soc;
      return known ? std::optional(Strength{e.initial_soc->value, 0}) : std::nullopt;
    });
  }

  /// Around a model that does not fit, an estimate says nothing.
  std::vector<std::vector<Reading>> relative_capacities() const {
    return relative([](const Entry& e) { return e.verdict == "UNKNOWN" ? std::nullopt : e.capacity; });
  }

  Issue compared(std::size_t c, const char* cause, const std::vector<Reading>& readings) const {
    Issue issue;
    issue.truck = cell(c).truck;
    issue.cell_index = cell(c).cell_index;
    issue.cause = cause;
    issue.by_comparison = true;
    issue.cell = c;
    issue.of = readings.size();
    return issue;
  }

  void judge_discharge(std::size_t c, const std::vector<Reading>& readings, double scatter,
                       std::vector<Issue>& issues) const {
    constexpr double least_scatter = 5e-4;
    const auto onset = onset_of(readings, std::max(scatter, least_scatter));
    if (!onset || onset->per_day >= 0) return;
    const double lost = -onset->per_day * (readings.back().day - onset->day + 1);
    if (lost < least_discharge) return;
    Issue issue = compared(c, "leakage", readings);
    issue.entry = cell(c).entries.size() - 1;
    issue.seen = static_cast<std::size_t>(
        std::count_if(readings.begin(), readings.end(), [&](const Reading& r) { return r.day >= onset->day; }));
    issue.p_value = onset->p_value;
    issue.onset_day = onset->day;
    issue.per_day = -onset->per_day;
    issue.size = Strength{lost, scatter};
    issue.unit = "1";
    issues.push_back(std::move(issue));
  }

  /// A cell whose recordings together show less capacity than those of its neighbours.
  void judge_weak(std::size_t c, const std::vector<Reading>& readings, std::vector<Issue>& issues) const {
    const auto mean = mean_of(readings);
    if (!mean || mean->value < least_loss) return;
    Issue issue = compared(c, "capacity_change", readings);
    issue.seen = static_cast<std::size_t>(
        std::count_if(readings.begin(), readings.end(), [](const Reading& r) { return r.value > least_loss; }));
    issue.p_value = std::erfc(mean->value / (std::sqrt(2.0) * std::hypot(mean->sigma, capacities_differ))) / 2;
    const auto onset = onset_of(readings, std::max(scatter_of(readings), mean->sigma));
    issue.onset_day = onset && onset->p_value < 0.01 && onset->per_day > 0 ? onset->day : readings.front().day;
    set_size(issue);
    issues.push_back(std::move(issue));
  }

  /// From the recording that names the cause most clearly. Other estimates are of first order: too small for a large
  /// change.
  void set_size(Issue& issue) const {
    double most = 0;
    for (std::size_t k = 0; k < cell(issue.cell).entries.size(); ++k) {
      const Named* n = cell(issue.cell).entries[k].find(issue.cause);
      if (n == nullptr || n->gain <= most) continue;
      most = n->gain;
      issue.entry = k;
      issue.size = n->strength;
      issue.unit = n->unit;
    }
  }

  const History& history_;
  std::vector<std::size_t> cells_;
  std::vector<long> days_;  ///< with usable recordings, ascending
  std::vector<bool> shared_;
  std::set<long> shared_days_;
};

}  // namespace

std::string cause_if_shared(const std::string& cause) {
  const bool like_an_offset = cause == "leakage" || cause == "coulombic_loss" || cause == "initial_soc";
  return like_an_offset ? "current_offset" : cause;
}

void judge_battery(const History& history, std::vector<std::size_t> cells, std::vector<Issue>& issues) {
  Battery(history, std::move(cells)).judge(issues);
}

}  // namespace bms::fleet
