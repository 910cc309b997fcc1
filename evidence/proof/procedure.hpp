// A procedure is the code of an experiment: which diagnoses it makes and how it measures the same independently. Names,
// recordings, sentences and tolerances come from the experiment's file (evidence/proof/experiments/*.toml).
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "files/toml_table.hpp"
#include "proof/proof.hpp"
#include "proof/proof_lab.hpp"

namespace bms::proof {

class Procedure {
 public:
  virtual ~Procedure() = default;
  /// Adds claims, plots and notes to the experiment.
  virtual void run(ProofLab& lab, ProofExperiment& experiment) const = 0;
};

/// Reads the procedure's keys and claims of an experiment file. Throws BadInput.
using ReadProcedure = std::unique_ptr<Procedure> (*)(files::TomlTable& file, files::TomlTable& claims);

// Each in a source of its own name.
std::unique_ptr<Procedure> read_hysteresis(files::TomlTable& file, files::TomlTable& claims);
std::unique_ptr<Procedure> read_temperature(files::TomlTable& file, files::TomlTable& claims);
std::unique_ptr<Procedure> read_relaxation(files::TomlTable& file, files::TomlTable& claims);
std::unique_ptr<Procedure> read_charge_loss(files::TomlTable& file, files::TomlTable& claims);
std::unique_ptr<Procedure> read_no_charge_loss(files::TomlTable& file, files::TomlTable& claims);
std::unique_ptr<Procedure> read_added_faults(files::TomlTable& file, files::TomlTable& claims);
std::unique_ptr<Procedure> read_no_mismatch(files::TomlTable& file, files::TomlTable& claims);
std::unique_ptr<Procedure> read_holdouts(files::TomlTable& file, files::TomlTable& claims);

/// [cell]: a cell file that the experiment identifies itself. Throws BadInput.
IdentifiedCell read_identified_cell(files::TomlTable& file);

/// Error of both models over time, for a plot; at most 3,000 points or so.
ProofLines errors_over_time(const workflow::RecordingComparison& c, const std::string& title);

}  // namespace bms::proof
