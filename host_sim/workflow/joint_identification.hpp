// The part of `identify --extend` that fits the circuit to all recordings at all temperatures: from recordings to the
// chosen circuit, into the cell file, and to recordings that were held out.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/prediction_interval.hpp"
#include "files/cell_file.hpp"
#include "identification/identify.hpp"
#include "identification/joint_structure.hpp"
#include "workflow/identification_data.hpp"

namespace bms::workflow {

/// Range of SOC in which the residual counts: outside, the OCV is steep and depends on the last charge.
inline constexpr SocWindow joint_window{0.95, 0.10};

struct JointResult {
  identification::StructureChoice choice;
  std::vector<std::string> recordings;                 ///< of the fit
  std::vector<identification::LeftOutError> held_out;  ///< of --hold-out
  std::vector<diagnosis::Coverage> coverage;           ///< of the same, by the cell file; empty without one
  bool keeps_shape = false;                            ///< R0, R1, C1 over SOC are those of the grey box
  std::size_t temperatures = 1;                        ///< more than 5 K apart
};

/// A recording for the joint fit. initial_soc: of the row where `of` begins.
identification::JointRecording joint_recording(const measurement::Recording& recording, const IdentificationData& of,
                                               double initial_soc, double capacity_ah);

/// True if charge and discharge cover half of the capacity each: only then is a shape over SOC not that of a direction.
bool covers_both_directions(const std::vector<identification::JointRecording>& recordings);

/// Chooses and fits the circuit. cell: OCV with its mechanisms, [rc] to start from. rc_pairs: 1 or 2; not given: what
/// predicts better. Throws BadInput.
JointResult identify_jointly(const files::CellFile& cell, bool keeps_shape,
                             const std::vector<identification::JointRecording>& recordings,
                             std::optional<int> rc_pairs = {});

/// The circuit of `joint` fitted to other recordings of the same cell. Throws BadInput.
JointResult identified_again(const JointResult& joint, const std::vector<identification::JointRecording>& recordings);

/// Predicts recordings that did not enter the fit. Each starts by recording_start(), without a user. cell: of the
/// start.
void hold_out(const std::vector<std::string>& paths, const files::ReadOptions& reading, DataOptions options,
              const files::CellFile& cell, JointResult& joint);

/// Adds how many readings of the recordings that were held out are within the cell file's 95 % interval, and their
/// error: that of bms simulate, replay and diagnose with this cell file.
void add_coverage(const std::vector<std::string>& paths, const files::ReadOptions& reading, const files::CellFile& cell,
                  JointResult& joint);

/// Unknowns at a bound, and a search that did not converge.
std::vector<measurement::Warning> warnings_of(const JointResult& joint);

/// A cell file with its mechanisms in open loop, compared with a recording.
identification::FitStatistics compare(const files::CellFile& cell, const IdentificationData& with, double fading);

/// Writes circuit, mechanisms, tolerances and noise of the model into the cell file, with their sources.
void put(const JointResult& joint, files::CellFile& cell);

/// Noise of an estimator with error states: the current sensor, and the model by its errors on left-out recordings.
void put_noise(const identification::ModelErrors& errors, model::CellParameters<>& parameters);

}  // namespace bms::workflow
