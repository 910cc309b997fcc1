// A current that no sensor measures discharges the cell, inside it or in parallel to it.
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct Leakage {
  static constexpr std::string_view id = "leakage";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"current_a", "A", Role::strength, 0, -0.002, 0.05, Per::ah, "constant loss; bounds in multiples of 1C"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::counted;
    Current<S> lost_a;

    template <class Real>
    constexpr Law(const std::array<Real, 1>& p, double) : lost_a(Current<S>(p[0])) {}

    constexpr Current<S> counted(const Current<S>& counted_a, const StepInput<S>&) const { return counted_a - lost_a; }
  };
};

}  // namespace bms::model
