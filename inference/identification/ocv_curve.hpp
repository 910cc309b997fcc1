// Open-circuit voltage over SOC from slow charge and slow discharge (paper, Fig. 2-3).
//
// The OCV of the cell is the middle between both runs. Half of their distance is kept as half gap: hysteresis and the
// small polarisation of the slow current. Where only one run has been, the half gap of the nearest common SOC is used.
// The ends at 0 and 1 are the rested voltages.
#pragma once

#include <optional>
#include <vector>

#include "identification/data.hpp"

namespace bms::identification {

/// A slow run from full to empty or back, with rests at its ends.
struct SlowRun {
  Data data;
  /// SOC of each sample; empty: counted, from 1 to 0 for a discharge and from 0 to 1 for a charge.
  measurement::Column soc;
};

/// Next to empty and full, under current, a run bends into its cut-off voltage. There the curve is a straight line to
/// the rested voltage and not measured.
inline constexpr double unmeasured_end = 0.01;

/// Voltages on an even grid of SOC from 0 to 1.
struct OcvCurve {
  std::vector<double> soc, ocv_v, half_gap_v;  ///< half_gap_v: 0 if there was only one run
  std::vector<double> charge_v, discharge_v;   ///< means of the runs; NaN where no such run has been
  double branch = 0;                           ///< of ocv_v: -1 discharges alone, 1 charges alone, 0 the middle
  double largest_a = 0;                        ///< mean of the largest currents of the runs
  double capacity_ah = 0;                      ///< mean of the charge that the runs moved
  std::optional<double> coulombic_efficiency;  ///< discharged over charged; only with a run of each kind
};

/// Throws std::invalid_argument: no run, a run that changes its direction, is faster than C/8 or covers less than 80 %
/// of SOC.
OcvCurve ocv_curve(const std::vector<SlowRun>& runs);

}  // namespace bms::identification
