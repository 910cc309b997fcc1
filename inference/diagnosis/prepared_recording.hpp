// The input of a diagnosis: one recording, its initial state of charge, and checks of its instruments.
#pragma once

#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "measurement/column.hpp"

namespace bms::diagnosis {

/// An instrument compared with a trusted one over a stretch in which both stood still.
struct Check {
  enum class Channel { current, voltage } channel = Channel::current;
  double time_s = 0;     ///< its middle
  double current_a = 0;  ///< mean reading
  double read = 0;       ///< mean of the instrument [A or V]
  double reference = 0;  ///< mean of the trusted one [A or V]
  double steady = 1;     ///< part of the deviation that does not grow with the instrument's error [A or V]
  double unsteady = 0;   ///< part that does
  bool assumed = false;  ///< there was no trusted instrument: the reference is what must flow (idle_reading.hpp)
  /// Standard deviation of read less reference if the hypothesis holds. times: factor on the steady part.
  double deviation(double times = 1) const { return std::hypot(times * steady, unsteady); }
};

/// The columns are those of the recording, except for values that a check has removed. Equal length, time_s ascending.
/// current_a[k]: mean over the interval that ends at time_s[k], > 0 charges.
struct PreparedRecording {
  std::string name;
  measurement::Column time_s;
  measurement::Column current_a;      ///< NaN: no reading
  measurement::Column voltage_v;      ///< NaN: no reading, or one that must not be used
  measurement::Column temperature_c;  ///< empty: not recorded
  double initial_soc = 0.5;
  double initial_soc_sigma = 0.005;        ///< its standard deviation
  bool initial_soc_given = true;           ///< by a user; otherwise derived from the first voltage
  std::vector<Check> checks = {};          ///< made by reference.hpp
  measurement::Column current_ref_a = {};  ///< of a trusted ammeter that read in nearly all rows; else empty
  measurement::Column voltage_ref_v = {};  ///< the same of a voltmeter
  bool trusted_current = false, trusted_voltage = false;   ///< current_a and voltage_v are theirs
  std::optional<double> other_initial_soc = std::nullopt;  ///< what a reference or the first voltage states, where it
                                                           ///< contradicts initial_soc

  std::size_t size() const { return time_s.size(); }
  double duration_s() const { return time_s.empty() ? 0 : time_s.back() - time_s.front(); }
};

}  // namespace bms::diagnosis
