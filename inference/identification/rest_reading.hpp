// R0, R1, C1 from a current step into a rest (paper, Appendix A), without a simulation: start values and a cross-check.
//
// Each rest is read in two ways:
//   points  a: last voltage under load, b: first after the step, c: end of the rest, d = b + (1 - 1/e)(c - b),
//           T: time from b to d; R0 = (b - a) / dI, R1 = (c - b) / dI, C1 = T / R1 (Eq. A1-A5; 0.633 there is
//           1 - 1/e = 0.632). dI: change of the current.
//   fit     A + B exp(-t / tau) by least squares over the rest, t from the step. Use this one, because:
//           - A sample after the step has already relaxed a little (at 1 Hz and tau = 50 s by 2 % of R1 dI). The fit is
//             extrapolated back to the step, at the level of the first samples, so that a second, faster relaxation
//             counts as R0 no more than necessary.
//           - R1 = B / (i_r1 - i_rest), i_r1: current through R1 at the step, i.e. the current of the recording before
//             the step through a low-pass of tau. A load shorter than about 3 tau has not charged the RC element, and
//             (c - b) / dI is then too small. Before the recording the cell is assumed to rest.
//           - a is the voltage under load extrapolated to the step: the part of the RC element by tau and R1, the rest
//           by
//             a straight line.
//
// Instant of the step: the current is a mean over the interval that ends at its time, so a sample between load and rest
// gives the instant within it (its voltage is not used). If the current is a momentary value instead, the instant is
// uncertain by one sample and R0 by R1 T / tau. Sampling may be uneven. Voltages that are not finite are skipped. Cost:
// about 100 passes over each rest.
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "identification/data.hpp"

namespace bms::identification {

struct RestReadingOptions {
  double load_c_rate = 0.1;   ///< a load has at least this current
  double rest_c_rate = 0.02;  ///< a rest has less than this current
  double duration_s = 30;     ///< shortest rest
  double steady = 0.1;        ///< largest relative difference of the last loaded samples
  double largest_std = 0.25;  ///< largest relative standard deviation of tau for R1 and C1
};

/// Appendix A as printed: a is the last voltage under load, b the first one after the step, c the last one of the rest.
struct PointReading {
  double a_v = 0, b_v = 0, c_v = 0, d_v = 0;
  double time_constant_s = 0;  ///< T
  double r0_ohm = 0, r1_ohm = 0, c1_f = 0;
};

struct RestReading {
  double time_s = 0;  ///< of the step
  double rest_s = 0;  ///< from there to the end of the rest
  double load_a = 0;  ///< before the step, > 0: charging
  double r0_ohm = 0, r1_ohm = 0, tau_s = 0, c1_f = 0;
  double r0_std_ohm = 0, r1_std_ohm = 0, tau_std_s = 0, c1_std_f = 0;  ///< for white residuals
  double residual_v = 0;                                               ///< RMS of the residual of the fit
  double relaxed_fraction = 0;  ///< part of the relaxation within the rest, 1 - exp(-rest / tau)
  bool r0_usable = false;       ///< finite and positive
  bool rc_usable = false;       ///< R1 and C1 as well, and tau is known to largest_std
  PointReading points;
};

struct RestReadings {
  std::vector<RestReading> rests;
  std::size_t r0_from = 0, rc_from = 0;  ///< number of rests that the medians use
  /// Medians over the usable rests; NaN without a usable rest.
  double r0_ohm = std::numeric_limits<double>::quiet_NaN();
  double r1_ohm = r0_ohm, tau_s = r0_ohm, c1_f = r0_ohm;
  std::string reason;  ///< a sentence if a median is NaN, otherwise empty
};

/// Throws std::invalid_argument: columns of different length, capacity_ah not positive, time that does not rise, a
/// current that is not finite.
RestReadings read_rests(const Data& data, const RestReadingOptions& options = {});

}  // namespace bms::identification
