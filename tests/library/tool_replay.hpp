// What the tool computes for the forklift shift: the reference of the C interface. It is compiled apart, because the
// installed headers define the same names again.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace bms {

struct ReplayedSample {
  std::uint64_t time_us = 0;
  std::int32_t current_ua = 0, voltage_uv = 0;
  std::int16_t temperature_cdegc = 0;
  std::array<std::uint32_t, 5> words{};  ///< of the estimate: soc, sigma, v_rc, predicted voltage, flags
};

/// Replays the shift with the built-in cell in float. initial_soc_ppb: the start; its sigma is 20 %.
std::vector<ReplayedSample> tool_replay(const std::string& cell, std::optional<std::int32_t> initial_soc_ppb);

/// First 32 bits of the SHA-256 of the file of a built-in cell.
std::uint32_t hash_of(const std::string& cell);

}  // namespace bms
