// Results as JSON objects, one per command; the names are relied on from outside.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "host_sim/replay.hpp"
#include "identification/identify.hpp"
#include "proof/proof.hpp"
#include "study/study.hpp"
#include "workflow/diagnosis_result.hpp"

namespace bms::reports {

std::string json_of(const host_sim::ReplayResult& result, const std::string& trace_sha256);

struct SimulateResult {
  std::string cell, input, out;
  std::size_t samples = 0;
  double duration_s = 0, initial_soc = 0, final_soc = 0, final_voltage_v = 0;
  double steps_per_second = 0;
  std::vector<measurement::Warning> warnings;
};
std::string json_of(const SimulateResult& result);

struct ExperimentResult {
  std::string name, out;
  std::size_t samples = 0;
  double duration_s = 0, charged_ah = 0, discharged_ah = 0, largest_current_a = 0;
};
std::string json_of(const ExperimentResult& result);

struct IdentifyResult {
  std::string model, optimizer, cell, out;
  identification::Identification identification;
  std::optional<identification::FitStatistics> validation;  ///< of the first recording that was asked for
  std::vector<std::pair<std::string, identification::FitStatistics>> validations;  ///< of all
  std::optional<double> coulombic_efficiency;
  double wall_s = 0;
  std::vector<measurement::Warning> warnings;
};
std::string json_of(const IdentifyResult& result);

std::string json_of(const study::StudyResult& result);

std::string json_of(const workflow::DiagnoseResult& result);

std::string json_of(const proof::ProofResult& result);

}  // namespace bms::reports
