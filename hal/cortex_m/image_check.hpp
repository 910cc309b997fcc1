// Checks that the flash still contains the image as it was linked: CRC-32 (IEEE 802.3, reflected, initial and final
// value inverted) over vectors, code and constants, and the initial values of data, in this order. cmake/image_check.py
// writes the CRC into the image after linking.
#pragma once

namespace bms::hal::cortex_m {

/// Returns true if the CRC matches. An image without a written CRC does not match. Cost: 14 instructions per byte; 5 ms
/// for 55 KB at 168 MHz.
bool image_intact();

}  // namespace bms::hal::cortex_m
