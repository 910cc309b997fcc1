// Checks that the flash still contains the image as it was linked: CRC-32 (IEEE 802.3, reflected, initial and final
// value inverted) over vectors, code and constants, and the initial values of data, in this order. cmake/image_check.py
// writes the CRC into the image after linking.
#pragma once

#include <cstdint>

namespace bms::hal::cortex_m {

/// Reads up to `bytes` further bytes, at most to the end of the image; the next call after the end begins again.
/// Returns false from the first pass with a wrong CRC until the next reset. An image without a written CRC is wrong.
/// Cost: 14 instructions per byte; 5 ms for 55 KB at 168 MHz.
bool image_intact(std::uint32_t bytes);

}  // namespace bms::hal::cortex_m
