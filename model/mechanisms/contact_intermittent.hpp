// A loose contact: a resistance is added to R0 in bursts. The bursts are read from one recording and are not valid for
// another one.
#pragma once

#include <span>

#include "model/mechanism.hpp"

namespace bms::model {

/// A time interval, both ends included.
struct Span {
  double start_s = 0, end_s = 0;
  constexpr bool operator==(const Span&) const = default;
};

struct ContactIntermittent {
  static constexpr std::string_view id = "contact_intermittent";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = false;
  static constexpr std::array parameters = {
      Parameter{"resistance_ohm", "ohm", Role::strength, 0, 0, 1, Per::siemens, "added to R0 in a burst"},
      Parameter{"share", "1", Role::given, 0, 0, 1, Per::cell, "share of the time in bursts"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::tables | law_member::at;
    Resistance<S> added_ohm;
    std::span<const Span> bursts;  ///< ascending, of the present recording; empty: the contact is good
    std::size_t next = 0;
    bool active = false;

    template <class Real>
    constexpr Law(const std::array<Real, 2>& p, double) : added_ohm(Resistance<S>(p[0])) {}

    constexpr void at(double time_s) {
      while (next < bursts.size() && time_s > bursts[next].end_s) ++next;
      active = next < bursts.size() && time_s >= bursts[next].start_s;
    }
    constexpr void tables(TablePoint<S>& at, const Soc<S>&, const StepInput<S>&) const {
      if (active) at.r0_ohm = Resistance<S>(at.r0_ohm + added_ohm);
    }
  };
};

}  // namespace bms::model
