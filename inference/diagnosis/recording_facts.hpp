// What recordings excite: how much charge they move, how fast, how warm, with how many rests, edges and turns. Whether
// a mechanism can be tested and which fact distinguishes two mechanisms follow from these.
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <span>

#include "diagnosis/prepared_recording.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis {

/// Of all recordings together. Thresholds of a rest, an edge, a turn: Thresholds::Facts.
struct RecordingFacts {
  double capacity_ah = 1;
  double reference_c = model::default_reference_temperature_c;  ///< reference temperature of the cell file
  double duration_s = 0;
  double duration_h = 0;          ///< the same [h]
  double step_s = 1;              ///< median time between rows
  double largest_a = 0;           ///< largest |current| that was read
  double read_span_a = 0;         ///< largest less smallest current that was read
  std::size_t loaded_rows = 0;    ///< rows with load
  std::size_t edges = 0;          ///< steps of the current
  double throughput_soc = 0;      ///< charge moved either way, over the capacity
  double charged_soc = 0;         ///< charge moved into the cell, over the capacity
  double soc_span = 0;            ///< of the counted soc
  bool temperature = false;       ///< was recorded
  double temperature_span_k = 0;  ///< 0: not recorded, or constant
  double away_k = 0;              ///< largest distance from reference_c; 0: not recorded
  double mostly_away_k = 0;       ///< its median
  double longest_rest_s = 0;
  std::size_t reversals = 0;                              ///< turns of the charge's direction
  std::size_t rates = 0;                                  ///< sizes of current
  bool one_current = false;                               ///< of nearly all load (one_current.hpp)
  bool start_given = false;                               ///< a user gave the initial soc of one at least
  std::optional<double> start_shift;                      ///< of the first recording's initial soc to another one
                                                          ///< that is stated and contradicts it
  bool trusted_instruments = false;                       ///< readings of trusted instruments exist
  bool trusted_current = false, trusted_voltage = false;  ///< all readings are those of trusted instruments
  double zero_error_sigmas = 0;  ///< of the current sensor's zero, by its checks where no current flows
  std::optional<double> rail_a;  ///< largest current, if it is reached often enough to show that the sensor ends there
  double error_v = 0;            ///< RMS of measured less cell file's voltage; 0 unless describe() fills it in
};

RecordingFacts recording_facts(const model::CellParameters<>& cell, std::span<const PreparedRecording> records);

}  // namespace bms::diagnosis
