// The linear models of the paper, and the one with static nonlinearities around it (3.2.1-3.2.3), from recording to
// circuit.
//
//   tf   transfer function, Eq. 11: voltage minus b0 of the OCV line
//   oe   output error, Eq. 18-22: one sample of delay, offset estimated
//   hw   Hammerstein-Wiener: oe between two curves (hammerstein_wiener.hpp)
//
// All three minimise their simulation error, on evenly sampled data; others are resampled (resample.hpp), which a
// warning says. Eq. 12-16 give the
// circuit. A parameter that is negative or not finite there is reported and not clamped.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "identification/circuit_from_discrete.hpp"
#include "identification/hammerstein_wiener.hpp"
#include "identification/identify.hpp"

namespace bms::identification {

enum class LinearKind { transfer_function, output_error, hammerstein_wiener };

struct LinearModel {
  LinearKind kind = LinearKind::transfer_function;
  HammersteinWiener blocks;  ///< of tf and oe only the linear block
};

struct LinearIdentification {
  /// Parameters b1_v, r0_ohm, r1_ohm, c1_f at the middle SOC of the recording, and the polynomials; no initial states,
  /// no cell.
  Identification identification;
  LinearModel model;
  Data data;  ///< that the model was identified from: even, resampled if the recording was not
};

struct LinearOptions {
  /// Circuit to start from, as the paper does with Appendix A through Eq. 12-16; empty: start values without a search
  /// (start_values()). hw starts from the oe that this start leads to, with its curves
  /// identified around it.
  std::optional<CircuitParameters> start = std::nullopt;
  Stopping stopping = {};
};

/// soc: at the middle of the recording. cell: its OCV gives b0 of tf and the start of the curve of hw. Throws
/// std::invalid_argument as simulation_error() and start_values().
LinearIdentification identify_linear(LinearKind kind, const model::CellParameters<>& cell, const Data& data, double soc,
                                     Method method, const LinearOptions& options = {});

/// Simulation over other data, resampled if they are uneven; only the free response is fitted.
FitStatistics validate(const LinearModel& model, const Data& data, double fading);

}  // namespace bms::identification
