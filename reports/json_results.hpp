// Results as JSON objects, one per command. Their names are relied on from outside.
#pragma once

#include <optional>
#include <string>

#include "diagnosis/prediction_interval.hpp"
#include "experiments/profile_figures.hpp"
#include "host_sim/cuts.hpp"
#include "host_sim/replay.hpp"
#include "host_sim/simulation_result.hpp"
#include "proof/proof.hpp"
#include "study/diagnose_paper.hpp"
#include "study/study.hpp"
#include "workflow/diagnosis_result.hpp"
#include "workflow/identify_cell.hpp"

namespace bms::reports {

std::string json_of(const host_sim::ReplayResult& result, const std::string& trace_sha256);
std::string json_of(const host_sim::CutResult& result);
/// Of bms import; out: the file that was written, or empty.
std::string json_of(const measurement::Recording& recording, const std::string& out);
/// Of bms cell.
std::string json_of(const files::CellFile& cell, const std::vector<std::string>& doubts);
/// coverage: of the measured voltage, if there is one and an interval.
std::string json_of(const host_sim::SimulationResult& result,
                    const std::optional<diagnosis::Coverage>& coverage = std::nullopt);
std::string json_of(const std::string& experiment, const std::string& out, const experiments::ProfileFigures& figures);
std::string json_of(const workflow::IdentifyResult& result);
std::string json_of(const workflow::DiagnoseResult& result);
std::string json_of(const study::PaperDiagnosis& diagnosis);
std::string json_of(const study::StudyResult& result);
std::string json_of(const proof::ProofResult& result);

}  // namespace bms::reports
