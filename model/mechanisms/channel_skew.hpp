// Current and voltage are not sampled at the same time: the current of row k belongs to an interval that ended `delay`
// before the voltage was sampled (< 0: after). It is undone by reading the charge at shifted times. This needs later
// readings, so the mechanism exists on the host only.
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct ChannelSkew {
  static constexpr std::string_view id = "channel_skew";
  static constexpr Domain domain = Domain::instrument;
  static constexpr bool on_board = false;
  static constexpr bool needs_fpu = true;
  static constexpr std::array parameters = {
      Parameter{"delay_s", "s", Role::strength, 0, -15, 15, Per::cell, "delay of the current relative to the voltage"},
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
