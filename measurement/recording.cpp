#include "measurement/recording.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace bms::measurement {

namespace {

std::int32_t micro(double value) {
  if (std::isnan(value)) return no_reading;
  constexpr double limit = std::numeric_limits<std::int32_t>::max();
  return static_cast<std::int32_t>(std::llround(std::clamp(value * 1e6, -limit, limit)));
}

std::int16_t centidegrees(double value) {
  if (std::isnan(value)) return no_temperature;
  constexpr double limit = std::numeric_limits<std::int16_t>::max();
  return static_cast<std::int16_t>(std::lround(std::clamp(value * 100, -limit, limit)));
}

bool is_voltage_of_the_cell(const Recording& r, std::size_t row) {
  if (r.voltage_ref_v.empty() || r.current_ref_a.empty()) return true;
  return !(r.current_ref_a[row] == 0 && std::isfinite(r.voltage_ref_v[row]));
}

}  // namespace

Sample sample_of(double time_s, double current_a, double voltage_v, double temperature_c) {
  return {static_cast<std::uint64_t>(std::llround(time_s * 1e6)), micro(current_a), micro(voltage_v),
          centidegrees(temperature_c)};
}

std::span<const Sample> SampleList::part(std::size_t first, std::size_t count, std::vector<Sample>& space) const {
  const std::size_t end = first + std::min(count, size() - first);
  if (recording_ == nullptr) return list_.subspan(first, end - first);
  const Recording& r = *recording_;
  constexpr double missing = std::numeric_limits<double>::quiet_NaN();
  space.clear();
  for (std::size_t k = first; k < end; ++k) {
    const bool voltage = !r.voltage_v.empty() && is_voltage_of_the_cell(r, k);
    space.push_back(sample_of(r.time_s[k] - r.time_s.front(), r.current_a[k], voltage ? r.voltage_v[k] : missing,
                              r.temperature_c.empty() ? missing : r.temperature_c[k]));
  }
  return space;
}

std::vector<Sample> samples(const Recording& recording) {
  std::vector<Sample> all;
  all.reserve(recording.rows());
  SampleList(recording).part(0, recording.rows(), all);
  return all;
}

Recording cell(const Recording& pack, std::size_t index) {
  Recording one = pack;
  one.voltage_v = pack.cell_voltage_v[index];
  if (!pack.cell_temperature_c.empty()) {
    // sensors are spread evenly over the cells
    one.temperature_c = pack.cell_temperature_c[index * pack.cell_temperature_c.size() / pack.cell_voltage_v.size()];
  }
  one.cell_voltage_v.clear();
  one.cell_temperature_c.clear();
  one.pack_voltage_v = {};
  one.soc_ref = {};  // of the pack
  one.voltage_ref_v = {};
  return one;
}

}  // namespace bms::measurement
