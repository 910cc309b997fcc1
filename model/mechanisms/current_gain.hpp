// The current sensor has a gain error: I = I_read / (1 + g).
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct CurrentGain {
  static constexpr std::string_view id = "current_gain";
  static constexpr Domain domain = Domain::instrument;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"gain_error", "1", Role::strength, 0, -0.5, 1, Per::cell, "g", 0.03},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::true_current;
    Factor<S> factor;

    template <class Real>
    constexpr Law(const std::array<Real, 1>& p, double) : factor(Factor<S>(Real(1) / (Real(1) + p[0]))) {}

    constexpr Current<S> true_current(const Current<S>& read_a) const { return read_a * factor; }
  };
};

}  // namespace bms::model
