// What one run of the study observes: the numbers that the statements of the paper are about. A number that a run does
// not have is missing, with the reason; nothing holds by absence.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "study/fitter.hpp"

namespace bms::study {

inline constexpr std::size_t paper_experiments = 7, ocv_experiment = 6, burst_experiment = 3;
/// In the order of Tables 7 and 8.
inline constexpr std::array<const char*, paper_experiments> experiment_names = {
    "rest_30s", "rest_18s", "rest_5s", "high_1m_low_30s", "high_30s_low_30s", "high_30s_low_1m", "ocv_1h_rest"};

/// A model with its best optimiser (Tables 5 and 6, Figures 6 to 8).
struct ModelObservation {
  double estimation_fit = 0, validation_fit = 0, one_step_fit = 0;  ///< percent
  double estimation_rmse_v = 0, validation_rmse_v = 0;
  double bias_v = 0, bias_band_v = 0;  ///< on estimation data
  double r0_ohm = 0, r1_ohm = 0, c1_f = 0;
  bool at_bound = false;
};

/// Tables 7 and 8.
struct CrossObservation {
  std::array<std::array<double, paper_experiments>, paper_experiments> fit{};
  std::array<std::array<double, 3>, paper_experiments> value{}, deviation{};
  std::array<double, paper_experiments> output_sd_v{};
  double burst_bias_v = 0, burst_band_v = 0, burst_largest_v = 0;
};

struct InitialSocObservation {
  double from_ocv_test = 0, of_ocv_test = 0;  ///< found, true
  double from_bursts = 0, of_bursts = 0;
};

/// RMS differences from the rested voltages.
struct OcvObservation {
  double look_up_v = 0, polynomial_v = 0, pieces_v = 0;
};

/// Output error and Hammerstein-Wiener without the delay of Eq. 18: the current of the same sample acts on the voltage.
/// This is so if the paper logged each current one sample before its voltage, and it may explain the order of the
/// models.
struct WithoutDelay {
  std::optional<ModelObservation> output_error, hammerstein_wiener;
  std::string why_not;
};

struct Observations {
  /// Fit to estimation data by optimiser and model, from the paper's start.
  std::array<std::array<std::optional<double>, models>, methods.size()> table4;
  std::array<std::optional<ModelObservation>, models> model;
  std::array<std::string, models> no_model;  ///< the reason
  WithoutDelay without_delay;
  std::optional<CrossObservation> cross;
  std::optional<InitialSocObservation> initial_soc;
  std::optional<OcvObservation> ocv;
  std::string not_run;  ///< why cross, initial_soc and ocv are missing
};

/// The paper's whole procedure on one simulated cell. The models receive the OCV that the paper's test gives of it: the
/// rested voltages after discharge pulses. seed: of the noise. runs: shared by benches that differ in what is left out.
Observations observe_bench(const model::CellParameters<>& cell, const Bench& bench, std::uint64_t seed,
                           PlantRuns& runs);

/// Every model with every optimiser on two data sets.
void observe_models(Fitter& fitter, const StudyData& estimation, const StudyData& validation, Observations& out);

WithoutDelay observe_without_delay(Fitter& fitter, const StudyData& estimation, const StudyData& validation);

ModelObservation observation_of(const ModelFit& fit);
/// The fits of a grey box identified from each of the seven experiments, on all of them.
CrossObservation observation_of(const std::vector<id::Identification>& identified, const std::vector<StudyData>& parts);

/// The circuit by the points of Appendix A at the first usable rest; the paper's start without one.
id::CircuitParameters appendix_a(const StudyData& part);

/// Both initial states with the circuit fixed, as the paper finds them (3.2.4 and 4.2).
struct InitialStates {
  double soc = 0, v_rc_v = 0, fit_percent = 0;
};
InitialStates initial_states(const model::CellParameters<>& cell, const StudyData& part,
                             const id::CircuitParameters& circuit);

/// Bounds of Table 3.
bool within_bounds(const ModelObservation& m);

}  // namespace bms::study
