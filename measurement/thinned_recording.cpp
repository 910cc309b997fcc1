#include "measurement/thinned_recording.hpp"

#include <cmath>
#include <limits>
#include <vector>

namespace bms::measurement {

namespace {

/// Mean of known readings.
class Mean {
 public:
  void add(double value, double weight) {
    if (!std::isfinite(value)) return;
    sum_ += weight * value;
    weight_ += weight;
  }
  double take() {
    const double mean = weight_ > 0 ? sum_ / weight_ : std::numeric_limits<double>::quiet_NaN();
    *this = {};
    return mean;
  }

 private:
  double sum_ = 0, weight_ = 0;
};

}  // namespace

Recording thinned(const Recording& r, std::size_t most) {
  if (r.rows() <= most) return r;
  const double step_s = r.duration_s() / static_cast<double>(most);
  Mean current, voltage, temperature;
  std::vector<double> time_s, current_a, voltage_v, temperature_c;
  double from_s = r.time_s.front();
  for (std::size_t k = 0; k < r.rows(); ++k) {
    const double duration_s = k == 0 ? 0 : r.time_s[k] - r.time_s[k - 1];
    current.add(r.current_a[k], k == 0 ? 1 : duration_s);
    if (!r.voltage_v.empty()) voltage.add(r.voltage_v[k], 1);
    if (!r.temperature_c.empty()) temperature.add(r.temperature_c[k], 1);
    if (k > 0 && r.time_s[k] - from_s < step_s && k + 1 < r.rows()) continue;
    from_s = r.time_s[k];
    time_s.push_back(from_s);
    current_a.push_back(current.take());
    if (!r.voltage_v.empty()) voltage_v.push_back(voltage.take());
    if (!r.temperature_c.empty()) temperature_c.push_back(temperature.take());
  }
  Recording out;
  out.path = r.path;
  out.time_s = std::move(time_s);
  out.current_a = std::move(current_a);
  out.voltage_v = std::move(voltage_v);
  out.temperature_c = std::move(temperature_c);
  return out;
}

}  // namespace bms::measurement
