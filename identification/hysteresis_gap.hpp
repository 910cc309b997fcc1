// Slow charge and slow discharge differ by hysteresis, which hardly depends on the temperature, and by the overvoltage
// of the slow current, which grows in the cold. Runs at several temperatures separate both:
//
//   half gap (T) = M + U a(T)     a(T) = exp(E / R_gas (1 / T - 1 / T_ref)),  T_ref: the cell file's reference
//   temperature
#pragma once

#include <optional>
#include <vector>

#include "identification/ocv_curve.hpp"

namespace bms::identification {

struct GapAtTemperature {
  double temperature_c = 0;
  double half_gap_v = 0;  ///< mean over the middle of the curve
};

struct SlowGap {
  double hysteresis_v = 0;          ///< M >= 0
  double overvoltage_v = 0;         ///< U >= 0, of the slow current at T_ref
  double activation_j_per_mol = 0;  ///< E, 10 to 80 kJ/mol
  double residual_v = 0;            ///< RMS
};

/// Mean half gap between 20 and 80 % of SOC; empty for a single kind of run.
std::optional<double> plateau_half_gap_v(const OcvCurve& curve);

/// Least squares. Empty with fewer than three temperatures, or if they span less than 20 K.
std::optional<SlowGap> slow_gap(const std::vector<GapAtTemperature>& gaps, double reference_c);

}  // namespace bms::identification
