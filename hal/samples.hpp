// Source of the measurements for estimator and protection.
// Back ends: bq76952/samples (a monitoring chip), adc/samples (the chip's own converter), remote/samples (another
// node), emulated/samples_can (CAN frames), emulated/samples_stream (a recording through the debugger's files).
#pragma once

#include <cstdint>
#include <optional>

#include "board_config.hpp"  // generated from boards/<board>/board.cmake: pack_cells, sample_period_s
#include "measurement/pack_sample.hpp"

namespace bms::hal {

/// Waits for the next sample, which stays valid until the next call. Returns nullptr when a replay has ended; never on
/// a truck.
const measurement::PackSample<pack_cells>* next_sample();

/// Duration of the transfers and conversions of the last sample, until next_sample() returned it [us]; 0 if frames or a
/// recording bring the samples.
std::uint32_t acquisition_us();

/// Known state of charge before the first sample, if any. Call once, after the first next_sample(). Boards that measure
/// themselves have none (absent/starting_point): on their bus it could be another device's frame.
std::optional<measurement::StartingPoint> starting_point();

}  // namespace bms::hal
