// The OCV curve as few straight pieces (paper, Eq. 4, Fig. 3).
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "identification/ocv_curve.hpp"

namespace bms::identification {

/// Corners of a polyline.
struct OcvPieces {
  std::vector<double> soc;         ///< first 0, last 1
  std::vector<double> ocv_v;       ///< at the corners
  std::vector<double> half_gap_v;  ///< at the corners
  /// Largest difference of polyline and curve; where the curve is steep, without the part that 0.2 % of SOC explain,
  /// and where it is steeper than a cell file accepts, from the steepest that it accepts.
  double largest_error_v = 0;
};

/// The fewest pieces that stay within error_v of the curve (or 0.2 % of SOC next to a steep part) and rise everywhere,
/// by no more than a cell file accepts; among these the polyline with the least squared error. Empty if the curve falls
/// by more than the error allows.
std::optional<OcvPieces> fewest_pieces(const OcvCurve& curve, double error_v);

/// Adds corners to the same polyline, up to `most` in all, until the half gap is straight to error_v from 5 to 97 % of
/// SOC. Then the middle plus and minus half_gap_v are the curves of charge and discharge, whose knees differ.
void add_gap_corners(OcvPieces& pieces, const OcvCurve& curve, double error_v, std::size_t most);

}  // namespace bms::identification
