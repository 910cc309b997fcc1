// What a diagnosis looks at: one recording and what is believed of its start.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace bms::diagnosis {

/// Columns of equal length, time_s ascending. current_a[k]: mean over the interval that ends at time_s[k], > 0 charges.
struct Record {
  std::string name;
  std::vector<double> time_s;
  std::vector<double> current_a;      ///< NaN: no reading
  std::vector<double> voltage_v;      ///< NaN: no reading, or one that is not to be used
  std::vector<double> temperature_c;  ///< empty: not recorded
  double initial_soc = 0.5;
  double initial_soc_sigma = 0.005;   ///< how far that is believed
  bool initial_soc_told = true;       ///< by a user; otherwise read off the first voltage

  std::size_t size() const { return time_s.size(); }
  double duration_s() const { return time_s.empty() ? 0 : time_s.back() - time_s.front(); }
};

}  // namespace bms::diagnosis
