// Quantities that are read off a recording directly, without a model: the measurements that confirm a diagnosis.
#pragma once

#include <cstddef>
#include <vector>

#include "measurement/recording.hpp"
#include "measurement/spans.hpp"
#include "proof/findings.hpp"
#include "workflow/diagnosis_result.hpp"

namespace bms::proof {

/// Range of a number, by default of the state of charge.
struct Range {
  double from = -1, to = 2;  ///< everything
};

/// Reads a key with two numbers, [from, to]. Throws BadInput.
Range read_range(files::TomlTable& table, const std::string& key);

/// RMS of measured minus simulated voltage [V] where soc_ref is in the range.
double rms_error_v(const workflow::RecordingComparison& c, const std::vector<double>& simulated_v, Range range = {});

/// Mean voltage [V] of a slow charge or discharge within 2 % around a state of charge, at more than half of its largest
/// current. NaN if it never is there.
double slow_voltage_v(const measurement::Recording& r, double soc);

/// Mean magnitude of the current [A] of a slow charge or discharge, without its rests.
double slow_current_a(const measurement::Recording& r);

/// Ohmic resistance [ohm]: median of voltage step over current step where the current changes by 1 A or more within
/// 1.5 s, with the standard error of that median.
Value edge_resistance_ohm(const measurement::Recording& r);

/// Rests, |current| < 20 mA, of at least that duration.
std::vector<measurement::Rows> rests(const measurement::Recording& r, double at_least_s);

/// The current that is read while none flows and the channel is on. In the rests of the cycler itself the channel is
/// off and reads exactly 0.
Value idle_current_a(const measurement::Recording& r);

}  // namespace bms::proof
