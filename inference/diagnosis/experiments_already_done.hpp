// Which experiments are among the recordings. Repeating one adds no information, so a diagnosis that still cannot
// decide must not request it.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/prepared_recording.hpp"

namespace bms::diagnosis {

/// Names of the courses of evidence/experiments/ with a defined start that one of the recordings follows. A course is
/// recognised by the charge that flows, whatever capacity it was laid out for and whenever it begins; one without
/// current by a trusted instrument that read. One whose trusted instruments did not read has not been carried out.
std::vector<std::string> experiments_already_done(const std::vector<PreparedRecording>& recordings, double capacity_ah);

}  // namespace bms::diagnosis
