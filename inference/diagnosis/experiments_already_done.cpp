#include "diagnosis/experiments_already_done.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "diagnosis/numerics.hpp"
#include "diagnosis/thresholds.hpp"
#include "experiments/experiment.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Design& course_limits = thresholds.design;
constexpr const Numerics::Design& course_numerics = numerics.design;

/// Charge that has flowed [A s] over time.
struct Charge {
  std::vector<double> time_s, charge_as;
  double duration_s() const { return time_s.back(); }
  double at(double t) const {
    const auto after = std::upper_bound(time_s.begin(), time_s.end(), t);
    if (after == time_s.begin()) return charge_as.front();
    if (after == time_s.end()) return charge_as.back();
    const auto k = static_cast<std::size_t>(after - time_s.begin());
    return charge_as[k - 1] + (charge_as[k] - charge_as[k - 1]) * (t - time_s[k - 1]) / (time_s[k] - time_s[k - 1]);
  }
};

Charge charge_of(const PreparedRecording& r) {
  Charge c{{0}, {0}};
  for (std::size_t k = 1; k < r.size(); ++k) {
    const double a = r.current_a[k], step_s = r.time_s[k] - r.time_s[k - 1];
    c.time_s.push_back(r.time_s[k] - r.time_s[0]);
    c.charge_as.push_back(c.charge_as.back() + (std::isfinite(a) ? a * step_s : 0));
  }
  return c;
}

/// A course laid out for a cell of 1 Ah.
struct Course {
  const experiments::Experiment* experiment;
  PreparedRecording profile;
  bool without_current = true, ammeter = false, voltage_reference = false;
};

Course course_of(const experiments::Experiment& e) {
  Course c{&e, {}};
  const std::vector<experiments::ProfileRow> rows = experiments::experiment(e.name, {.capacity_ah = 1}).value();
  for (const experiments::ProfileRow& row : rows) {
    c.profile.time_s.edit().push_back(row.time_s);
    c.profile.current_a.edit().push_back(row.current_a);
    c.without_current = c.without_current && row.current_a == 0;
    c.ammeter = c.ammeter || row.ammeter;
    c.voltage_reference = c.voltage_reference || row.voltmeter || std::isfinite(row.source_v);
  }
  return c;
}

/// Values without their mean and slope: an offset of the current sensor adds a slope to the charge.
void remove_line(std::vector<double>& y) {
  const auto n = static_cast<double>(y.size());
  double mean = 0, slope = 0, of = 0;
  for (const double v : y) mean += v / n;
  for (std::size_t k = 0; k < y.size(); ++k) {
    const double x = static_cast<double>(k) - (n - 1) / 2;
    slope += x * y[k];
    of += x * x;
  }
  for (std::size_t k = 0; k < y.size(); ++k) y[k] -= mean + slope / of * (static_cast<double>(k) - (n - 1) / 2);
}

/// Charge in equal steps from a time on, without mean and slope.
std::vector<double> shape(const Charge& c, double from_s, double duration_s) {
  std::vector<double> y;
  for (std::size_t k = 0; k < course_numerics.shape_points; ++k)
    y.push_back(
        c.at(from_s + duration_s * static_cast<double>(k) / static_cast<double>(course_numerics.shape_points - 1)));
  remove_line(y);
  return y;
}

/// Returns true if a stretch of the recording follows the course.
bool follows(const Charge& recorded, const Charge& course, double capacity_ah) {
  const double duration_s = course.duration_s(),
               lag_s = duration_s / static_cast<double>(course_numerics.shape_points - 1);
  if (recorded.duration_s() < course_limits.carried_out_share * duration_s) return false;
  const std::vector<double> wanted = shape(course, 0, duration_s);
  const double early_s = (1 - course_limits.carried_out_share) * duration_s;
  for (double from_s = -early_s; from_s + duration_s <= recorded.duration_s() + early_s; from_s += lag_s) {
    const std::vector<double> seen = shape(recorded, from_s, duration_s);
    double both = 0, own = 0, other = 0;
    for (std::size_t k = 0; k < seen.size(); ++k) {
      both += wanted[k] * seen[k];
      own += wanted[k] * wanted[k];
      other += seen[k] * seen[k];
    }
    const double scale = both / own / capacity_ah;
    if (scale > course_limits.scale_least && scale < course_limits.scale_most &&
        both > course_limits.alike * std::sqrt(own * other))
      return true;
  }
  return false;
}

/// Returns true if a trusted instrument of this channel read.
bool has_reference(const PreparedRecording& r, Check::Channel channel) {
  const measurement::Column& column = channel == Check::Channel::current ? r.current_ref_a : r.voltage_ref_v;
  return !column.empty() || std::any_of(r.checks.begin(), r.checks.end(),
                                        [&](const Check& c) { return c.channel == channel && !c.assumed; });
}

bool is_idle(const PreparedRecording& r, double capacity_ah) {
  return std::all_of(r.current_a.begin(), r.current_a.end(),
                     [&](double a) { return !std::isfinite(a) || std::abs(a) < course_limits.idle_c * capacity_ah; });
}

bool is_carried_out(const Course& c, const PreparedRecording& r, double capacity_ah) {
  if (r.size() < 2) return false;
  if ((c.ammeter || c.without_current) && !has_reference(r, Check::Channel::current)) return false;
  if (c.voltage_reference && !has_reference(r, Check::Channel::voltage)) return false;
  if (c.without_current)
    return is_idle(r, capacity_ah) && r.duration_s() >= course_limits.carried_out_share * c.profile.duration_s();
  return follows(charge_of(r), charge_of(c.profile), capacity_ah);
}

}  // namespace

std::vector<std::string> experiments_already_done(const std::vector<PreparedRecording>& recordings,
                                                  double capacity_ah) {
  std::vector<std::string> names;
  for (const experiments::Experiment& e : experiments::experiments()) {
    if (!std::isfinite(e.start_soc)) continue;
    const Course course = course_of(e);
    if (std::any_of(recordings.begin(), recordings.end(),
                    [&](const PreparedRecording& r) { return is_carried_out(course, r, capacity_ah); }))
      names.emplace_back(e.name);
  }
  return names;
}

}  // namespace bms::diagnosis
