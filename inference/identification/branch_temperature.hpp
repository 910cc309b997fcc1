// How the branches of slow charge and slow discharge depend on the temperature: the laws branch_temperature and
// entropic_ocv of the model, from slow runs at several temperatures.
//
//   discharge(T) = discharge(T_ref) + (T - T_ref) dU/dT - (M g + s) a(T)
//   charge(T)    = charge(T_ref)    + (T - T_ref) dU/dT + (M g - s) a(T)     a(T) = exp(E / R (1/T - 1/T_ref)) - 1
//
// with s = w M g, w linear in SOC. Near empty the discharge branch moves alone (w near 1), near full the charge branch.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "identification/ocv_curve.hpp"
#include "model/mechanisms/branch_temperature.hpp"
#include "model/mechanisms/entropic_ocv.hpp"

namespace bms::identification {

struct CurveAtTemperature {
  double temperature_c = 0;
  OcvCurve curve;
};

struct BranchLaws {
  /// Parameters of branch_temperature for a half gap M of 1 V: its g in V.
  std::array<double, model::BranchTemperature::parameters.size()> branches{};
  std::array<double, model::EntropicOcv::parameters.size()> entropic{};
  double residual_v = 0;  ///< RMS of both branches at all temperatures, 6 to 95 % SOC
};

/// Robust least squares. Empty with fewer than three temperatures that have both kinds of run, or if they span less
/// than 20 K.
std::optional<BranchLaws> fit_branches(const std::vector<CurveAtTemperature>& curves, double reference_c);

/// The curve at the reference temperature of the laws, from one at another temperature.
OcvCurve moved_to_reference(const CurveAtTemperature& from, const BranchLaws& laws);

/// Parameters of branch_temperature for this half gap M [V], within their bounds.
std::array<double, model::BranchTemperature::parameters.size()> for_half_gap(const BranchLaws& laws, double half_gap_v);

}  // namespace bms::identification
