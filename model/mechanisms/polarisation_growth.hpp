// A polarisation larger or slower than the cell file's, at every SOC.
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct PolarisationGrowth {
  static constexpr std::string_view id = "polarisation_growth";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"r1_fraction", "1", Role::strength, 0, -0.8, 6, Per::cell, "relative increase of R1"},
      Parameter{"c1_fraction", "1", Role::strength, 0, -0.8, 6, Per::cell, "relative increase of C1"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::tables;
    Factor<S> r1_times, c1_times;

    template <class Real>
    constexpr Law(const std::array<Real, 2>& p, double)
        : r1_times(Factor<S>(Real(1) + p[0])), c1_times(Factor<S>(Real(1) + p[1])) {}

    constexpr void tables(TablePoint<S>& at, const Soc<S>&, const StepInput<S>&) const {
      mechanism_detail::scale<S>(at.r1_ohm, at.r1_delta_ohm, r1_times);
      at.c1_f = Capacitance<S>(at.c1_f * c1_times);
      at.c1_delta_f = Capacitance<S>(at.c1_delta_f * c1_times);
    }
  };
};

}  // namespace bms::model
