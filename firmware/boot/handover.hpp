// The message of the loader to the image that it starts, at an address that both know. Neither initialises this RAM,
// and the image reads it once at its start: the check makes what an image without a loader finds there worthless.
#pragma once

#include <cstdint>
#include <optional>

#include "boot/slots.hpp"

namespace bms::boot {

struct Handover {
  std::uint32_t magic = 0, loader_version = 0, security_counter = 0;
  std::uint8_t slot = 0, trial = 0, returned = 0, refusal = 0, product = 0, development = 0;
  std::uint8_t spare[2]{};
  std::uint32_t version = 0, cell_hash = 0, security_version = 0, check = 0;
};
static_assert(sizeof(Handover) == 36);

inline constexpr std::uint32_t handover_magic = 0x424F'4F54;
/// The last 64 bytes of the loader's own RAM, which no application uses (firmware/loader/memory.ld).
inline constexpr std::uint32_t handover_address = 0x2001'7FC0;

constexpr std::uint32_t check_of(const Handover& h) {
  const std::uint32_t small = static_cast<std::uint32_t>(h.slot) | static_cast<std::uint32_t>(h.trial) << 8 |
                              static_cast<std::uint32_t>(h.returned) << 16 |
                              static_cast<std::uint32_t>(h.refusal) << 24;
  const std::uint32_t kinds = static_cast<std::uint32_t>(h.product) << 8 | h.development;
  return ~(h.magic ^ h.loader_version ^ h.security_counter * 3 ^ small ^ kinds << 13 ^ h.version * 5 ^ h.cell_hash ^
           h.security_version * 7);
}

inline Handover handover_of(const Start& start, const Battery& battery) {
  Handover h;
  h.magic = handover_magic;
  h.loader_version = battery.loader_version;
  h.security_counter = battery.security_counter;
  h.slot = start.slot;
  h.trial = start.trial ? 1 : 0;
  h.returned = start.returned ? 1 : 0;
  h.refusal = static_cast<std::uint8_t>(start.refusal);
  h.product = battery.product ? 1 : 0;
  h.development = start.header.development() ? 1 : 0;
  h.version = start.header.version;
  h.cell_hash = start.header.cell_hash;
  h.security_version = start.header.security_version;
  h.check = check_of(h);
  return h;
}

/// The start that a loader decided, or nothing.
inline std::optional<Start> start_of(const Handover& h) {
  if (h.magic != handover_magic || h.check != check_of(h) || h.slot > 1) return std::nullopt;
  Start s;
  s.found = true;
  s.slot = h.slot;
  s.trial = h.trial != 0;
  s.returned = h.returned != 0;
  s.refusal = static_cast<Refusal>(h.refusal);
  s.header.version = h.version;
  s.header.cell_hash = h.cell_hash;
  s.header.security_version = h.security_version;
  s.header.flags = h.development != 0 ? flag_development : 0;
  return s;
}

/// What the loader decided about cell constants, behind the other message. A loader that knows none leaves no such
/// message.
struct CellHandover {
  std::uint32_t magic = 0;
  std::uint8_t slot = 0, trial = 0, returned = 0, refusal = 0;  ///< slot: 0xFF: those of the application's build
  std::uint32_t version = 0, cell_hash = 0, security_version = 0, security_counter = 0, check = 0;
};
static_assert(sizeof(Handover) + sizeof(CellHandover) == 64);

inline constexpr std::uint32_t cell_handover_magic = 0x4345'4C4C,
                               cell_handover_address = handover_address + sizeof(Handover);
inline constexpr std::uint8_t no_slot = 0xFF;

constexpr std::uint32_t check_of(const CellHandover& h) {
  const std::uint32_t small = static_cast<std::uint32_t>(h.slot) | static_cast<std::uint32_t>(h.trial) << 8 |
                              static_cast<std::uint32_t>(h.returned) << 16 |
                              static_cast<std::uint32_t>(h.refusal) << 24;
  return ~(h.magic ^ small ^ h.version * 5 ^ h.cell_hash ^ h.security_version * 7 ^ h.security_counter * 3);
}

inline CellHandover cell_handover_of(const Start& start, const Battery& battery) {
  CellHandover h;
  h.magic = cell_handover_magic;
  h.slot = start.found ? start.slot : no_slot;
  h.trial = start.trial ? 1 : 0;
  h.returned = start.returned ? 1 : 0;
  h.refusal = static_cast<std::uint8_t>(start.refusal);
  h.version = start.found ? start.header.version : 0;
  h.cell_hash = start.found ? start.header.cell_hash : battery.cell_hash;
  h.security_version = start.found ? start.header.security_version : 0;
  h.security_counter = battery.security_counter;
  h.check = check_of(h);
  return h;
}

/// The start that a loader decided; nothing of a loader without cell constants.
inline std::optional<Start> start_of(const CellHandover& h) {
  if (h.magic != cell_handover_magic || h.check != check_of(h) || (h.slot > 1 && h.slot != no_slot))
    return std::nullopt;
  Start s;
  s.found = h.slot != no_slot;
  s.slot = s.found ? h.slot : std::uint8_t{0};
  s.trial = h.trial != 0;
  s.returned = h.returned != 0;
  s.refusal = static_cast<Refusal>(h.refusal);
  s.header.kind = Kind::cell;
  s.header.version = h.version;
  s.header.cell_hash = h.cell_hash;
  s.header.security_version = h.security_version;
  return s;
}

}  // namespace bms::boot
