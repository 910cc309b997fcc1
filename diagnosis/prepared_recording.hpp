// What a diagnosis looks at: one recording and what is believed of its start.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace bms::diagnosis {

/// Instrument against a trusted one, over a stretch in which both stood still.
struct Check {
  enum class Channel { current, voltage } channel = Channel::current;
  double time_s = 0;     ///< its middle
  double current_a = 0;  ///< mean reading
  double read = 0;       ///< mean of the instrument [A or V]
  double reference = 0;  ///< mean of the trusted one
  double deviation = 1;  ///< of read less reference when the instrument is as a hypothesis has it
};

/// Columns of equal length, time_s ascending. current_a[k]: mean over the interval that ends at time_s[k], > 0 charges.
struct PreparedRecording {
  std::string name;
  std::vector<double> time_s;
  std::vector<double> current_a;      ///< NaN: no reading
  std::vector<double> voltage_v;      ///< NaN: no reading, or one that is not to be used
  std::vector<double> temperature_c;  ///< empty: not recorded
  double initial_soc = 0.5;
  double initial_soc_sigma = 0.005;  ///< how far that is believed
  bool initial_soc_given = true;     ///< by a user; otherwise read off the first voltage
  std::vector<Check> checks;         ///< reference.hpp makes them

  std::size_t size() const { return time_s.size(); }
  double duration_s() const { return time_s.empty() ? 0 : time_s.back() - time_s.front(); }
};

}  // namespace bms::diagnosis
