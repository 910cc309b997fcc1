// What to do after a diagnosis that leaves causes open: the experiment, and the command that diagnoses its recording
// together with those that asked for it.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/next_experiment.hpp"
#include "workflow/diagnose_recordings.hpp"

namespace bms::workflow {

/// "bms diagnose --cell C --recording OLD --recording PROFILE_measured.csv", with the options of the first diagnosis.
/// Where each recording starts is stated if it was given, by the user or by soc_ref, for all of them.
std::string joint_command(const DiagnoseOptions& options, const std::vector<RecordingComparison>& recordings,
                          const diagnosis::NextExperiment& next);

/// The same of the recordings and their hold-outs: "bms diagnose --cell C --recording A --recording B". All start as
/// they did here, if each start was given.
std::string together_command(const DiagnoseOptions& options, const std::vector<RecordingComparison>& recordings,
                             const std::vector<RecordingComparison>& holdouts);

/// Lines of a text, in the order in which they are to be done; empty if no cause is left open and no hold-out
/// contradicts the result.
std::vector<std::string> next_steps(const DiagnoseResult& result);

}  // namespace bms::workflow
