#include "fleet/analysis.hpp"

#include <algorithm>
#include <array>

#include "fleet/battery.hpp"

namespace bms::fleet {

namespace {

/// The most urgent causes first: what heats up, what may become a short circuit, what misleads the battery management.
int urgency_of(const std::string& cause) {
  constexpr std::array order = {"contact_intermittent", "contact_step",    "leakage",    "current_offset",
                                "current_gain",         "capacity_change", "data_fault", "resistance_growth"};
  return static_cast<int>(std::find(order.begin(), order.end(), cause) - order.begin());
}

/// What a comparison with the neighbours says explains what else the recordings of a cell name: first a self-discharge,
/// which changes other estimates, then a lost capacity.
int rank_of(const Issue& issue) {
  if (!issue.confirmed || !issue.by_comparison) return 0;
  return issue.cause == "leakage" ? 2 : 1;
}

/// The cause that was named and the others.
std::vector<std::string> causes_of(const Issue& issue) {
  std::vector<std::string> causes = issue.also;
  if (issue.cause != "unknown") causes.insert(causes.begin(), issue.cause);
  return causes;
}

/// Returns true if a current sensor that drifts explains what the recordings of a single cell name.
bool is_of_the_sensor(const Issue& issue, const std::vector<Issue>& issues) {
  if (issue.cell_index.empty() || issue.by_comparison || cause_if_shared(issue.cause) != "current_offset") return false;
  return std::any_of(issues.begin(), issues.end(), [&](const Issue& other) {
    return other.confirmed && other.cell_index.empty() && other.truck == issue.truck && other.cause == "current_offset";
  });
}

/// One issue for each cell, and one for what its battery shares.
void join(std::vector<Issue>& issues) {
  std::vector<Issue> joined;
  for (Issue& issue : issues) {
    const auto same = std::find_if(joined.begin(), joined.end(), [&](const Issue& other) {
      return other.truck == issue.truck && other.cell_index == issue.cell_index;
    });
    if (same == joined.end() || std::max(rank_of(issue), rank_of(*same)) == 0) {  // nothing that explains the other
      joined.push_back(std::move(issue));
      continue;
    }
    if (rank_of(issue) > rank_of(*same)) std::swap(issue, *same);
    if (!issue.confirmed) continue;
    for (const std::string& cause : causes_of(issue)) {
      if (cause != same->cause && std::find(same->also.begin(), same->also.end(), cause) == same->also.end())
        same->also.push_back(cause);
    }
  }
  issues = std::move(joined);
}

Course course_of(const CellHistory& cell, std::optional<Strength> Entry::*quantity, double limit) {
  Course course;
  for (const Entry& e : cell.entries) {
    if (!e.usable() || e.verdict == "UNKNOWN" || !(e.*quantity)) continue;
    course.readings.push_back({e.day, (e.*quantity)->value, (e.*quantity)->sigma});
  }
  if (course.readings.empty()) return course;
  course.trend = trend_of(course.readings);
  course.outlook = outlook_of(course.readings, course.trend, limit, forecast_days);
  if (course.trend) course.crossing = crossing_of(*course.trend, limit, forecast_days);
  return course;
}

}  // namespace

Analysis analyse(const History& history, const AnalysisOptions& options) {
  Analysis analysis;
  for (std::size_t from = 0; from < history.cells.size();) {
    std::vector<std::size_t> cells;
    std::size_t to = from;
    while (to < history.cells.size() && history.cells[to].truck == history.cells[from].truck) cells.push_back(to++);
    ++analysis.trucks;
    judge_battery(history, std::move(cells), analysis.issues);
    from = to;
  }
  std::vector<double> p_values;
  for (const Issue& issue : analysis.issues) p_values.push_back(issue.p_value);
  const std::size_t tests = hypotheses_of_a_cell * history.cells.size() + hypotheses_of_a_battery * analysis.trucks;
  const std::vector<double> rates = false_discovery_rates(p_values, tests);
  for (std::size_t k = 0; k < rates.size(); ++k) {
    analysis.issues[k].rate = rates[k];
    analysis.issues[k].confirmed = rates[k] <= options.false_discovery_rate;
  }
  std::erase_if(analysis.issues,
                [issues = analysis.issues](const Issue& issue) { return is_of_the_sensor(issue, issues); });
  join(analysis.issues);
  std::stable_sort(analysis.issues.begin(), analysis.issues.end(), [](const Issue& a, const Issue& b) {
    if (a.confirmed != b.confirmed) return a.confirmed;
    if (!a.confirmed) return a.p_value < b.p_value;
    const int first = urgency_of(a.cause), second = urgency_of(b.cause);
    return first != second ? first < second : a.p_value < b.p_value;
  });
  for (const CellHistory& cell : history.cells) {
    analysis.trends.push_back({course_of(cell, &Entry::resistance, options.resistance_limit),
                               course_of(cell, &Entry::capacity, options.capacity_limit)});
    for (const Entry& e : cell.entries) {
      analysis.usable += e.usable() ? 1 : 0;
      analysis.errors += e.error.empty() ? 0 : 1;
    }
  }
  return analysis;
}

}  // namespace bms::fleet
