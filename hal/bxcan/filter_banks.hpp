// Acceptance filters of ST's bxCAN for a list of identifiers: 16-bit list mode, four identifiers per bank (RM0090,
// 32.7.4, figure 342). They accept standard data frames with exactly these identifiers. 29-bit frames have banks in
// mask mode; the controller discards remote requests and all others.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

namespace bms::hal::bxcan {

struct FilterBank {
  std::uint32_t fr1 = 0, fr2 = 0;
};

/// Identifier in bits 15:5. RTR, IDE and the bits of a 29-bit identifier are 0, so the filter requires 0 there.
constexpr std::uint32_t filter_of(std::uint16_t id) { return static_cast<std::uint32_t>(id) << 5; }

/// CAN1 has the first 14 of the 28 banks by default (CAN_FMR, CAN2SB).
inline constexpr std::size_t banks = 14, ids_per_bank = 4, max_ids = banks * ids_per_bank;

/// Returns true if the banks have room for all identifiers, and each has 11 bits.
constexpr bool fits(std::span<const std::uint16_t> ids) {
  return !ids.empty() && ids.size() <= max_ids &&
         std::all_of(ids.begin(), ids.end(), [](std::uint16_t id) { return id <= 0x7FF; });
}

constexpr std::size_t bank_count(std::span<const std::uint16_t> ids) {
  return (ids.size() + ids_per_bank - 1) / ids_per_bank;
}

/// Bank k of a list that fits. Unused entries repeat the last identifier.
constexpr FilterBank filter_bank(std::span<const std::uint16_t> ids, std::size_t k) {
  const auto pair_from = [&](std::size_t first) {
    const std::size_t last = ids.size() - 1;
    return filter_of(ids[std::min(first, last)]) | filter_of(ids[std::min(first + 1, last)]) << 16;
  };
  return {pair_from(ids_per_bank * k), pair_from(ids_per_bank * k + 2)};
}

/// A bank for 29-bit data frames whose identifier has the bits of `id` where `mask` has ones: 32 bits, mask mode
/// (figure 342). Bit 2 is IDE, bit 1 RTR.
constexpr FilterBank long_filter_bank(std::uint32_t id, std::uint32_t mask) {
  constexpr std::uint32_t ide = 4, rtr = 2;
  return {id << 3 | ide, mask << 3 | ide | rtr};
}

}  // namespace bms::hal::bxcan
