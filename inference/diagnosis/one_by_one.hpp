// Several recordings together can be harder to explain than each of them: contacts differ by a percent from one to the
// next (two discharges with a contact read UNKNOWN together), a cell ages. A cause visible in one recording must not be
// lost by adding others.
#pragma once

#include <functional>
#include <vector>

#include "diagnosis/prepared_recording.hpp"
#include "diagnosis/verdict.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis {

/// Settings of a hypothesis of several recordings as they act in one of them: a contact changes in the first one at its
/// moment, in later ones before their start.
std::vector<MechanismSetting> settings_in(const std::vector<PreparedRecording>& records, std::size_t record,
                                          std::vector<MechanismSetting> settings);

/// The views of all recordings, from the cell file and from the extended cell.
void set_views(Diagnosis& d, const model::CellParameters<>& cell, const std::vector<MechanismSetting>& own,
               const std::vector<PreparedRecording>& records);

/// The answer of the recording that names a cause with the largest gain, of those for which healthy recordings decide
/// (HealthyBasis::decided): the false alarm rate is that of one recording. `together`, which names none, if none does.
Diagnosis likeliest_alone(Diagnosis together, const model::CellParameters<>& cell,
                          const std::vector<MechanismSetting>& own, const std::vector<PreparedRecording>& records,
                          const std::function<Diagnosis(const PreparedRecording&)>& diagnose_one);

}  // namespace bms::diagnosis
