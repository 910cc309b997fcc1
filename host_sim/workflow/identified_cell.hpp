// The parts of an identified cell file other than R0, R1, C1: OCV, capacity, mechanisms, noise.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "files/cell_file.hpp"
#include "files/recording.hpp"
#include "identification/branch_temperature.hpp"
#include "identification/identify.hpp"
#include "workflow/identification_data.hpp"

namespace bms::workflow {

struct OcvResult {
  std::optional<double> coulombic_efficiency;          ///< discharged over charged; needs a charge and a discharge
  std::optional<identification::BranchLaws> branches;  ///< from slow runs at three temperatures or more
  std::size_t temperatures = 0;                        ///< of slow runs
  double largest_a = 0;                                ///< of slow runs
  std::vector<measurement::Warning> warnings;
  std::vector<std::string> read_as;  ///< "FILE: how it was read", of files that are not in the project's own format
};

/// Writes OCV, gap and capacity of slow charge and discharge recordings into `cell`. The OCV has the fewest straight
/// pieces with an error of at most max_error_v, in V; if the cell has no room for them, the error is larger and a
/// warning says so. Of several temperatures, the one nearest to the cell's reference temperature gives the
/// curve, moved exactly to it by the other temperatures. both_branches: the pieces also follow the gap. Throws BadInput
/// if the recordings are not slow runs.
OcvResult identify_ocv(const std::vector<std::string>& paths, const files::ReadOptions& reading, double max_error_v,
                       bool both_branches, files::CellFile& cell);

/// Adds the hysteresis between the measured curves of charge and discharge as a mechanism, if there are both, and how
/// both depend on the temperature, if that was measured.
void identify_hysteresis(const OcvResult& ocv, files::CellFile& cell);

/// The data set with the effect of the cell's mechanisms subtracted from its voltage, to identify the circuit alone.
identification::DataSet without_mechanisms(const files::CellFile& cell, const IdentificationData& of);

/// Source of the noise of an extended cell file.
inline constexpr const char* extended_noise =
    "model: prediction of left-out recordings; current offset: up to a hundredth of the 1C current, constant over a "
    "working day; at rest: a fifth of that; gain: half a percent of the reading and half a percent of the capacity";

/// Writes noise and tolerance into `p`: noise of the measuring chain from the rests of the recordings, noise of the
/// model from the residual `judge` and from the gap between the OCV branches.
void identify_noise(const std::vector<measurement::Recording>& recordings, const identification::FitStatistics& judge,
                    const std::vector<identification::Parameter>& parameters, model::CellParameters<>& p);

/// Recordings within 5 K of each other.
struct TemperatureGroup {
  double temperature_c = 0;             ///< mean, rounded to a tenth
  std::vector<std::size_t> recordings;  ///< indices
};
/// In order of temperature. A single group of the reference temperature if any recording has no temperature.
std::vector<TemperatureGroup> group_by_temperature(const std::vector<measurement::Recording>& recordings,
                                                   double reference_c);

/// Rounds every number to seven significant digits.
void round_digits(files::CellFile& cell);

}  // namespace bms::workflow
