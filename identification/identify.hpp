// A fit of one model to recordings by one optimiser, with all that says how far to believe it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "identification/grey_box.hpp"
#include "identification/least_squares.hpp"
#include "identification/residuals.hpp"
#include "identification/uncertainty.hpp"

namespace bms::identification {

struct Parameter {
  std::string name;  ///< with its unit: "r0_ohm"
  double soc = 0;    ///< of the node; 0 where it belongs to none
  double value = 0;
  double std = 0;               ///< by the residuals, a run of them counting once; 0 when held at a bound
  double std_white = 0;         ///< as if every residual were new
  double by_ocv_tolerance = 0;  ///< how far it would move if the OCV were off by its tolerance
  bool at_bound = false;
  bool identifiable = true;                            ///< false: the data does not depend on it
  std::optional<double> temperature_c = std::nullopt;  ///< where recordings of several were identified
};

/// How well a model follows the voltage of recordings.
struct FitStatistics {
  double fit_percent = 0;  ///< Eq. A6, open loop
  double rmse_v = 0;       ///< the same in volts: comparable between recordings, as the fit is not
  double largest_v = 0;
  double one_step_fit_percent = 0;  ///< of the one-step prediction (residuals.hpp)
  struct PredictionError {
    int steps = 0;
    double rmse_v = 0;
  };
  std::vector<PredictionError> ahead;  ///< k-step predictions, 1, 10 and 60 samples ahead
  double output_variance_v2 = 0;
  std::size_t samples = 0;
  ResidualAnalysis residuals;  ///< of the first recording
  Eigen::VectorXd error_v;     ///< measured less simulated, of the first recording; NaN where nothing was measured
};

struct InitialState {
  double soc = 0, soc_std = 0, v_rc_v = 0;
  bool observable = true;  ///< false: the data cannot tell the state of charge; soc_std says how far it may be off
};

struct Identification {
  std::vector<Parameter> parameters;
  Eigen::MatrixXd correlation;  ///< of the parameters and then the initial states, as the fit had them
  FitStatistics estimation;
  double correlation_length = 1;      ///< samples over which residuals are alike
  double fading = 0;                  ///< how residuals fade from sample to sample: for predictions on other data
  std::vector<InitialState> initial;  ///< per record
  Optimum optimum;
  int starts = 1, agreeing = 1;       ///< searches from different starts, and how many of them ended at the best
  model::CellParameters<> cell;       ///< with what was identified put in
  std::vector<std::string> warnings;  ///< "id: sentence"
};

/// Largest standard deviation of an initial soc that counts as observed.
inline constexpr double observable_soc_std = 0.05;

/// With several nodes, neighbours are tied: they may differ as those of Table 9 do, by more as far as the data shows it
/// (what the constant model leaves over, in its runs, is the measure). Without that a node the data hardly visits takes
/// any value. Throws std::invalid_argument, one sentence that names what cannot be seen and what would show it, when
/// the current never moves or a record is empty.
Identification identify_grey_box(const model::CellParameters<>& start, const std::vector<DataSet>& records,
                                 const GreyBoxOptions& options, Method method, const Stopping& stopping = {});

/// The cell with R0, R1, C1 as Appendix A reads them from the rests of a record (rest_reading.hpp), moved inside the
/// bounds; as it was where no rest can be read.
model::CellParameters<> started_from_rests(const model::CellParameters<>& cell, const Data& data,
                                           const CircuitBounds& bounds);

/// Open loop over a record that was not identified from. Only v_rc at its start is fitted, and only if the record says
/// so.
FitStatistics validate(const model::CellParameters<>& cell, const DataSet& record, double fading);

/// The figures of a simulation; NaN: not measured.
FitStatistics fit_of(const std::vector<double>& measured_v, const Eigen::VectorXd& simulated_v,
                     const std::vector<double>& current_a, double fading);

}  // namespace bms::identification
