// The data of an identification: one stretch of a recording, evenly or unevenly sampled.
#pragma once

#include <cstddef>
#include <vector>

namespace bms::identification {

/// Columns of equal length. current_a[k]: mean over the interval that ends at time_s[k], > 0 charges; voltage_v[k]: at
/// time_s[k].
struct Data {
  std::vector<double> time_s;
  std::vector<double> current_a;
  std::vector<double> voltage_v;
  double capacity_ah = 0;
  std::size_t size() const { return time_s.size(); }
};

}  // namespace bms::identification
