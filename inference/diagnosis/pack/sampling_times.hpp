// The time from the first to the last channel of a pack that is read, from steps of the current.
//
// Where a step stands alone, a channel that is read d later than the end of the row has seen it in that row with the
// probability 1 - d / T (T: length of a row), because the moment of the step within the row is random. The difference
// to the neighbours cannot show it as well: their mean is itself a reading of several moments.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "diagnosis/pack/pack_likelihood.hpp"
#include "diagnosis/pack/pack_recording.hpp"
#include "diagnosis/pack/pack_verdict.hpp"
#include "diagnosis/pack/track.hpp"

namespace bms::diagnosis::pack {

/// From the first to the last one of these delays: from those between single late channels, as if they were evenly
/// spread.
double span_of(std::vector<double> delays_s);

/// Returns true if most steps of the current stand alone: then, the current at a reading follows from the neighbours.
bool steps_stand_alone(const Track& track, const PackRecording& pack);

/// What is known if only the delays of a linear fit are: where several steps lie in a row they are too small, and the
/// channels are read within a row of step_s >= linear_s. Every time between is as probable.
Estimated span_within_row(double linear_s, double step_s);

/// The same of single readings of the current: that they are equal does not show that the current was constant between
/// them. With n steps in each row a channel that is read late misses n times as many as with the one step that one_step
/// is for, so that it is the longest time. Every shorter one is as probable.
Estimated span_of_readings(const Estimated& one_step);

/// From the first to the last one of these cells' channels [s], of means or of readings with one step in a row. Nothing
/// if most steps of the current do not stand alone: then, what happened within a row is unknown.
std::optional<Estimated> sampling_span(const Track& track, const PackRecording& pack,
                                       const std::vector<std::size_t>& cells);

/// Whether these cells' channels are read at different times, against the spread that noise gives.
std::optional<PackFinding> staggered_channels(const Track& track, const PackRecording& pack,
                                              const std::vector<std::size_t>& cells, const PackLikelihood& likelihood);

}  // namespace bms::diagnosis::pack
