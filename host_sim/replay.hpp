// Replay: a recording through the estimator, on the host or on an emulated board, and how well it did.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "estimator/estimate.hpp"
#include "files/cell_file.hpp"
#include "measurement/recording.hpp"

namespace bms::host_sim {

enum class ScalarKind { float32, fixed, float64 };  ///< float, fixed point, double

/// One estimate as numbers, whatever the scalar was.
struct EstimateRow {
  double soc = 0, soc_sigma = 0, v_rc_v = 0, voltage_predicted_v = 0;
  std::uint32_t flags = 0;
};

/// The estimates of one run. What the filter of an extended cell knows besides stands row by row, state_names.size() to
/// a row: errors that are states, states of mechanisms.
struct Track {
  std::vector<EstimateRow> rows;
  std::vector<estimator::EstimateWords> words;  ///< the bits behind them; empty for double
  std::vector<std::string>
      state_names;  ///< "current_offset_a", "ocv_hysteresis_v", "slow_polarisation_1_v", "self_heating_k"
  std::vector<double> state_scales;  ///< of what the words hold to the name's unit
  std::vector<double> states;        ///< V, K, A
  std::vector<std::uint32_t> state_words;
  double steps_per_second = 0;
};

/// What the user believes of the state of charge before the first sample.
struct SocPrior {
  double soc = 0;
  double sigma = 0.02;
};
/// shift: what a cell file knows of the truth of such beliefs.
std::optional<measurement::StartingPoint> starting_point(const std::optional<SocPrior>& prior, double shift = 0);

/// How many of them the estimator tells with this cell file; name_states: which.
std::size_t state_count(const files::CellFile& cell);
void name_states(Track& track, const files::CellFile& cell);

/// Runs the estimator on this machine. The measuring of its speed repeats the run; the estimates are those of the last.
Track run_on_host(const files::CellFile& cell, const std::vector<measurement::Sample>& samples,
                  const std::optional<measurement::StartingPoint>& start, ScalarKind scalar);

/// Fills a track's numbers from its words.
void number_states(Track& track, ScalarKind scalar);

/// Numbers of the words that a board has sent.
std::vector<EstimateRow> rows_of(const std::vector<estimator::EstimateWords>& words, ScalarKind scalar);

/// Where two runs part, or nothing.
struct Difference {
  std::size_t sample = 0;
  std::string field;
  double host = 0, board = 0;
};
std::optional<Difference> first_difference(const Track& host, const Track& board, ScalarKind scalar);

struct SocFigures {
  double final = 0, final_sigma = 0;
  std::optional<double> rmse, max_error, rmse_after_30min, max_error_after_30min, within_2_sigma;
  std::optional<double> current_offset_a, current_offset_sigma_a;  ///< at the end, where errors are states
};
struct VoltageFigures {
  std::optional<double> prediction_rmse_v, prediction_max_v, open_loop_rmse_v,
      open_loop_fit_percent;  ///< nothing: no voltage to judge by
};

struct ReplayResult {
  measurement::Recording recording;
  files::CellFile cell;
  std::string target;
  ScalarKind scalar = ScalarKind::float32;
  std::optional<SocPrior> prior;  ///< of the user
  double initial_soc = 0;         ///< believed, or of the estimator after the first sample
  Track track;
  std::vector<double> open_loop_v;
  SocFigures soc;
  VoltageFigures voltage;
  std::optional<std::string> verified_against;  ///< board that gave the same bits
  std::optional<std::string> difference;        ///< or where it did not, in words
};

/// Figures of `result.track` over `result.recording`; the open loop starts at soc_ref where there is one, else at
/// initial_soc.
void evaluate(ReplayResult& result);

/// time_s,soc,soc_sigma,v_rc_v,voltage_predicted_v,voltage_measured_v, states of mechanisms, flags
std::string trace_csv(const ReplayResult& result);

const char* name_of(ScalarKind scalar);

}  // namespace bms::host_sim
