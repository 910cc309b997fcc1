// The cell that an identification starts from: the user's start file, moved to the size and the chemistry of the cell.
#pragma once

#include <string>
#include <vector>

#include "files/cell_file.hpp"
#include "workflow/identified_cell.hpp"
#include "workflow/identify_cell.hpp"

namespace bms::workflow {

/// The cell file to start from, with the OCV, and what the slow recordings say.
struct StartCell {
  files::CellFile cell;
  double capacity_ah = 0;  ///< of the start file
  OcvResult ocv;
  bool has_hysteresis = false;
  double ocv_error_v = 0;  ///< of an OCV from rests, between them; 0: no such OCV
  bool other_cell =
      false;  ///< the start file is of another size or chemistry: it is scaled, and its limits are not used
  std::string limits_source;  ///< empty: the limits are those of the start file
};

/// Reads the start file and the OCV recordings. A capacity below 0.7 or above 1.4 of the start file's, or a stated
/// chemistry, makes it another cell. Throws BadInput; also if the OCV recordings contradict a stated capacity.
StartCell read_start(const IdentifyOptions& options);

/// Standard deviation of the OCV curve as an OCV: its error between points, and the overvoltage of a slow run. That of
/// a charge and a discharge is what the branch position, which is estimated, may wander between them; that of a single
/// run follows from R0 and R1 of `parameters`.
double ocv_sigma_v(const OcvResult& ocv, const model::CellParameters<>& parameters);

/// What follows from the recordings to identify from: limits of use of another cell, and the OCV from their rests.
void adapt_start(const IdentifyOptions& options, const std::vector<measurement::Recording>& recordings,
                 StartCell& start, std::vector<measurement::Warning>& warnings);

/// Throws BadInput if a recording that was compared with the cell contradicts it, or its capacity.
void check_size(const IdentifyOptions& options, const StartCell& start, const measurement::Recording& recording);

}  // namespace bms::workflow
