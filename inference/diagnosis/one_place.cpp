#include "diagnosis/one_place.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/block_covariance.hpp"
#include "diagnosis/healthy_null.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

/// Returns true if the current before a span and after it is that within, and flows.
bool under_one_current(const PreparedRecording& r, const model::Span& span) {
  double largest_a = 0;
  for (const double a : r.current_a) largest_a = std::isfinite(a) ? std::max(largest_a, std::abs(a)) : largest_a;
  const auto row = [&](double time_s) {
    return static_cast<std::size_t>(std::lower_bound(r.time_s.begin(), r.time_s.end(), time_s) - r.time_s.begin());
  };
  const std::size_t first = row(span.start_s), end = row(span.end_s) + 1;
  if (first == 0 || end >= r.size()) return false;
  const double before_a = r.current_a[first - 1];
  if (!(std::abs(before_a) > thresholds.bursts.loaded_current * largest_a)) return false;
  for (std::size_t k = first; k <= end; ++k) {
    if (!(std::abs(r.current_a[k] - before_a) <= thresholds.bursts.edge_current * largest_a)) return false;
  }
  return true;
}

/// Returns true if a loose contact is seen to go and to come back.
bool has_recovering_burst(const LikelihoodModel& likelihood, const Hypothesis& h) {
  if (h.find(Signature::contact_bursts) == nullptr) return false;
  for (std::size_t r = 0; r < h.bursts.size(); ++r) {
    const PreparedRecording& record = likelihood.records()[r];
    if (std::any_of(h.bursts[r].begin(), h.bursts[r].end(),
                    [&](const model::Span& span) { return under_one_current(record, span); }))
      return true;
  }
  return false;
}

}  // namespace

std::optional<PlaceOfGain> only_place(const LikelihoodModel& likelihood, const Eigen::VectorXd& before,
                                      const Eigen::VectorXd& after, double calibration_relief) {
  double total = 0, most = 0;
  PlaceOfGain place;
  Eigen::Index start = 0;
  for (std::size_t r = 0; r < likelihood.records().size(); ++r) {
    const std::size_t rows = likelihood.records()[r].size();
    for_each_block(rows, [&](Eigen::Index first, Eigen::Index count) {
      const double gain =
          before.segment(start + first, count).squaredNorm() - after.segment(start + first, count).squaredNorm();
      total += gain;
      if (gain <= most) return;
      most = gain;
      place = {r, static_cast<std::size_t>(first), static_cast<std::size_t>(count)};
    });
    start += static_cast<Eigen::Index>(rows);
  }
  if (most <= thresholds.decision.in_one_place * total) return std::nullopt;
  if ((1 - most / total) * (total + calibration_relief) >= thresholds.decision.detected) return std::nullopt;
  return place;
}

std::optional<PlaceOfGain> only_place(const LikelihoodModel& likelihood, const HypothesisFit& control,
                                      const HypothesisFit& fit) {
  // base parameters that need not bend any more have no place: their part goes with what is explained where
  const double calibration_relief = std::max(control.calibration.squaredNorm() - fit.calibration.squaredNorm(), 0.0);
  const std::optional<PlaceOfGain> place = only_place(likelihood, control.residual, fit.residual, calibration_relief);
  if (place && has_recovering_burst(likelihood, fit.hypothesis)) return std::nullopt;
  return place;
}

std::vector<Withheld> withheld_at(const LikelihoodModel& likelihood, const PlaceOfGain& place, const Hypothesis& h,
                                  const std::map<std::size_t, double>& gains, double false_alarm_rate) {
  const PreparedRecording& r = likelihood.records()[place.record];
  const model::Span span{r.time_s[place.first], r.time_s[place.first + place.count - 1]};
  std::vector<Withheld> list;
  for (const std::size_t m : h.added()) {
    HealthyComparison c;
    c.hours_needed = hours_if_none_shows_any(gains.at(m), r.duration_s() / 3'600, false_alarm_rate);
    list.push_back({m, *h.find(m), gains.at(m), c, false, span});
  }
  std::sort(list.begin(), list.end(), [](const Withheld& a, const Withheld& b) { return a.gain > b.gain; });
  return list;
}

}  // namespace bms::diagnosis
