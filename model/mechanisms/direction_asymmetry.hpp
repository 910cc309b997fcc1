// The resistance differs between charge and discharge: R0 and R1 times (1 + a) while the current is positive.
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct DirectionAsymmetry {
  static constexpr std::string_view id = "direction_asymmetry";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"charge_fraction", "1", Role::strength, 0, -0.6, 1.5, Per::cell,
                "a: charge resistance over discharge resistance, minus 1"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::tables;
    Factor<S> charging;

    template <class Real>
    constexpr Law(const std::array<Real, 1>& p, double) : charging(Factor<S>(Real(1) + p[0])) {}

    constexpr void tables(TablePoint<S>& at, const Soc<S>&, const StepInput<S>& input) const {
      if (!(input.current_a > Current<S>(0))) return;  // no current, no drop: its sign near zero does not matter
      mechanism_detail::scale<S>(at.r0_ohm, at.r0_delta_ohm, charging);
      mechanism_detail::scale<S>(at.r1_ohm, at.r1_delta_ohm, charging);
    }
  };
};

}  // namespace bms::model
