// What all cells share: the state of charge over the recording, and the errors of the current sensor.
//
// The mean of the usual cells is a better voltmeter than one channel. Over the recording it is compared with the cell
// file; the errors of the current sensor are unknowns next to those of the cell file:
//
//   v(t) = OCV(z) + (1 + resistance) (R0(z) I + v_rc) + polarisation v_rc + level + waves of the OCV and of R0
//   I = (1 - gain) I_read - offset          z(t) = start + (1 + capacity) integral of I / Q + waves
//
// The waves are the error of a count of single readings (current_kind.hpp), a random walk. It is noise, but of all
// frequencies down to the length of the recording, where an offset, a gain and a capacity are: as unknowns with the
// variance of the walk, none of the three takes it for itself, and the data distinguish it from them as far as they
// can.
//
// How wrong the file's OCV is for these cells is not known: the file may be of another cell, scaled. The probability of
// the data is the mean over several sizes of that error, for a healthy sensor as for a faulty one.
//
// An offset changes the charge by the same amount every hour, a gain and a capacity by the charge that has passed. Only
// an offset and a gain are named; a capacity of all cells is what they could also be.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/pack/pack_recording.hpp"
#include "diagnosis/pack/pack_verdict.hpp"
#include "diagnosis/pack/track.hpp"

namespace bms::diagnosis::pack {

struct SharedState {
  std::string not_tested;                 ///< why; empty: tested
  std::vector<double> soc;                ///< by row, of the mean of the cells
  std::vector<double> soc_sigma;          ///< standard deviation by row; empty: of a count without a walk
  std::vector<double> resistance_factor;  ///< by row, on R0 and R1 of the cell file: temperature, age
  double polarisation = 0;                ///< more on R1, as a share of that of the cell file
  double ocv_apart_v = 0;                 ///< RMS by which the cells' OCV differs from that of the file
  double offset_a = 0, gain = 0;          ///< of the current sensor, most probable
  double offset_sigma_a = 0;              ///< standard deviation
  std::optional<PackFinding> finding;     ///< of the current sensor
};

/// track: with neighbours_v.
SharedState shared_state_of(const Track& track, const PackRecording& pack);

}  // namespace bms::diagnosis::pack
