// Not all charge that is charged can be discharged: side reactions consume a share of the charging current.
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct CoulombicLoss {
  static constexpr std::string_view id = "coulombic_loss";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"loss_fraction", "1", Role::strength, 0, -0.02, 0.1, Per::cell, "1 - eta, eta: coulombic efficiency",
                0.03},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::counted;
    Fraction<S> stored_fraction;

    template <class Real>
    constexpr Law(const std::array<Real, 1>& p, double) : stored_fraction(Fraction<S>(Real(1) - p[0])) {}

    constexpr Current<S> counted(const Current<S>& counted_a, const StepInput<S>&) const {
      return counted_a > Current<S>(0) ? Current<S>(counted_a * stored_fraction) : counted_a;
    }
  };
};

}  // namespace bms::model
