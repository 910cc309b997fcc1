// Destination of every estimate in a replay. Back ends: emulated/samples_stream (a file), absent/ (discards it).
#pragma once

#include <cstdint>
#include <span>

namespace bms::hal {

/// words: one estimate, as the host compares it bit by bit.
void record_estimate(std::span<const std::uint32_t> words);

}  // namespace bms::hal
