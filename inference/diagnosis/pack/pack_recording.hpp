// A recording of a pack of cells in series, as the diagnosis of the pack uses it.
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

namespace bms::diagnosis::pack {

/// A missing reading.
inline constexpr double no_value = std::numeric_limits<double>::quiet_NaN();

/// All columns have the same number of rows; time_s does not decrease. NaN: no reading.
/// current_a[k]: mean over the interval that ends at time_s[k], or the reading at that time; > 0 charges.
struct PackRecording {
  std::vector<double> time_s, current_a;
  std::vector<double> soc;                    ///< of the median cell, as the filter estimates it
  std::vector<std::vector<double>> cell_v;    ///< one column for each cell
  std::vector<std::vector<double>> sensor_c;  ///< one column for each temperature sensor, spread evenly over the cells
  std::vector<double> pack_v;                 ///< empty: no voltmeter of the pack
  bool single_readings = false;               ///< what current_a is (current_kind.hpp)
  double count_walk = 0;                      ///< [SOC] error of the counted charge after an hour; grows with sqrt(t)
  double usual_step_s = 0;                    ///< between rows; set with single_readings
  std::string charge_unknown;                 ///< why the counted charge does not test the sensor; empty: it does

  std::size_t rows() const { return time_s.size(); }
  std::size_t cells() const { return cell_v.size(); }
};

}  // namespace bms::diagnosis::pack
