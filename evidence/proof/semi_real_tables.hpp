// The results of the semi-real benchmark and their tables.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "proof/not_run.hpp"

namespace bms::proof {

/// One diagnosis.
struct SemiRealResult {
  std::string set, cell, fault;  ///< fault empty: a null
  bool held_out = false;
  double size = 0;
  std::string verdict, found, withheld;
  bool within_bounds = true;  ///< a real instrument or contact can be that wrong
  bool detected = false, first_right = false, named = false;
  /// Of a finding: its probability, and whether it is the fault that was put in.
  std::optional<double> probability = std::nullopt;
  bool is_the_fault = false;
  std::optional<double> over_limit;       ///< size over the stated detection limit
  std::optional<double> sigmas;           ///< of the found size from the true one
  std::optional<double> band_within;      ///< of a null: share of the readings within the 95 % band of the prediction
  std::optional<double> band_over_error;  ///< of a null: RMS of the band's half width over that of the error
  double error_v = 0, remaining_v = 0, wall_s = 0, hours = 0;
  double healthy_error_v = 0;      ///< the largest of a healthy block; 0 without any
  double covered = 1;              ///< share of the recording where healthy ones were
  std::size_t healthy_blocks = 0;  ///< that it was compared with
};

std::string line_of(const SemiRealResult& r);
/// Faults by their size in stated limits, and of each size those within the bounds of a real instrument and those
/// beyond. Beyond them no name is right but that of the fault; not to name anything is right as well.
std::string by_size(const std::vector<SemiRealResult>& results);
/// Figures of all development and held-out cells, and of each cell.
std::string table_of(const std::vector<SemiRealResult>& results);

/// Counts of nulls and faults, and every result. Faults are those of twice the stated limit and above, within the
/// bounds of a real instrument.
std::string json_of(const std::vector<SemiRealResult>& results, const NotRun& not_run);

}  // namespace bms::proof
