// The experiments of bms proof: TOML files in evidence/proof/experiments, compiled into the program.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "proof/procedure.hpp"

namespace bms::proof {

struct Experiment {
  std::string id, title, method;
  std::vector<std::string> recordings;  ///< "a123_26650/udds_P25_A002": those that it needs
  std::vector<std::string> notes;
  double rows = 0;  ///< rows to diagnose for it, beyond those of the experiments before it; for the time left
  std::unique_ptr<Procedure> procedure;
};

/// Reads an experiment; `path` is for messages only. Throws BadInput.
Experiment parse_experiment(const std::string& text, const std::string& path);

/// One file of evidence/proof/experiments.
struct ExperimentText {
  std::string name;  ///< "hysteresis"
  std::string text;
};
/// All of them, in the order of evidence/proof/CMakeLists.txt.
const std::vector<ExperimentText>& experiment_texts();

/// All of them, read once. Throws BadInput.
const std::vector<Experiment>& experiments();

}  // namespace bms::proof
