// The load over time: current, temperature and, when a recording is replayed, voltage and reference state of charge.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "measurement/recording.hpp"
#include "model/temperature.hpp"

namespace bms::hil {

/// A cursor on a recording, which must outlive it. Times are seconds since its first row.
class LoadProfile {
 public:
  explicit LoadProfile(const measurement::Recording& recording) : recording_(recording) {}

  double duration_s() const { return recording_.time_s.back() - recording_.time_s.front(); }
  /// Moves to the first row at or after `time_s`. Times must not decrease from call to call.
  void go_to(double time_s) {
    while (row_ + 1 < recording_.rows() && recording_.time_s[row_] - recording_.time_s.front() < time_s) ++row_;
  }
  /// Mean over the interval that ends at the row; 0 if missing.
  double current_a() const { return std::isfinite(recording_.current_a[row_]) ? recording_.current_a[row_] : 0; }
  double temperature_c() const {
    const bool missing = recording_.temperature_c.empty() || !std::isfinite(recording_.temperature_c[row_]);
    return missing ? model::assumed_ambient_c : recording_.temperature_c[row_];
  }
  /// Interpolated linearly between the rows.
  double voltage_v(double time_s) const { return interpolated(recording_.voltage_v, time_s); }
  /// Of one cell, from 0: its own column if the recording has one, else the column of the mean.
  double cell_voltage_v(std::size_t cell, double time_s) const {
    const auto& cells = recording_.cell_voltage_v;
    return interpolated(cell < cells.size() ? cells[cell] : recording_.voltage_v, time_s);
  }
  /// Interpolated linearly between the rows; NaN without a column soc_ref.
  double soc_ref(double time_s) const {
    return recording_.soc_ref.empty() ? std::nan("") : interpolated(recording_.soc_ref, time_s);
  }

 private:
  double interpolated(const measurement::Column& column, double time_s) const {
    if (row_ == 0) return column[0];
    const double from_s = recording_.time_s[row_ - 1] - recording_.time_s.front(),
                 to_s = recording_.time_s[row_] - recording_.time_s.front();
    const double t = to_s > from_s ? std::clamp((time_s - from_s) / (to_s - from_s), 0.0, 1.0) : 1;
    return column[row_ - 1] + t * (column[row_] - column[row_ - 1]);
  }

  const measurement::Recording& recording_;
  std::size_t row_ = 0;
};

}  // namespace bms::hil
