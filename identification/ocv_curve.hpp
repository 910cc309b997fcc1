// Open-circuit voltage over soc from slow charge and discharge, as straight pieces (Eq. 4, Fig. 2-3).
//
// The cell's OCV is taken in the middle between the two runs; half the distance is kept: hysteresis and what little
// polarisation the slow current leaves. Where only one run reaches, the other's distance is carried on; at 0 and 1 the
// rested voltages anchor.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "identification/data.hpp"

namespace bms::identification {

/// A slow run from full to empty or back, with rests at its ends.
struct SlowRun {
  Data data;
  std::vector<double>
      soc;  ///< of each sample; empty: counted, taking discharges to begin at 1 and end at 0, charges the other way
};

/// Voltages on an even grid of soc from 0 to 1.
struct OcvCurve {
  std::vector<double> soc, ocv_v, half_gap_v;  ///< half_gap_v: 0 when there was one run only
  double capacity_ah = 0;                      ///< mean of what the runs moved from end to end
  std::optional<double> coulombic_efficiency;  ///< discharged over charged; only with a run of each kind
};

/// Throws std::invalid_argument: no run, a run that changes direction, faster than C/8 or narrower than 80 % of soc.
OcvCurve ocv_curve(const std::vector<SlowRun>& runs);

/// Corners of a polyline.
struct OcvPieces {
  std::vector<double> soc;         ///< first 0, last 1
  std::vector<double> ocv_v;       ///< at the corners
  std::vector<double> half_gap_v;  ///< at the corners
  double largest_error_v =
      0;  ///< of the polyline against the curve; where the curve is steep, what 0.2 % of soc do not explain
};

/// The fewest pieces that stay within error_v of the curve, or 0.2 % of soc aside where it plunges, and rise
/// everywhere; of those the one with the least squared error. Nothing when the curve falls by more than that error
/// allows.
std::optional<OcvPieces> fewest_pieces(const OcvCurve& curve, double error_v);

/// More corners on the same polyline, at most `most` in all, until the gap between them is straight to error_v from 5
/// to 97 % of soc: then middle plus and less half_gap_v are the curves of charge and discharge, whose knees lie apart.
void add_gap_corners(OcvPieces& pieces, const OcvCurve& curve, double error_v, std::size_t most);

}  // namespace bms::identification
