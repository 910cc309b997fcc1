// The capacity differs from the cell file's: the SOC moves faster or slower for the same charge.
//
//   d soc / dt = I / (3600 C_n (1 - f))
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct CapacityChange {
  static constexpr std::string_view id = "capacity_change";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"loss_fraction", "1", Role::strength, 0, -0.3, 0.6, Per::cell, "f: lost share of the capacity", 0.25},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::counted;
    Factor<S> faster;

    template <class Real>
    constexpr Law(const std::array<Real, 1>& p, double) : faster(Factor<S>(Real(1) / (Real(1) - p[0]))) {}

    constexpr Current<S> counted(const Current<S>& counted_a, const StepInput<S>&) const { return counted_a * faster; }
  };
};

}  // namespace bms::model
