// The state of charge at the start of a recording: one rule for diagnosis, replay in open loop and hold-outs.
//
// The first that is known counts: what the user says of this recording; the first value of soc_ref; what the estimator
// concludes from the first voltage (likeliest_start()). A shift of the mechanism initial_soc in the cell file is a
// shift of what the user says. So a start from elsewhere is stated less this shift, which the simulation adds.
#pragma once

#include <optional>
#include <string>

#include "files/cell_file.hpp"
#include "measurement/recording.hpp"

namespace bms::workflow {

/// The state of charge at the start of a recording.
struct StartSoc {
  double soc = 0.5, sigma = 0.3;
  bool given = false;  ///< by the user or by soc_ref; else estimated from the first voltage
  std::optional<double> contradicted_by = std::nullopt;  ///< a start that soc_ref or the first voltage states, if it is
                                                         ///< more than three standard deviations away
};

/// A start and what there is to say of it.
struct RecordingStart {
  StartSoc start;
  std::string origin;         ///< where it comes from, unless the user gave it: "starts at the first value of ..."
  std::string contradiction;  ///< what contradicts it, with numbers; empty: nothing
};

/// A start that is known to the tolerance of the cell file.
StartSoc given_start(const files::CellFile& cell, double soc);

/// By the rule above. given: by the user.
RecordingStart recording_start(const measurement::Recording& recording, const files::CellFile& cell,
                               const std::optional<double>& given = std::nullopt);

/// The same without a user and without texts.
StartSoc start_of(const measurement::Recording& recording, const files::CellFile& cell);

}  // namespace bms::workflow
