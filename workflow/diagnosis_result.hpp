// What bms diagnose has found, before it is JSON, a page or a cell file.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/next_experiment.hpp"
#include "files/cell_file.hpp"
#include "measurement/recording.hpp"

namespace bms::workflow {

/// How far an open loop is from what was measured; of several recordings together.
struct OpenLoopFigures {
  double rmse_v = 0, fit_percent = 0;
};

/// RMSE of the estimator's state of charge against soc_ref.
struct SocErrors {
  double baseline_rmse = 0, extended_rmse = 0;
};

/// One recording and what both models say of it, nothing fitted to it but the mechanisms found.
struct RecordingComparison {
  measurement::Recording recording;
  diagnosis::PreparedRecording record;
  std::vector<double> base_v, extended_v;  ///< empty: no voltage to compare with
};

struct DiagnoseResult {
  files::CellFile cell, extended_cell;
  diagnosis::Diagnosis diagnosis;
  std::vector<RecordingComparison> recordings, holdouts;
  std::optional<OpenLoopFigures> baseline, extended, baseline_holdout, extended_holdout;
  std::optional<SocErrors> soc;                   ///< of the hold-outs that have a reference
  std::optional<diagnosis::NextExperiment> next;  ///< what would settle which of several causes it is
  std::string out;
  double wall_s = 0;
  std::vector<measurement::Warning> warnings;

  /// Whether the verdict names mechanisms: then they are in the extended cell.
  bool named() const { return diagnosis::names(diagnosis.verdict); }
};

}  // namespace bms::workflow
