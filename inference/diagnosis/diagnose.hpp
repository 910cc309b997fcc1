// The whole chain: is the data usable, does the cell file explain it, which mechanism would explain the rest, is that
// more than chance, and what is left. README.md lists the phases, docs/diagnosis_method.md has the equations,
// thresholds.hpp the numbers. Reasons stand at the lines that they defend.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "diagnosis/prepared_recording.hpp"
#include "diagnosis/search.hpp"
#include "diagnosis/verdict.hpp"
#include "healthy_data/healthy_data.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis {

struct Options {
  std::size_t most_mechanisms = 6;
  healthy_data::HealthyData healthy;  ///< of the cell; without blocks it withholds nothing, but its regimes hold
  bool learns = false;  ///< the recordings are healthy: Diagnosis::unknown_gain is the larger one of that with
                        ///< and that without the findings
  double false_alarm_rate = 0.01;  ///< where `healthy` decides (healthy_decide): how often a healthy recording may be
                                   ///< blamed
  Progress progress;
  Stopped stopped;  ///< asked between fits; the diagnosis then ends with what it knows so far
};

/// own: mechanisms of the cell file. records: as read, in order of time; readings that cannot be used are removed here.
Diagnosis diagnose(const model::CellParameters<>& cell, const std::vector<MechanismSetting>& own,
                   std::vector<PreparedRecording> records, const Options& options = {});

/// What holds for a later recording of the same cell and instruments: a contact that has changed stays so; when bursts
/// fell and where the first recording began does not hold. initial_soc: at its start, if it is known; a cell that is
/// full was charged last, an empty one discharged.
std::vector<MechanismSetting> later_recording(const Hypothesis& extended, std::optional<double> initial_soc = {});

/// Voltage that would be read in open loop from the record's initial soc [V]. soc: filled in unless nullptr.
std::vector<double> predict(const model::CellParameters<>& cell, const std::vector<MechanismSetting>& settings,
                            const PreparedRecording& record, std::vector<double>* soc = nullptr);

}  // namespace bms::diagnosis
