// How often confidence bands of the Hammerstein-Wiener model contain the truth, on exact systems.
#pragma once

#include <cstdint>
#include <string>

namespace bms {

/// Twelve systems from a seed on, six data sets each, 30 resampled models per band.
std::string hammerstein_wiener_bands(std::uint64_t first_seed);

}  // namespace bms
