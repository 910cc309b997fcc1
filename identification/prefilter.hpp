// Current filter before an identification (paper, 3.1): second-order Butterworth low-pass, and removal of the sensor's
// offset.
//
// Either direction only (causal: the current comes out late, so the voltage must be filtered alike) or forward and
// backward (zero phase: in time, attenuation twice, 6 dB at the cutoff). Evenly sampled data only.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "identification/data.hpp"

namespace bms::identification {

/// Largest deviation of a step from the median step that still counts as even sampling, relative.
inline constexpr double largest_jitter = 0.01;

/// Median step [s]. Throws std::invalid_argument: fewer than two samples, time that does not rise, jitter above
/// largest_jitter.
double even_step_s(const std::vector<double>& time_s);

/// (b0 + b1 z^-1 + b2 z^-2) / (1 + a1 z^-1 + a2 z^-2), gain 1 at frequency 0.
struct SecondOrderFilter {
  std::array<double, 3> b;
  std::array<double, 3> a;  ///< a[0] = 1
};

/// Butterworth by the bilinear transform with the cutoff (3 dB) prewarped: Oppenheim and Schafer, Discrete-Time Signal
/// Processing, 7.1. Throws std::invalid_argument unless 0 < cutoff_hz < sample_rate_hz / 2.
SecondOrderFilter butterworth_low_pass(double cutoff_hz, double sample_rate_hz);

/// One pass, begun in the steady state of the first value: a constant comes out unchanged from the first sample on.
/// Throws std::invalid_argument when a value is not finite.
std::vector<double> filter_causal(const SecondOrderFilter& filter, const std::vector<double>& values);

/// Forward and backward over the values and 9 more at each end, mirrored through the end point, each pass begun in the
/// steady state (Gustafsson 1996 treats the choice; this one is scipy.signal.filtfilt's default). Throws
/// std::invalid_argument: fewer than 10 values, one not finite.
std::vector<double> filter_zero_phase(const SecondOrderFilter& filter, const std::vector<double>& values);

/// What counts as a rest of the current.
struct RestCriterion {
  double current_c_rate =
      0.02;  ///< |i| below this times the capacity [1/h]; a lasting trickle below it would be taken for offset
  double duration_s = 30;  ///< for at least so long
};

struct Offset {
  double current_a = 0;      ///< mean over the rests, 0 when there is none
  double current_std_a = 0;  ///< of that mean, as if every sample were new
  std::size_t samples = 0;   ///< it is the mean of; 0: no rest, nothing known
};

/// Zero error of the current sensor. A rest's first and last two samples are left out: a step may lie within their
/// interval; a single spike does not end a rest (median of five). Sampling may be uneven. Throws std::invalid_argument
/// unless capacity_ah > 0.
Offset offset_at_rest(const Data& data, const RestCriterion& criterion = {});

enum class Phase { causal, zero };

struct Prefilter {
  double cutoff_hz = 0.1;
  Phase phase = Phase::zero;
  bool remove_offset = true;
  RestCriterion rest = {};
};

struct Prefiltered {
  Data data;      ///< time as before; current filtered, and the voltage too when the phase is causal: both late alike
  Offset offset;  ///< what was subtracted; samples = 0: nothing
};

/// Subtracts the offset, then filters. Throws std::invalid_argument as the functions above; the voltage may lack values
/// (NaN) at Phase::zero only.
Prefiltered prefilter(const Data& data, const Prefilter& settings = {});

}  // namespace bms::identification
