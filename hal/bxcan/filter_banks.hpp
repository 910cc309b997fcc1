// Acceptance filters of ST's bxCAN for a list of identifiers: 16-bit list mode, four identifiers per bank (RM0090,
// 32.7.4, figure 342). They accept standard data frames with exactly these identifiers; the controller discards 29-bit
// frames, remote requests and all others.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace bms::hal::bxcan {

struct FilterBank {
  std::uint32_t fr1 = 0, fr2 = 0;
};

/// Identifier in bits 15:5. RTR, IDE and the bits of a 29-bit identifier are 0, so the filter requires 0 there.
constexpr std::uint32_t filter_of(std::uint16_t id) { return static_cast<std::uint32_t>(id) << 5; }

void identifier_exceeds_11_bits();  // not defined: a call stops the compilation

/// CAN1 has the first 14 of the 28 banks by default (CAN_FMR, CAN2SB). Unused entries repeat the last identifier.
template <std::size_t Ids>
consteval std::array<FilterBank, (Ids + 3) / 4> filter_banks(const std::array<std::uint16_t, Ids>& ids) {
  static_assert(Ids > 0 && Ids <= 4 * 14);
  std::array<FilterBank, (Ids + 3) / 4> banks{};
  const auto at = [&](std::size_t k) { return filter_of(ids[k < Ids ? k : Ids - 1]); };
  for (const std::uint16_t id : ids) {
    if (id > 0x7FF) identifier_exceeds_11_bits();
  }
  for (std::size_t k = 0; k < banks.size(); ++k)
    banks[k] = {at(4 * k) | at(4 * k + 1) << 16, at(4 * k + 2) | at(4 * k + 3) << 16};
  return banks;
}

}  // namespace bms::hal::bxcan
