#include "diagnosis/learned_error.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "diagnosis/charge_count.hpp"
#include "diagnosis/numerics.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/statistics.hpp"
#include "model/cell.hpp"

namespace bms::diagnosis {

namespace {

using healthy_data::HealthyRegime;

constexpr const HealthyThresholds& learned_limits = thresholds.healthy;

/// Returns true if healthy recordings were there for some time, or if nothing is known of the axis.
bool was_at(const std::vector<HealthyRegime>& regimes, std::string_view axis, double value, double beyond) {
  bool any = false;
  for (const HealthyRegime& r : regimes) {
    if (r.axis != axis || !(r.hours > 0)) continue;
    any = true;
    if (value >= r.from - beyond && value <= r.to + beyond) return true;
  }
  return !any || !std::isfinite(value);
}

/// Share of the rows at states of charge, currents and temperatures of the regimes.
double share_within(const std::vector<HealthyRegime>& regimes, double capacity_ah,
                    const std::vector<PreparedRecording>& records) {
  double within = 0, rows = 0;
  for (const PreparedRecording& r : records) {
    for_each_row(r, capacity_ah, [&](const CountedRow& row) {
      const double at_c = r.temperature_c.empty() ? std::nan("") : r.temperature_c[row.k];
      const bool there = was_at(regimes, "soc", row.soc, learned_limits.soc_beyond) &&
                         was_at(regimes, "current_c", std::abs(row.current_a) / capacity_ah, 0) &&
                         was_at(regimes, "temperature_c", at_c, 0);
      within += there ? 1 : 0;
      ++rows;
    });
  }
  return rows > 0 ? within / rows : 0;
}

double highest_current_a(const std::vector<PreparedRecording>& records) {
  double largest_a = 0;
  for (const PreparedRecording& r : records) {
    for (const double a : r.current_a) {
      if (std::isfinite(a)) largest_a = std::max(largest_a, std::abs(a));
    }
  }
  return largest_a;
}

}  // namespace

LearnedError::LearnedError(const std::vector<HealthyRegime>& regimes, const model::CellParameters<>& cell,
                           const std::vector<PreparedRecording>& records)
    : largest_a_(highest_current_a(records)) {
  std::vector<Point> points;
  std::vector<double> errors_v;
  for (const HealthyRegime& r : regimes) {
    if (r.axis != "soc" || !(r.hours > 0)) continue;
    const double error_v = std::max(learned_limits.error_times * r.rms_v, learned_limits.error_at_least_v);
    points.push_back({(r.from + r.to) / 2, error_v});
    errors_v.push_back(error_v);
  }
  if (points.size() < 2) return;
  usual_v_ = measurement::median(errors_v);
  if (usual_v_ >= cell.tolerance.ocv_v) return;
  elsewhere_ = share_within(regimes, cell.capacity_ah, records) < learned_limits.learned_within;
  if (elsewhere_) return;
  std::sort(points.begin(), points.end(), [](const Point& a, const Point& b) { return a.soc < b.soc; });
  least_v_ = *std::min_element(errors_v.begin(), errors_v.end());
  points_ = std::move(points);
}

double LearnedError::at(double soc) const {
  if (soc <= points_.front().soc) return points_.front().error_v;
  for (std::size_t k = 1; k < points_.size(); ++k) {
    const Point &low = points_[k - 1], &high = points_[k];
    if (soc <= high.soc) return low.error_v + (soc - low.soc) / (high.soc - low.soc) * (high.error_v - low.error_v);
  }
  return points_.back().error_v;
}

double LearnedError::more_at(double soc) const { return known() ? std::pow(at(soc), 2) - least_v_ * least_v_ : 0; }

model::CellParameters<> LearnedError::applied(model::CellParameters<> cell) const {
  if (!known()) return cell;
  const auto middle = [&](const auto& column) {
    return model::cell_detail::rc_value(cell.rc, column, numerics.middle_soc);
  };
  const double drop_v = largest_a_ * (middle(cell.rc.r0_ohm) + middle(cell.rc.r1_ohm));
  cell.tolerance.ocv_v = least_v_;
  cell.tolerance.resistance_fraction = std::min(cell.tolerance.resistance_fraction, usual_v_ / drop_v);
  for (std::size_t k = 0; k < std::min(cell.rc.r0_std_ohm.size, cell.rc.r1_std_ohm.size); ++k) {
    double &r0_ohm = cell.rc.r0_std_ohm[k], &r1_ohm = cell.rc.r1_std_ohm[k];
    const double share = std::min(at(cell.rc.soc[k]) / drop_v, thresholds.calibration.known_alone);
    r0_ohm = std::max(r0_ohm, share * cell.rc.r0_ohm[k]);
    r1_ohm = std::max(r1_ohm, share * cell.rc.r1_ohm[k]);
  }
  return cell;
}

}  // namespace bms::diagnosis
