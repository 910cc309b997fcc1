// The result of a diagnosis with its comparisons, before it is JSON, a page or a cell file.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/next_experiment.hpp"
#include "diagnosis/prediction_interval.hpp"
#include "files/cell_file.hpp"
#include "files/recording.hpp"
#include "measurement/soc_column.hpp"

namespace bms::workflow {

/// Error of the open-loop voltage, over several recordings together.
struct OpenLoopFigures {
  double rmse_v = 0, fit_percent = 0;
};

/// RMS error of the estimated state of charge against soc_ref, as a fraction.
struct SocErrors {
  double baseline_rmse = 0, extended_rmse = 0;
  double extended_sigma = 0;  ///< RMS of the standard deviation that the estimator states
};

/// One recording and the voltages of both models. Nothing is fitted to it except the mechanisms found.
struct RecordingComparison {
  measurement::Recording recording;
  diagnosis::PreparedRecording record;
  std::vector<double> base_v, extended_v;            ///< open loop, by row
  diagnosis::PredictionInterval interval;            ///< around extended_v
  std::optional<measurement::SocColumn> soc_column;  ///< judgement of soc_ref with the capacity of the cell file
};

struct DiagnoseResult {
  files::CellFile cell, extended_cell;
  diagnosis::Diagnosis diagnosis;
  std::vector<RecordingComparison> recordings, holdouts;
  std::optional<OpenLoopFigures> baseline, extended, baseline_holdout, extended_holdout;
  std::optional<SocErrors> soc;                   ///< of the hold-outs with a reference
  std::optional<diagnosis::NextExperiment> next;  ///< separates the causes that are still possible
  std::string then;                               ///< command that diagnoses its recording together with these
  std::vector<std::string> holdouts_beyond;       ///< names of those that contradict the result
  std::string together;                           ///< command that diagnoses them together with the recordings
  std::string nothing_more;                       ///< why there is no next one, where causes are still ambiguous
  std::string out;
  double wall_s = 0;
  std::vector<measurement::Warning> warnings;
  std::vector<measurement::Warning> notes;  ///< what a user may want to know and need not act on

  /// Returns true if the verdict names mechanisms; they are then in the extended cell.
  bool named() const { return diagnosis::names(diagnosis.verdict); }
  /// Returns true if the extended cell has a term for an unknown cause.
  bool has_term() const { return diagnosis.law && diagnosis.law->cell; }
};

}  // namespace bms::workflow
