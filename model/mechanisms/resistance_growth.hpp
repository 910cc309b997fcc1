// An ohmic resistance larger than the cell file's, at every SOC: ageing, or a lead.
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct ResistanceGrowth {
  static constexpr std::string_view id = "resistance_growth";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"fraction", "1", Role::strength, 0, -0.6, 20, Per::cell,
                "relative increase of R0; a bad contact has several times the R0 of a cell"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::tables;
    Factor<S> factor;

    template <class Real>
    constexpr Law(const std::array<Real, 1>& p, double) : factor(Factor<S>(Real(1) + p[0])) {}

    constexpr void tables(TablePoint<S>& at, const Soc<S>&, const StepInput<S>&) const {
      mechanism_detail::scale<S>(at.r0_ohm, at.r0_delta_ohm, factor);
    }
  };
};

}  // namespace bms::model
