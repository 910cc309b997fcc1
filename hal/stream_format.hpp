// Formats of the recording that streams into the replay image and of the estimates that stream out, little-endian:
//
//   in    StreamHeader, then one measurement::Sample after the other
//   out   32-bit words of one estimate after the other
//
// The firmware gives the words of an estimate; it adds one for each state of a mechanism. The board passes them on
// unchanged, and the host (host_sim/images/emulator.cpp) knows how many there are.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "measurement/sample.hpp"

namespace bms::hal {

struct StreamHeader {
  std::array<char, 4> magic = {'B', 'M', 'S', 'R'};
  std::uint32_t version = 1;
  std::uint32_t has_start = 0;  ///< 1: soc_ppb and soc_sigma_ppb are valid
  std::int32_t soc_ppb = 0;
  std::int32_t soc_sigma_ppb = 0;
  std::uint32_t reserved = 0;
};

/// Words that the board's buffer reserves for the estimate of one sample: soc, soc_sigma, v_rc_v, voltage_predicted_v,
/// flags. A longer estimate only makes the board write earlier.
inline constexpr std::size_t words_per_estimate = 5;

static_assert(sizeof(StreamHeader) == 24 && std::is_trivially_copyable_v<StreamHeader>);
static_assert(sizeof(measurement::Sample) == 24 && offsetof(measurement::Sample, current_ua) == 8 &&
              offsetof(measurement::Sample, voltage_uv) == 12 &&
              offsetof(measurement::Sample, temperature_cdegc) == 16);

}  // namespace bms::hal
