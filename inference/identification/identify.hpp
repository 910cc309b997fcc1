// Grey-box identification with one optimiser: parameters with their uncertainty, figures of merit, warnings; and
// validation on other recordings.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "identification/grey_box.hpp"
#include "identification/least_squares.hpp"
#include "identification/residuals.hpp"
#include "identification/uncertainty.hpp"

namespace bms::identification {

struct Parameter {
  std::string name;  ///< with its unit: "r0_ohm"
  double soc = 0;    ///< of the node; 0 for parameters without a node
  double value = 0;
  double std = 0;               ///< a run of residuals counts once; 0 at a bound
  double std_white = 0;         ///< as if the residuals were white
  double by_ocv_tolerance = 0;  ///< change of the parameter if the OCV were off by its tolerance
  bool at_bound = false;
  bool identifiable = true;                            ///< false: the data do not depend on it
  std::optional<double> temperature_c = std::nullopt;  ///< if recordings of several temperatures were identified
};

/// How well a model follows the voltage of recordings.
struct FitStatistics {
  double fit_percent = 0;  ///< Eq. A6, open loop
  double rmse_v = 0;       ///< open loop; in contrast to the fit it can be compared between recordings
  double largest_v = 0;
  /// Of the one-step predictor of the structure. TF, OE, Hammerstein-Wiener and grey box have white noise on the output
  /// only, so earlier errors say nothing about the next sample: their one-step prediction is the simulation.
  double one_step_fit_percent = 0;
  /// The same with the last error added, decayed by `fading` (residuals.hpp): a first-order disturbance, which none of
  /// these structures contains.
  double corrected_one_step_fit_percent = 0;
  struct PredictionError {
    int steps = 0;
    double rmse_v = 0;
  };
  std::vector<PredictionError> ahead;  ///< k-step predictions, 1, 10 and 60 samples ahead
  double output_variance_v2 = 0;
  std::size_t samples = 0;
  ResidualAnalysis residuals;  ///< of the first recording
  Eigen::VectorXd error_v;     ///< measured minus simulated, of the first recording; NaN where nothing was measured
};

struct InitialState {
  double soc = 0, soc_std = 0, v_rc_v = 0;
  bool observable = true;  ///< false: the data do not determine the state of charge; soc_std is its uncertainty
};

struct Identification {
  std::vector<Parameter> parameters;
  std::vector<Parameter> polynomials;  ///< of a linear model: c0 c1 c2 a1 a2 (Eq. 11), or b_1 b_2 b_3 f_1 f_2 (Eq. 19)
  Eigen::MatrixXd correlation;         ///< of the parameters and then the initial states, in the order of the optimum
  FitStatistics estimation;
  double correlation_length = 1;      ///< samples over which residuals are correlated
  double fading = 0;                  ///< lag-one autocorrelation of the residuals, for predictions on other data
  std::vector<InitialState> initial;  ///< per recording
  Optimum optimum;
  int starts = 1, agreeing = 1;       ///< number of start values, and how many of them led to the best optimum
  GreyBoxOptions options;             ///< with which the optimum was found
  model::CellParameters<> cell;       ///< the start cell with the identified parameters
  std::vector<std::string> warnings;  ///< "id: sentence"
};

/// Largest standard deviation of an initial SOC that counts as observed.
inline constexpr double observable_soc_std = 0.05;

/// Throws std::invalid_argument, with one sentence, if the recording is too short or its current hardly changes.
void reject_without_excitation(const DataSet& record);

/// With several nodes, neighbours have a prior: they differ as those of Table 9 do, and by more where the data show it
/// (grey_box_search.hpp). Without it a node that the data hardly visit takes any value. Throws std::invalid_argument,
/// with one sentence that names what cannot be identified and which experiment shows it, when the current never changes
/// or a recording is empty.
Identification identify_grey_box(const model::CellParameters<>& start, const std::vector<DataSet>& records,
                                 const GreyBoxOptions& options, Method method, const Stopping& stopping = {});

/// The cell with R0, R1, C1 from the rests of a recording by Appendix A (rest_reading.hpp), clamped to the bounds; the
/// values of the cell where no rest can be read.
model::CellParameters<> started_from_rests(const model::CellParameters<>& cell, const Data& data,
                                           const CircuitBounds& bounds);

/// Open loop over a recording that was not used for the identification. Only v_rc at its start is fitted, and only if
/// the data set asks for it.
FitStatistics validate(const model::CellParameters<>& cell, const DataSet& record, double fading);

/// The figures of a simulation. NaN: not measured.
FitStatistics fit_of(std::span<const double> measured_v, const Eigen::VectorXd& simulated_v,
                     std::span<const double> current_a, double fading);

}  // namespace bms::identification
