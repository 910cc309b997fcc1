// One circuit over all recordings at all temperatures. What a cell has once is an unknown once: R0, R1, C1 and the
// parameters of its mechanisms. A recording adds what belongs to it alone: a relative change of R0 (contacts, ageing)
// and the branch position of the hysteresis at its start.
//
// The model is model::OpenLoopSimulation with the laws of the catalogue, in double and in dual numbers, so the physics
// is written once. Every row is simulated; the residual uses some of them.
//
//   residual   asinh(e / 30 mV) 30 mV / 3 mV / sqrt(n)    e: simulated minus measured, n: rows of the recording that
//                                                         are used. Each recording has the same weight
//   prior      0.1 (x - mean) / sigma                     a recording counts as a hundred independent readings
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "identification/data.hpp"
#include "identification/least_squares.hpp"
#include "model/cell_parameters.hpp"
#include "model/extended.hpp"

namespace bms::identification {

struct JointRecording {
  std::string name;                   ///< for messages
  Data data;                          ///< voltage NaN: does not count
  measurement::Column temperature_c;  ///< by row; empty: not recorded
  double initial_soc = 0;
  double current_correction_a = 0;  ///< is added to the current; see current_correction_a()
};

/// What belongs to one recording.
struct RecordingState {
  double r0_change = 0;        ///< relative
  double branch_position = 0;  ///< at the start, -1 discharge .. 1 charge
};

/// An unknown of the cell. A further mechanism is a further entry.
struct JointUnknown {
  enum class Of { r0, r1, c1, mechanism };
  Of of = Of::mechanism;  ///< r0, r1, c1: mean of the column of [rc], whose shape over SOC stays
  std::size_t mechanism = 0, parameter = 0;
  double start = 0, low = 0, high = 0;  ///< low < high
  bool positive = false;                ///< searched by its logarithm; low > 0
  double prior = 0, prior_sigma = 0;    ///< sigma 0: no prior

  std::string name() const;  ///< "r0_ohm", "slow_polarisation.resistance_ohm"
};

/// A parameter of a mechanism with the bounds of the catalogue. positive: a lower bound of 0 becomes a ten thousandth
/// of the upper one.
JointUnknown unknown_of(std::string_view mechanism, std::string_view parameter, double start, double capacity_ah,
                        bool positive);

struct JointModel {
  model::CellParameters<> cell;
  std::vector<model::MechanismSetting> mechanisms;  ///< every mechanism of an unknown is among them
  std::vector<JointUnknown> unknowns;
};

/// Place of a mechanism in the model. Throws std::invalid_argument if it is missing.
std::size_t place_of(const JointModel& model, std::size_t mechanism);

/// Mean of a column of [rc].
double mean_of(const model::Column<double, model::max_rc_nodes>& column);

struct JointFit {
  Eigen::VectorXd value, std;          ///< of the unknowns; std counts a run of residuals once
  Eigen::VectorXi at_bound;            ///< -1 lower, 1 upper, 0 inside
  std::vector<RecordingState> states;  ///< of the recordings
  std::vector<double> rmse_v;          ///< of the recordings, all rows that count
  Optimum optimum;
};

struct JointOptions {
  double r0_change_sigma = 0.2;
  std::size_t rows = 4'000;  ///< of a recording that the residual uses, evenly spread
  bool uncertainty = true;
  Stopping stopping = {.gradient = 1e-6, .step = 1e-5, .cost = 1e-6, .iterations = 40};
};

/// start: values of the unknowns to begin with; empty: those of the unknowns. Throws std::invalid_argument: no
/// recordings, or a recording without a voltage.
JointFit fit_joint(const JointModel& model, std::span<const JointRecording> recordings, const JointOptions& options,
                   const Eigen::VectorXd& start = {});

/// The cell and its mechanisms with these values of the unknowns.
JointModel with_values(const JointModel& model, const Eigen::VectorXd& value);

struct JointSimulation {
  std::vector<double> voltage_v, overpotential_v, soc;  ///< overpotential: by R0, R1 and the polarisations
};
/// Open loop, at the cell and mechanisms of the model as they are.
JointSimulation simulate(const JointModel& model, const JointRecording& recording, const RecordingState& state);

/// RMSE over the rows with a voltage; NaN without any.
double rmse_v(const Data& measured, std::span<const double> simulated_v);

/// The constant current [A] that, added to the current, makes the counted charge follow the reference best.
double current_correction_a(const Data& data, std::span<const double> soc_ref, double initial_soc);

}  // namespace bms::identification
