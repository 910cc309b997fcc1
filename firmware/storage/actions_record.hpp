// What service sessions have done: the last sixteen actions (records.hpp has the other records).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "storage/records.hpp"

namespace bms::storage {

/// Layout 1, 4 + 11 n bytes.
struct ActionsRecord {
  static constexpr Kind kind{7, 1};
  static constexpr std::size_t max_actions = 16, bytes_of_action = 11;
  struct Action {
    std::uint8_t code = 0;              ///< StoredAction.Code of firmware/can/greybox_bms.dbc; 0: no action
    std::uint16_t operator_number = 0;  ///< who opened the session
    std::uint32_t argument = 0;         ///< of the command
    std::uint32_t time_s = 0;           ///< as EventsRecord::Fault::time_s
    constexpr bool operator==(const Action&) const = default;
  };

  std::uint32_t actions = 0;  ///< total; the newest is at (actions - 1) modulo 16
  std::array<Action, max_actions> action{};

  constexpr void add(const Action& a) { action[actions++ % max_actions] = a; }
  /// back: 0 for the newest, at most 15.
  constexpr Action last(std::uint32_t back) const {
    return back < actions ? action[(actions - 1 - back) % max_actions] : Action{};
  }
  constexpr bool operator==(const ActionsRecord&) const = default;
};

constexpr Bytes encode(const ActionsRecord& r, Payload into) {
  Encoder e(into);
  e.put(r.actions);
  for (const auto& a : r.action) e.put(a.code).put(a.operator_number).put(a.argument).put(a.time_s);
  return e.bytes();
}

constexpr bool decode(Bytes from, std::uint8_t layout, ActionsRecord& r) {
  if (layout != 1 || from.size() != 4 + ActionsRecord::bytes_of_action * ActionsRecord::max_actions) return false;
  Decoder d(from);
  d.get(r.actions);
  for (auto& a : r.action) {
    d.get(a.code);
    d.get(a.operator_number);
    d.get(a.argument);
    d.get(a.time_s);
  }
  return true;
}

}  // namespace bms::storage
