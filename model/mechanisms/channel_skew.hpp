// Current and voltage are not read at the same time: the current of row k is that of an interval which ended `delay`
// earlier than the voltage was read (< 0: later). Undone by reading the charge that has flowed at shifted times; it
// needs the readings to come, so it exists on the host alone.
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct ChannelSkew {
  static constexpr std::string_view id = "channel_skew";
  static constexpr Domain domain = Domain::instrument;
  static constexpr bool on_board = false;
  static constexpr bool needs_fpu = true;
  static constexpr std::array parameters = {
      Parameter{"delay_s", "s", Role::strength, 0, -15, 15, Per::cell, "current behind the voltage"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::none;
    S delay_s;

    template <class Real>
    constexpr Law(const std::array<Real, 1>& p, double) : delay_s(S(p[0])) {}
  };
};

}  // namespace bms::model
