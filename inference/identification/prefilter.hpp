// Current filter before an identification (paper, 3.1): second-order Butterworth low-pass, and removal of the offset of
// the current sensor.
//
// Causal (forward only): the current is delayed, so the voltage must pass the same filter. Zero phase (forward and
// backward): no delay, twice the attenuation, 6 dB at the cutoff. Evenly sampled data only.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "identification/data.hpp"

namespace bms::identification {

/// Largest deviation of a step from the median step that still counts as even sampling, relative.
inline constexpr double largest_jitter = 0.01;

/// Median step [s]. Throws std::invalid_argument: fewer than two samples, time that does not rise, jitter above
/// largest_jitter.
double even_step_s(std::span<const double> time_s);

/// (b0 + b1 z^-1 + b2 z^-2) / (1 + a1 z^-1 + a2 z^-2), gain 1 at frequency 0.
struct SecondOrderFilter {
  std::array<double, 3> b;
  std::array<double, 3> a;  ///< a[0] = 1
};

/// Butterworth by the bilinear transform with the cutoff (3 dB) prewarped: Oppenheim and Schafer, Discrete-Time Signal
/// Processing, 7.1. Throws std::invalid_argument unless 0 < cutoff_hz < sample_rate_hz / 2.
SecondOrderFilter butterworth_low_pass(double cutoff_hz, double sample_rate_hz);

/// One pass that starts in the steady state of the first value, so that a constant does not change.
/// Throws std::invalid_argument when a value is not finite.
std::vector<double> filter_causal(const SecondOrderFilter& filter, std::span<const double> values);

/// Forward and backward over the values and 9 more at each end, mirrored through the end point. Each pass starts in the
/// steady state (Gustafsson 1996 discusses the choice; this is the default of scipy.signal.filtfilt). Throws
/// std::invalid_argument: fewer than 10 values, one not finite.
std::vector<double> filter_zero_phase(const SecondOrderFilter& filter, std::span<const double> values);

/// When the current counts as at rest.
struct RestCriterion {
  double current_c_rate = 0.02;  ///< largest |current|; a lasting smaller current would be taken for offset
  double duration_s = 30;        ///< shortest rest
};

struct Offset {
  double current_a = 0;      ///< mean over the rests; 0 without a rest
  double current_std_a = 0;  ///< standard deviation of the mean, for white noise
  std::size_t samples = 0;   ///< number of samples at rest; 0: the offset is not known
};

/// Offset of the current sensor. The first and last two samples of a rest are left out, because a step may lie within
/// their interval. A single spike does not end a rest (median of five). Sampling may be uneven. Throws
/// std::invalid_argument unless capacity_ah > 0.
Offset offset_at_rest(const Data& data, const RestCriterion& criterion = {});

enum class Phase { causal, zero };

struct Prefilter {
  double cutoff_hz = 0.1;
  Phase phase = Phase::zero;
  bool remove_offset = true;
  RestCriterion rest = {};
};

struct Prefiltered {
  Data data;      ///< filtered current; with a causal phase also the voltage, so that both have the same delay
  Offset offset;  ///< subtracted from the current; samples = 0: nothing
};

/// Subtracts the offset, then filters. Throws std::invalid_argument as the functions above; the voltage may lack values
/// (NaN) at Phase::zero only.
Prefiltered prefilter(const Data& data, const Prefilter& settings = {});

}  // namespace bms::identification
