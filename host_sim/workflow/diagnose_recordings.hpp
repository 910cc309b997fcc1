// A diagnosis from files to its result: it reads the recordings, diagnoses, and compares both models.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "workflow/diagnosis_result.hpp"
#include "workflow/recording_start.hpp"

namespace bms::workflow {

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
  std::vector<double> initial_soc;  ///< one for all recordings, or one for each recording and then, if there are more,
                                    ///< one for each hold-out; what has none starts by recording_start()
};

/// What a diagnosis starts from.
struct DiagnoseInput {
  files::CellFile cell;
  std::vector<RecordingComparison> recordings, holdouts;
  std::vector<measurement::Warning> warnings;  ///< of the files, and of a start that is contradicted
  std::vector<measurement::Warning> notes;     ///< where each recording starts
};

/// How many readings of a recording lie within the 95 % interval of a cell file's prediction.
diagnosis::Coverage coverage_of(const files::CellFile& cell, const diagnosis::PreparedRecording& record);

/// Reads the files. Throws files::BadInput, also if one recording is named twice.
DiagnoseInput read_diagnose_input(const DiagnoseOptions& options);

/// Diagnoses, compares both models over all recordings and composes the extended cell. Writes nothing. Leaves `next`
/// and `out` empty.
DiagnoseResult diagnose_recordings(DiagnoseInput input, const diagnosis::Options& options);

/// Chooses the experiment that separates the causes that are still possible, if the verdict names mechanisms: one that
/// is not among the recordings. Without one it says so. options: those of this diagnosis.
void add_next_experiment(const DiagnoseOptions& options, DiagnoseResult& result);

}  // namespace bms::workflow
