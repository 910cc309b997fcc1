// The pulse resistances of the recordings that a cell is identified from.
#pragma once

#include <string>
#include <vector>

#include "measurement/pulse_resistance.hpp"
#include "workflow/identify_cell.hpp"

namespace bms::workflow {

struct RecordedPulses {
  std::string recording;
  std::vector<measurement::Pulse> pulses;
};

/// One entry for each recording of the options, with the state of charge of the result. Reads the recordings again.
/// Throws BadInput.
std::vector<RecordedPulses> recorded_pulses(const IdentifyOptions& options, const IdentifyResult& result);

}  // namespace bms::workflow
