// The linear models of the paper, and the one with a static nonlinearity behind them (3.2.1-3.2.3), from record to
// circuit.
//
//   tf   transfer function, Eq. 11: voltage less the OCV line's b0
//   oe   output error, Eq. 18-22: one sample of delay, offset estimated
//   hw   Hammerstein-Wiener: oe, its output w through a curve of straight pieces, y = g(w), begun as y = w
//
// All three are fitted by their simulation error, on evenly sampled data. The circuit comes out through Eq. 12-16; what
// is negative or not finite there is said, not clipped.
#pragma once

#include <string>
#include <vector>

#include "identification/discrete_model.hpp"
#include "identification/identify.hpp"

namespace bms::identification {

enum class LinearKind { transfer_function, output_error, hammerstein_wiener };

/// The curve of hw: y at even steps of w, carried on straight beyond its ends. Empty: y = w.
struct StaticCurve {
  double w_from_v = 0, w_step_v = 0;
  std::vector<double> y_v;
};

struct LinearModel {
  LinearKind kind = LinearKind::transfer_function;
  Structure structure;
  DiscreteModel model;
  StaticCurve curve;
};

struct LinearIdentification {
  Identification identification;  ///< parameters b1_v, r0_ohm, r1_ohm, c1_f at the middle soc of the record; no initial
                                  ///< states, no cell
  LinearModel model;
};

/// soc: of the record's middle. ocv: for b0 of tf. Throws std::invalid_argument as simulation_error() and
/// start_values().
LinearIdentification identify_linear(LinearKind kind, const model::CellParameters<>& cell, const Data& data, double soc,
                                     Method method, const Stopping& stopping = {});

/// Simulation over other data; only its free response is fitted.
FitStatistics validate(const LinearModel& model, const Data& data, double fading);

}  // namespace bms::identification
