// Where every estimate is kept word for word. Back ends: emulated/samples_stream (a file), absent/ (nowhere).
#pragma once

#include <cstdint>
#include <span>

namespace bms::hal {

void record_estimate(std::span<const std::uint32_t> words);

}  // namespace bms::hal
