// The linear models of the paper, and the one with a static nonlinearity behind it (3.2.1-3.2.3), from recording to
// circuit.
//
//   tf   transfer function, Eq. 11: voltage minus b0 of the OCV line
//   oe   output error, Eq. 18-22: one sample of delay, offset estimated
//   hw   Hammerstein-Wiener: oe with its output w passed through a curve of straight pieces, y = g(w), starting at
//        y = w
//
// All three minimise their simulation error, on evenly sampled data. Eq. 12-16 give the circuit. A parameter that is
// negative or not finite there is reported and not clamped.
#pragma once

#include <string>
#include <vector>

#include "identification/discrete_model.hpp"
#include "identification/identify.hpp"

namespace bms::identification {

enum class LinearKind { transfer_function, output_error, hammerstein_wiener };

/// The curve of hw: y at even steps of w, straight beyond its ends. Empty: y = w.
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
  /// Parameters b1_v, r0_ohm, r1_ohm, c1_f at the middle SOC of the recording; no initial states, no cell.
  Identification identification;
  LinearModel model;
};

/// soc: at the middle of the recording. cell: its OCV gives b0 of tf. Throws std::invalid_argument as
/// simulation_error() and start_values().
LinearIdentification identify_linear(LinearKind kind, const model::CellParameters<>& cell, const Data& data, double soc,
                                     Method method, const Stopping& stopping = {});

/// Simulation over other data; only the free response is fitted.
FitStatistics validate(const LinearModel& model, const Data& data, double fading);

}  // namespace bms::identification
