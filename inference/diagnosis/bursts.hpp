// When a loose contact was open: stretches in which the residual is proportional to the current, and only in them.
//
// A burst of some seconds is short compared with the memory of the slow noise, so it is searched in the whitened
// residual, against the whitened current of every stretch. Stretches that seem to have less resistance are the control:
// no contact causes them. In the raw residual 3 of 4 concealed contacts were missed.
#pragma once

#include <cstddef>
#include <vector>

#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/noise.hpp"
#include "diagnosis/prepared_recording.hpp"
#include "model/mechanisms/contact_intermittent.hpp"

namespace bms::diagnosis {

/// Bursts of one recording, ascending. residual_v: measured less predicted [V], one per row. found_ohm: resistance
/// added in a burst, unchanged without bursts. Empty: nothing beyond what chance reaches.
std::vector<model::Span> find_bursts(const PreparedRecording& record, const std::vector<double>& residual_v,
                                     const Whitener& whitener, double& found_ohm);

/// Bursts of all recordings.
struct BurstSearch {
  std::vector<std::vector<model::Span>> spans;  ///< by record
  std::size_t count = 0;
  double resistance_ohm = 0;  ///< the largest of the recordings'
  double covered_s = 0;
  Columns column;  ///< the current in the bursts, 0 elsewhere; not white. LikelihoodModel::samples() rows
};

/// In the residual of a fit.
BurstSearch find_bursts(const LikelihoodModel& likelihood, const HypothesisFit& around);

}  // namespace bms::diagnosis
