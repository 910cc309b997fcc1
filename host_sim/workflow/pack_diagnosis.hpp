// The diagnosis of a pack from its file to the result: it reads the recording, follows the state of charge of the
// median cell, compares the cells with each other, and diagnoses what all of them share.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/pack/diagnose_pack.hpp"
#include "diagnosis/verdict.hpp"
#include "files/cell_file.hpp"
#include "files/read_options.hpp"
#include "measurement/recording.hpp"
#include "measurement/soc_column.hpp"
#include "workflow/progress.hpp"

namespace bms::workflow {

struct PackOptions {
  files::ReadOptions reading;
  std::string cell;       ///< cell file, or name of a built-in cell
  std::string recording;  ///< with the columns v_1 .. v_N
  std::optional<double> initial_soc;
  bool shared = true;  ///< diagnose the mean of the cells as well
  Progress progress;
};

struct PackResult {
  files::CellFile cell;
  measurement::Recording recording;
  diagnosis::pack::PackRecording pack;
  diagnosis::pack::PackDiagnosis diagnosis;
  std::optional<measurement::SocColumn> soc_column;
  std::string shared;  ///< what the mean of the cells shows, or why it was not tested
  double wall_s = 0;
  std::vector<measurement::Warning> warnings;
};

/// A voltage_v that is that of the whole pack becomes pack_voltage_v. Throws files::BadInput if the recording is not
/// that of a pack of at least three cells.
measurement::Recording read_pack(const std::string& path, const files::ReadOptions& reading);

/// Diagnoses a recording that has been read.
PackResult diagnose_pack(const files::CellFile& cell, measurement::Recording recording, const PackOptions& options);

/// Reads and diagnoses.
PackResult diagnose_pack(const PackOptions& options);

}  // namespace bms::workflow
