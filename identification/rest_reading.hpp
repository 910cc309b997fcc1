// R0, R1, C1 read from a current step into a rest (paper, Appendix A), without a simulation: start values and a
// cross-check.
//
// Two readings of each rest:
//   points  a: last voltage under load, b: first after the step, c: end of the rest, d = b + (1 - 1/e)(c - b), T: time
//   from b to d;
//           R0 = (b - a) / dI, R1 = (c - b) / dI, C1 = T / R1 (Eq. A1-A5; 0.633 there is 1 - 1/e = 0.632). dI: change
//           of the current.
//   fit     A + B exp(-t / tau) by least squares over the rest, t from the step. The one to use:
//           - A sample after the step has already relaxed a little (at 1 Hz and tau = 50 s by 2 % of R1 dI); the fit is
//           carried back to the step,
//             at the level of the first samples, so that a second, faster relaxation is not counted as R0 more than it
//             must.
//           - R1 = B / (i_v - i_rest), i_v: the current as the RC element has felt it, i through a low-pass of tau over
//           the record before
//             the step. A load shorter than about 3 tau has not charged the element, and (c - b) / dI is then too
//             small. Before the record: rest.
//           - a is the voltage under load carried on to the step: the RC element's part by tau and R1, the rest of it a
//           straight line.
// The step's instant: current is a mean over the interval that ends at its time, so a sample between load and rest says
// when within it (its voltage is not used). Where the current is a momentary value instead, the instant is uncertain by
// one sample and R0 by R1 T / tau. Sampling may be uneven. Voltages that are not finite are passed over. Cost: about
// 100 passes over each rest.
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "identification/data.hpp"

namespace bms::identification {

struct RestReadingOptions {
  double load_c_rate = 0.1;   ///< |i| of at least this times the capacity [1/h] is a load
  double rest_c_rate = 0.02;  ///< |i| below this is a rest
  double duration_s = 30;     ///< a rest lasts at least so long
  double steady = 0.1;        ///< the last loaded samples differ by less than this part
  double largest_std = 0.25;  ///< relative standard deviation of tau up to which a rest counts for R1 and C1
};

/// Appendix A word by word, but a, b, c from the median of the neighbours where there are any within 1 % of the rest.
struct PointReading {
  double a_v = 0, b_v = 0, c_v = 0, d_v = 0;
  double time_constant_s = 0;  ///< T
  double r0_ohm = 0, r1_ohm = 0, c1_f = 0;
};

struct RestReading {
  double time_s = 0;  ///< of the step
  double rest_s = 0;  ///< from there to the end of the rest
  double load_a = 0;  ///< before the step, > 0 charged
  double r0_ohm = 0, r1_ohm = 0, tau_s = 0, c1_f = 0;
  double r0_std_ohm = 0, r1_std_ohm = 0, tau_std_s = 0, c1_std_f = 0;  ///< as if what the fit leaves were white
  double residual_v = 0;                                               ///< root mean square of what the fit leaves
  double relaxed_fraction = 0;  ///< part of the relaxation seen, 1 - exp(-rest / tau)
  bool r0_usable = false;       ///< finite and positive
  bool rc_usable = false;       ///< and so are R1 and C1, and tau is known to largest_std
  PointReading points;
};

struct RestReadings {
  std::vector<RestReading> rests;
  std::size_t r0_from = 0, rc_from = 0;  ///< how many of them the medians are of
  /// Medians over the usable rests, NaN without one.
  double r0_ohm = std::numeric_limits<double>::quiet_NaN();
  double r1_ohm = r0_ohm, tau_s = r0_ohm, c1_f = r0_ohm;
  std::string reason;  ///< a sentence where a median is NaN, else empty
};

/// Throws std::invalid_argument: columns of different length, capacity_ah not positive, time that does not rise, a
/// current that is not finite.
RestReadings read_rests(const Data& data, const RestReadingOptions& options = {});

}  // namespace bms::identification
