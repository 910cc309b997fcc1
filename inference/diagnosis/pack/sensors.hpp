// Temperature sensors against each other, and the pack's voltmeter against the sum of the cells.
#pragma once

#include <optional>
#include <vector>

#include "diagnosis/pack/pack_recording.hpp"
#include "diagnosis/pack/pack_verdict.hpp"
#include "diagnosis/pack/track.hpp"

namespace bms::diagnosis::pack {

/// Sensors that disagree with the median of the others.
std::vector<PackFinding> check_thermistors(const PackRecording& pack);

/// The mean of these sensors at the cell, minus their mean over the pack, by row; empty with less than two sensors.
std::vector<double> warmer_than_mean(const PackRecording& pack, std::size_t cell,
                                     const std::vector<PackFinding>& bad_sensors);

/// The voltmeter against the sum of the cells: another reading at rest, or a resistance between them.
std::vector<PackFinding> check_pack_voltage(const PackRecording& pack, const Track& track);

}  // namespace bms::diagnosis::pack
