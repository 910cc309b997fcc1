#include "diagnosis/idle_reading.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "diagnosis/thresholds.hpp"
#include "measurement/spans.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::IdleReading& idle_limits = thresholds.idle_reading;

/// Does the current discharge the cell right before this row?
bool discharged_before(const PreparedRecording& r, std::size_t row, double capacity_ah) {
  return row > 0 && r.current_a[row - 1] < -thresholds.facts.moving_c * capacity_ah;
}

/// Readings of one rest after a discharge, without its beginning and without stretches of exact zeros.
std::vector<double> readings_of(const PreparedRecording& r, const measurement::Rows& rest) {
  std::vector<double> read_a;
  for (std::size_t k = rest.begin; k < rest.end;) {
    std::size_t zeros_end = k;
    while (zeros_end < rest.end && r.current_a[zeros_end] == 0) ++zeros_end;
    const bool off = zeros_end - k >= idle_limits.zeros_of_no_reading;
    for (const std::size_t end = std::max(zeros_end, k + 1); k < end; ++k) {
      if (!off && r.time_s[k] - r.time_s[rest.begin] >= idle_limits.beginning_s) read_a.push_back(r.current_a[k]);
    }
  }
  return read_a;
}

/// A rest after a discharge.
struct Rest {
  double middle_s = 0, duration_s = 0;
  double read_a = 0;  ///< mean reading
};

struct Idle {
  std::vector<Rest> rests;
  std::vector<double> read_a;  ///< all readings
};

Idle idle_of(const PreparedRecording& r, double capacity_ah) {
  Idle idle;
  const auto rests = [&](std::size_t k) {
    return std::abs(r.current_a[k]) < thresholds.facts.rest_c * capacity_ah;  // false for NaN
  };
  for (const measurement::Rows& rest : measurement::consecutive_rows(r.size(), rests)) {
    if (!discharged_before(r, rest.begin, capacity_ah)) continue;
    const std::vector<double> read_a = readings_of(r, rest);
    if (read_a.size() < idle_limits.readings) continue;
    const double from_s = r.time_s[rest.begin], to_s = r.time_s[rest.end - 1];
    idle.rests.push_back({(from_s + to_s) / 2, to_s - from_s, measurement::mean(read_a)});
    idle.read_a.insert(idle.read_a.end(), read_a.begin(), read_a.end());
  }
  return idle;
}

/// Smallest distance between two different readings.
double resolution_a(std::vector<double> read_a) {
  std::sort(read_a.begin(), read_a.end());
  double smallest = std::numeric_limits<double>::infinity();
  for (std::size_t k = 1; k < read_a.size(); ++k) {
    if (read_a[k] > read_a[k - 1]) smallest = std::min(smallest, read_a[k] - read_a[k - 1]);
  }
  return std::isfinite(smallest) ? smallest : std::abs(read_a.front());
}

}  // namespace

void add_idle_checks(PreparedRecording& r, const model::CellParameters<>& cell) {
  const Idle idle = idle_of(r, cell.capacity_ah);
  if (idle.rests.size() < idle_limits.rests) return;
  double lowest_a = idle.rests.front().read_a, highest_a = lowest_a, charge_as = 0;
  for (const Rest& rest : idle.rests) {
    lowest_a = std::min(lowest_a, rest.read_a);
    highest_a = std::max(highest_a, rest.read_a);
    charge_as += rest.read_a * rest.duration_s;
  }
  // a charger differs from rest to rest, and moves charge
  const bool charges = charge_as > idle_limits.charge_at_most * 3'600 * cell.capacity_ah;
  if (lowest_a <= 0 || highest_a - lowest_a > idle_limits.alike * highest_a || charges) return;
  // what really flows is the same in all rests: together they know the offset no better than that
  const double all = std::sqrt(static_cast<double>(idle.rests.size())),
               steady = all * std::hypot(idle_limits.true_current_c * cell.capacity_ah,
                                         idle_limits.resolution_share * resolution_a(idle.read_a));
  for (const Rest& rest : idle.rests) {
    r.checks.push_back({.channel = Check::Channel::current,
                        .time_s = rest.middle_s,
                        .current_a = rest.read_a,
                        .read = rest.read_a,
                        .reference = 0,
                        .steady = steady,
                        .unsteady = thresholds.references.unsteady_share * rest.read_a,
                        .assumed = true});
  }
}

}  // namespace bms::diagnosis
