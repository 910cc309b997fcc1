// Signatures of mechanisms: the whitened derivative of the voltage by a strength, with shapes on a grid.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "diagnosis/likelihood_model.hpp"

namespace bms::diagnosis {

/// One mechanism at one set of shapes.
struct Probe {
  MechanismSetting setting;
  std::vector<std::size_t> parameters;  ///< those that vary, a column each
  std::size_t block = 0;                ///< of the set's columns
  Eigen::Index first = 0;               ///< first column in it
};

struct SignatureSet {
  std::vector<Probe> probes;
  std::vector<Columns> blocks;  ///< white, LikelihoodModel::samples() rows
};

/// A mechanism at one setting, and its derivatives by those of its parameters that are probed: white.
struct ProbedColumns {
  Probe probe;
  Columns columns;
};
ProbedColumns signature_at(const LikelihoodModel& likelihood, const HypothesisFit& around,
                           const MechanismSetting& setting);

/// Settings at which the signature of a testable mechanism is taken: every shape of its grid, strengths just off a
/// bound at 0.
std::vector<MechanismSetting> probe_settings(const LikelihoodModel& likelihood, std::size_t mechanism);

/// Returns true if a signature is taken at several shapes or moments.
bool is_searched(std::size_t mechanism, double capacity_ah);

/// Of the mechanisms in `over` that recordings can test in addition to those of the fit. Bursts have no signature.
SignatureSet signatures(const LikelihoodModel& likelihood, const HypothesisFit& around,
                        const std::vector<std::size_t>& over);

}  // namespace bms::diagnosis
