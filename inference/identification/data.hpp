// The data of an identification: one stretch of a recording, evenly or unevenly sampled.
#pragma once

#include <cstddef>

#include "measurement/column.hpp"

namespace bms::identification {

/// Columns of equal length. current_a[k]: mean over the interval that ends at time_s[k], > 0 charges; voltage_v[k]: at
/// time_s[k].
struct Data {
  measurement::Column time_s;
  measurement::Column current_a;
  measurement::Column voltage_v;  ///< NaN: does not count
  double capacity_ah = 0;
  std::size_t size() const { return time_s.size(); }
};

}  // namespace bms::identification
