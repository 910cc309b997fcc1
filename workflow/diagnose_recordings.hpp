// A diagnosis from files to its result: it reads the recordings, diagnoses, and compares both models.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "workflow/diagnosis_result.hpp"

namespace bms::workflow {

/// The state of charge at the start of a recording.
struct StartSoc {
  double soc = 0.5, sigma = 0.3;
  bool given = false;  ///< by the user or by soc_ref; else estimated from the first voltage
};

/// A start that is known to the tolerance of the cell file.
StartSoc given_start(const files::CellFile& cell, double soc);

/// The first value of soc_ref, or else what the estimator concludes from the first voltage (see likeliest_start()).
StartSoc start_of(const measurement::Recording& recording, const files::CellFile& cell);

/// A recording as a diagnosis reads it: a logger that writes rows on change gets the rows that it left out.
measurement::Recording read_for_diagnosis(const std::string& path, const files::ReadOptions& reading,
                                          const files::CellFile& cell);

/// A recording ready to be diagnosed or to be compared with, with the readings of trusted instruments averaged.
RecordingComparison prepared(measurement::Recording recording, const std::string& name, const files::CellFile& cell,
                             const StartSoc& start);

struct DiagnoseOptions {
  files::ReadOptions reading;                ///< of all recordings
  std::string cell;                          ///< cell file, or name of a built-in cell
  std::optional<files::CellFile> cell_file;  ///< its content; not given: it is read
  std::vector<std::string> recordings;       ///< files, the earliest first
  std::vector<std::string> holdouts;         ///< files of later recordings, for comparison only
  std::vector<double> initial_soc;  ///< one for all or one for each recording; empty: the first value of soc_ref, else
                                    ///< estimated from the first voltage
};

/// What a diagnosis starts from.
struct DiagnoseInput {
  files::CellFile cell;
  std::vector<RecordingComparison> recordings, holdouts;
  std::vector<measurement::Warning> warnings;  ///< of the files, and where each recording starts
};

/// How many readings of a recording lie within the 95 % interval of a cell file's prediction.
diagnosis::Coverage coverage_of(const files::CellFile& cell, const diagnosis::PreparedRecording& record);

/// Reads the files. A soc_ref of a hold-out has priority over initial_soc. Throws files::BadInput.
DiagnoseInput read_diagnose_input(const DiagnoseOptions& options);

/// Diagnoses, compares both models over all recordings and composes the extended cell. Writes nothing. Leaves `next`
/// and `out` empty.
DiagnoseResult diagnose_recordings(DiagnoseInput input, const diagnosis::Options& options);

/// Chooses the experiment that separates the causes that are still possible, if the verdict names mechanisms: one that
/// is not among the recordings. Without one it says so. options: those of this diagnosis.
void add_next_experiment(const DiagnoseOptions& options, DiagnoseResult& result);

/// Adds a warning if the findings increase an error on the hold-outs.
void add_holdout_warnings(DiagnoseResult& result);

}  // namespace bms::workflow
