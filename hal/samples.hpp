// Where measurements come from, as the estimator takes them.
// Back ends: emulated/samples_can (frames), emulated/samples_stream (a recording through the debugger's file access).
#pragma once

#include <optional>

#include "estimator/sample.hpp"

namespace bms::hal {

/// Waits for the next sample; it stays until the next call. nullptr: there will be none (a replay has ended); never on a truck.
const Sample* next_sample();

/// What is known of the state of charge before the first sample. Asked once, after the first next_sample().
std::optional<StartingPoint> starting_point();

}  // namespace bms::hal
