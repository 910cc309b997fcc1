// The current sensor has an offset: I = I_read - b. A reading of exactly 0 stays: a sensor with an offset reads the
// offset when nothing flows, so that a dead band or an instrument that is off has put the 0 there.
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct CurrentOffset {
  static constexpr std::string_view id = "current_offset";
  static constexpr Domain domain = Domain::instrument;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"offset_a", "A", Role::strength, 0, -0.3, 0.3, Per::ah, "b; bounds in multiples of 1C",
                0.02},  // 1 % of a range of 2C
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::true_current;
    Current<S> offset_a;

    template <class Real>
    constexpr Law(const std::array<Real, 1>& p, double) : offset_a(Current<S>(p[0])) {}

    constexpr Current<S> true_current(const Current<S>& read_a) const {
      return read_a == Current<S>(0) ? read_a : Current<S>(read_a - offset_a);
    }
  };
};

}  // namespace bms::model
