// Where measurements come from, as the estimator takes them.
// Back ends: bq76952/samples (a monitoring chip), remote/samples (another node), emulated/samples_can (frames),
// emulated/samples_stream (a recording through the debugger's file access).
#pragma once

#include <optional>

#include "board_config.hpp"  // generated from boards/<board>/board.cmake: pack_cells, sample_period_s
#include "measurement/pack_sample.hpp"

namespace bms::hal {

/// Waits for the next sample; it stays until the next call. nullptr: there will be none (a replay has ended); never on
/// a truck.
const measurement::PackSample<pack_cells>* next_sample();

/// What is known of the state of charge before the first sample. Asked once, after the first next_sample().
std::optional<measurement::StartingPoint> starting_point();

}  // namespace bms::hal
