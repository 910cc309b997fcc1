#include "workflow/slow_parts.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace bms::workflow {

std::vector<RowRange> one_direction(const measurement::Recording& r) {
  constexpr double flows_share = 0.02;  ///< of the largest current
  constexpr double least_kept = 0.8;    ///< of all charge that the recording moves
  struct Part {
    RowRange rows;
    double moved_as = 0;
  };
  double largest_a = 0;
  for (const double a : r.current_a) largest_a = std::max(largest_a, std::abs(a));
  std::vector<Part> parts(1);
  std::size_t rest_from = 0;
  int direction = 0;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const double a = r.current_a[k];
    if (!(std::abs(a) > flows_share * largest_a)) continue;
    const int now = a > 0 ? 1 : -1;
    if (direction != 0 && now != direction) {
      parts.back().rows.count = k - parts.back().rows.first;
      parts.push_back({{rest_from + 1, 0}, 0});  // the rest in between belongs to both
    }
    direction = now;
    rest_from = k;
    parts.back().moved_as += std::abs(a) * (r.time_s[k] - r.time_s[k - 1]);
  }
  parts.back().rows.count = r.rows() - parts.back().rows.first;
  constexpr double other_share = 0.01;  ///< of the charge, against the direction of a slow run
  double charged_as = 0, discharged_as = 0;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const double as = r.current_a[k] * (r.time_s[k] - r.time_s[k - 1]);
    if (std::isfinite(as)) (as > 0 ? charged_as : discharged_as) += std::abs(as);
  }
  if (std::min(charged_as, discharged_as) <= other_share * std::max(charged_as, discharged_as)) return {{0, r.rows()}};
  double most_as = 0, all_as = 0, kept_as = 0;
  for (const Part& part : parts) {
    most_as = std::max(most_as, part.moved_as);
    all_as += part.moved_as;
  }
  std::vector<RowRange> kept;
  for (const Part& part : parts) {
    if (part.moved_as < most_as / 2) continue;
    kept.push_back(part.rows);
    kept_as += part.moved_as;
  }
  if (kept_as < least_kept * all_as) return {{0, r.rows()}};
  return kept;
}

std::vector<identification::SlowRun> runs_of(const measurement::Recording& r) {
  std::vector<identification::SlowRun> runs;
  for (const auto& [first, count] : one_direction(r)) {
    identification::SlowRun run;
    run.data = {r.time_s.part(first, count), r.current_a.part(first, count), r.voltage_v.part(first, count), 0};
    if (!r.soc_ref.empty()) run.soc = r.soc_ref.part(first, count);
    runs.push_back(std::move(run));
  }
  return runs;
}

}  // namespace bms::workflow
