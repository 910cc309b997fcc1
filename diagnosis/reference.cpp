#include "diagnosis/reference.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace bms::diagnosis {

namespace {

constexpr double longest_s = 300;
constexpr double settling = 0.1;           // share of a stretch in which a filtered channel may still be on its way
constexpr double unsteady = 0.05;          // an instrument that is off is not off by quite the same at all times
constexpr double reference_v = 3e-4;       // of a trusted meter, and of a quiet channel in minutes
constexpr double reference_c_rate = 3e-5;  // the same of a current, in multiples of 1C

struct Stretch {
  std::size_t first = 0, last = 0;
};

/// Consecutive rows with a reference that stands still within `still`.
std::vector<Stretch> stretches(const std::vector<double>& time_s, std::span<const double> reference, double still) {
  std::vector<Stretch> all;
  bool inside = false;
  for (std::size_t k = 0; k < reference.size(); ++k) {
    if (!std::isfinite(reference[k])) {
      inside = false;
      continue;
    }
    const bool goes_on = inside && std::abs(reference[k] - reference[all.back().first]) <= still &&
                         time_s[k] - time_s[all.back().first] <= longest_s;
    if (goes_on)
      all.back().last = k;
    else
      all.push_back({k, k});
    inside = true;
  }
  return all;
}

void add(PreparedRecording& r, Check::Channel channel, const std::vector<double>& read,
         std::span<const double> reference, double still, const model::CellParameters<>& cell) {
  for (const Stretch& s : stretches(r.time_s, reference, still)) {
    const double from_s = r.time_s[s.first] + settling * (r.time_s[s.last] - r.time_s[s.first]);
    Check c;
    c.channel = channel;
    double n = 0;
    for (std::size_t k = s.first; k <= s.last; ++k) {
      if (r.time_s[k] < from_s || !std::isfinite(read[k])) continue;
      c.time_s += r.time_s[k], c.read += read[k], c.reference += reference[k];
      if (std::isfinite(r.current_a[k])) c.current_a += r.current_a[k];
      ++n;
    }
    if (n < 1) continue;
    c.time_s /= n, c.current_a /= n, c.read /= n, c.reference /= n;
    c.deviation = check_deviation(channel, c.read - c.reference, n, cell);
    r.checks.push_back(c);
  }
}

}  // namespace

double check_deviation(Check::Channel channel, double apart, double readings, const model::CellParameters<>& cell) {
  const bool voltage = channel == Check::Channel::voltage;
  const double noise = voltage ? cell.noise.voltage_v : cell.noise.current_a,
               own = voltage ? reference_v : reference_c_rate * cell.capacity_ah;
  return std::sqrt(noise * noise / readings + own * own + unsteady * unsteady * apart * apart);
}

void average_references(PreparedRecording& r, std::span<const double> current_ref_a,
                        std::span<const double> voltage_ref_v, const model::CellParameters<>& cell) {
  add(r, Check::Channel::current, r.current_a, current_ref_a, 0.02 * cell.capacity_ah, cell);
  add(r, Check::Channel::voltage, r.voltage_v, voltage_ref_v, 0.02, cell);
  if (current_ref_a.empty() || voltage_ref_v.empty()) return;
  for (std::size_t k = 0; k < r.size(); ++k) {
    if (current_ref_a[k] == 0 && std::isfinite(voltage_ref_v[k]))
      r.voltage_v[k] = std::numeric_limits<double>::quiet_NaN();
  }
}

}  // namespace bms::diagnosis
