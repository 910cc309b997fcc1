// Where measurements come from, as the estimator takes them.
// Back ends: bq76952/samples (a monitoring chip), remote/samples (another node), emulated/samples_can (frames),
// emulated/samples_stream (a recording through the debugger's file access).
#pragma once

#include <cstddef>
#include <optional>

#include "measurement/pack_sample.hpp"

// boards/<board>/board.cmake says otherwise
#ifndef BMS_CELLS
#define BMS_CELLS 1
#endif
#ifndef BMS_SAMPLE_PERIOD_S
#define BMS_SAMPLE_PERIOD_S 0.1
#endif

namespace bms::hal {

inline constexpr std::size_t pack_cells = BMS_CELLS;
inline constexpr double sample_period_s = BMS_SAMPLE_PERIOD_S;

/// Waits for the next sample; it stays until the next call. nullptr: there will be none (a replay has ended); never on
/// a truck.
const measurement::PackSample<pack_cells>* next_sample();

/// What is known of the state of charge before the first sample. Asked once, after the first next_sample().
std::optional<measurement::StartingPoint> starting_point();

}  // namespace bms::hal
